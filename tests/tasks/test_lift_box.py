from dataclasses import replace

import numpy as np
import pytest

from core.scene import State
from tasks.lift_box import CENTER, WANTED_HEIGHT, LiftBox

TASK = LiftBox()
START = TASK.scene(0).state()


def at(*position):
    return replace(START, positions=np.array([position]))


def test_reward_rises_in_step_with_the_box_lifted():
    lifted = [at(CENTER[0], CENTER[1], z) for z in np.linspace(CENTER[2], WANTED_HEIGHT, 11)]
    rewards = np.array([TASK.reward(START, end) for end in lifted])
    assert rewards == pytest.approx(np.linspace(0, 1, 11))
    assert TASK.reward(State.stack([START] * 11), State.stack(lifted)) == pytest.approx(rewards)


@pytest.mark.parametrize(
    "position",
    [
        (CENTER[0] + 0.2, 0.0, CENTER[2]),  # pushed along the table
        (CENTER[0], 0.13, WANTED_HEIGHT),  # lifted, and as far to the side
        (1.5, 0.0, CENTER[2] - 0.6),  # off the table
        (CENTER[0], 0.0, 2.0),  # thrown up
    ],
)
def test_a_box_elsewhere_earns_nothing(position):
    assert TASK.reward(START, at(*position)) == pytest.approx(0.0, abs=1e-9)


def test_reward_counts_from_where_the_box_settled():
    settled = at(CENTER[0] + 0.01, CENTER[1], CENTER[2] - 0.002)
    assert TASK.reward(settled, settled) == 0.0
    assert TASK.reward(settled, at(CENTER[0] + 0.01, CENTER[1], WANTED_HEIGHT)) == pytest.approx(1.0)
