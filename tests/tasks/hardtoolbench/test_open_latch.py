"""The reward of OpenLatch."""

from dataclasses import replace

import numpy as np
import pytest

from core.scene import Pose
from core.values.joints import Placement
from tasks.hardtoolbench.open_latch import OPEN, OpenLatch

TASK = OpenLatch()
SCENE = TASK.scene(0)
START = SCENE.complete(SCENE.state())
STILL = np.zeros(3)


def ended(angle, speed=0.0, shift=STILL, tilt=0.0):
    """The end of a door at an angle, and a glass that was moved."""
    parent = Placement.at_rest(SCENE["cabinet"].pose)
    leaf = START.joints["hinge"].carry(np.asarray(angle), np.asarray(speed), parent)
    glass = Pose.xyz_rpy(SCENE["glass"].pose.position + shift, (tilt, 0.0, 0.0))
    return replace(
        START,
        positions=np.stack([leaf.position, glass.position]),
        quaternions=np.stack([leaf.quaternion, glass.quaternion]),
        linear_velocities=np.stack([leaf.linear, STILL]),
        angular_velocities=np.stack([leaf.angular, STILL]),
    )


def reward(angle, speed=0.0, shift=STILL, tilt=0.0):
    """The reward of such an end."""
    return float(TASK.reward(START, ended(angle, speed, shift, tilt)))


def test_the_reward_rises_with_the_angle():
    rewards = [reward(angle) for angle in np.linspace(0.0, OPEN, 19)]
    assert rewards[0] == rewards[1] == 0.0  # the latch has not let go
    assert (np.diff(rewards) >= 0).all()
    assert rewards[-1] == reward(1.9) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("case", "most"),
    [
        pytest.param({"speed": 1.0}, 0.0, id="in a swing"),
        pytest.param(
            {"shift": np.array([-0.06, 0.0, 0.0])}, 0.0, id="the glass was pushed"
        ),
        pytest.param({"tilt": 1.57}, 0.0, id="the glass fell"),
        pytest.param(
            {"shift": np.array([-0.03, 0.0, 0.0])}, 0.51, id="the glass was touched"
        ),
    ],
)
def test_what_costs(case, most):
    assert reward(1.0, **case) <= most  # type: ignore[arg-type]


def test_margins_of_the_glass_and_of_the_door():
    glass, turned, door = TASK.margins(
        START, ended(OPEN + 0.1, shift=np.array([0.005, 0.0, 0.0]))
    )
    assert (glass.name, glass.limit, round(glass.margin, 6)) == (
        "glass moved",
        0.01,
        0.5,
    )
    assert (turned.name, turned.margin) == ("glass turned", 1.0)
    assert (door.name, door.limit, door.value) == (
        "door",
        OPEN,
        pytest.approx(OPEN + 0.1),
    )
    assert 0 < door.margin < 1
    assert TASK.margins(START, ended(OPEN - 0.1))[2].margin < 0
