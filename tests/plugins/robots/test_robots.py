"""The arms that are built in."""

import numpy as np
import pytest

from core.geometry import Pose
from core.plugins import PluginPart, installed
from core.robot.kinematics import arm_of
from plugins.conformance.suites import SUITES
from plugins.robots.arms import measured
from tests.support.rare import rare

# The home of most tasks, and where the base has to stand for it.
HOME = Pose.xyz_rpy((0.5, 0.0, 0.5))
SHEETS = {
    "panda": (7, 3.0, True),
    "fr3": (7, 3.0, True),
    "kinova": (6, 2.2, False),
    "ur5": (6, 5.0, False),
    "ur10": (6, 10.0, False),
    "xarm7": (7, 3.5, False),
    "z1": (6, 3.0, False),
}
NAMES = tuple(SHEETS)
BASES = {"z1": (0.15, 0.0, 0.35, 0.0)}


@pytest.mark.slow
@pytest.mark.parametrize("name", rare(NAMES, "panda"))
def test_robots_conform(name):
    checked = installed().create("robot", name)
    for check in SUITES["robot"]:
        check(checked)


@pytest.mark.parametrize("name", NAMES)
def test_home_is_the_tasks(name):
    robot = PluginPart("robot", name, base=BASES.get(name, (0.0,) * 4)).create()
    arm = arm_of(robot)
    assert np.abs(arm.home_for(HOME) - arm.home).max() < 1e-3


@pytest.mark.parametrize("name", NAMES)
def test_figures_are_those_of_the_data_sheets(name):
    robot = installed().create("robot", name)
    assert (
        len(robot.arm_joints),
        robot.payload_kg,
        robot.gripper is not None,
    ) == SHEETS[name]
    assert set(measured(name)) == {"pybullet", "sapien", "mujoco"}
