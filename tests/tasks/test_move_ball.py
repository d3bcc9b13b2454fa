from dataclasses import replace

import numpy as np
import pytest

from core.scene import State
from tasks.move_ball import TARGET, MoveBall

TASK = MoveBall()
BEFORE = TASK.scene(0).state()
STILL = (0.0, 0.0, 0.0)


def reward(*ends):
    """The rewards for pairs of a position and a velocity of the ball."""
    states = [
        replace(
            BEFORE,
            positions=np.array([place], dtype=float),
            linear_velocities=np.array([velocity], dtype=float),
        )
        for place, velocity in ends
    ]
    return TASK.reward(
        State.stack([BEFORE] * len(states)), State.stack(states)
    ).tolist()


def test_the_reward_is_the_fraction_of_the_way():
    y = [0.3, 0.15, 0.0, -0.15, -0.3, -0.45]
    np.testing.assert_allclose(
        reward(*[((0.6, at, 0.08), STILL) for at in y]),
        [0, 0.25, 0.5, 0.75, 1, 0.75],
        atol=1e-12,
    )


@pytest.mark.parametrize("direction", [(1, 0, 0), (0, -1, 0), (0.6, 0, -0.8)])
def test_speed_in_any_direction_is_subtracted(direction):
    ends = [(TARGET, np.multiply(speed, direction)) for speed in (0, 0.1, 0.5, 1, 3)]
    np.testing.assert_allclose(reward(*ends), [1, 0.9, 0.5, 0, 0], atol=1e-12)
