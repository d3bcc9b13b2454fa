"""The reward of LeverStone."""

from dataclasses import replace

import numpy as np
import pytest

from core.scene import Pose
from tasks.hardtoolbench.lever_stone import HEIGHT, LENGTH, LeverStone

TASK = LeverStone()
SCENE = TASK.scene(0)
START = SCENE.complete(SCENE.state())


def reward(raised, slid=0.0, roll=0.0, speed=0.0):
    """The reward of a stone whose near edge was raised about its far edge."""
    far = Pose.xyz_rpy((LENGTH / 2, 0.0, -HEIGHT / 2))
    turn = Pose.xyz_rpy((slid, 0.0, 0.0), (roll, np.arcsin(raised / LENGTH), 0.0))
    pose = SCENE["stone"].pose @ far @ turn @ far.inverse()
    moving = np.array([[0.0, 0.0, speed]])
    end = replace(
        START,
        positions=pose.position[None],
        quaternions=pose.quaternion[None],
        linear_velocities=moving,
    )
    return float(TASK.reward(START, end))


def test_the_reward_rises_to_1_in_the_range_and_falls_above_it():
    up = [reward(raised) for raised in np.linspace(0.0, 0.026, 14)]
    assert up[0] == 0.0
    assert (np.diff(up) >= 0).all()
    assert up[-1] == reward(0.039) == 1.0
    assert reward(0.05) < 1.0
    assert reward(0.08) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("case", "most"),
    [
        pytest.param({"raised": 0.03, "slid": 0.08}, 0.0, id="pushed off the slab"),
        pytest.param({"raised": 0.03, "speed": 0.1}, 0.0, id="falling back"),
        pytest.param({"raised": 0.0, "roll": 0.1}, 0.0, id="one corner only"),
        pytest.param({"raised": -0.03}, 0.0, id="pressed down"),
    ],
)
def test_what_earns_nothing(case, most):
    assert reward(**case) <= most + 1e-6
