"""The default robot, the Panda, which most tests are about: its arm, its numbers, and tasks that it performs."""

from typing import TypeVar

from core.interfaces import Task, ToolRepresentation
from core.plugins import installed
from core.robot.kinematics import arm_of

T = TypeVar("T", bound=Task | ToolRepresentation)

PANDA = installed().default_robot
ARM = arm_of(PANDA)
ARM_JOINTS, FINGER_JOINTS = PANDA.arm_joints, PANDA.finger_joints
HOME_JOINTS, FINGER_OPEN = PANDA.home, PANDA.opening_m


def on_panda(part: T) -> T:
    """Give a task or a tool representation that was made by hand the Panda."""
    part.robot = PANDA
    return part
