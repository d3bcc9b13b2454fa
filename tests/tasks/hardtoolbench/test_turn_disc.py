"""The reward of TurnDisc."""

from dataclasses import replace

import numpy as np
import pytest

from core.geometry import Pose
from core.scene import State
from tasks.hardtoolbench.turn_disc import TurnDisc

TASK = TurnDisc()
SCENE = TASK.scene(0)
START = SCENE.complete(SCENE.state())
MARK = START.position("mark")


def reward(degrees, at=MARK, speed=0.0):
    """The reward of a disc that is turned by so much, about an axis across the board."""
    turned = Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, np.radians(degrees), 0.0)).quaternion
    end = replace(
        START,
        positions=at[None] + np.array([0.0, 0.0, 0.008]),
        quaternions=turned[None],
        linear_velocities=np.array([[speed, 0.0, 0.0]]),
    )
    assert isinstance(end, State)
    return float(TASK.reward(START, end))


def test_the_reward_rises_with_the_turn():
    rewards = [reward(degrees) for degrees in range(0, 181, 5)]
    assert rewards[0] == 0.0
    assert (np.diff(rewards) >= 0).all()
    assert rewards[-1] == rewards[-4] == 1.0  # 165 degrees


def test_the_reward_falls_with_the_distance_from_the_mark():
    rewards = [
        reward(180.0, MARK + np.array([away, 0.0, 0.0]))
        for away in np.linspace(0.0, 0.2, 21)
    ]
    assert rewards[0] == rewards[1] == 1.0
    assert (np.diff(rewards) <= 0).all()
    assert rewards[-1] == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("degrees", "at", "speed", "most"),
    [
        pytest.param(0.0, MARK, 0.0, 0.0, id="only pushed onto the mark"),
        pytest.param(90.0, MARK, 0.0, 0.1, id="left standing on its rim"),
        pytest.param(
            180.0,
            MARK + np.array([0.0, 0.0, 0.2]),
            0.0,
            0.1,
            id="held upside down above the mark",
        ),
        pytest.param(
            180.0, np.array([2.0, 0.0, -0.6]), 0.0, 0.1, id="thrown to the floor"
        ),
        pytest.param(180.0, MARK, 1.0, 0.0, id="still in motion"),
    ],
)
def test_what_earns_little(degrees, at, speed, most):
    assert reward(degrees, at, speed) <= most + 1e-9
