"""Find the robot's joints in a MuJoCo model."""

from __future__ import annotations

from collections.abc import Sequence

from core.design import Tool
from core.geometry import Array
from core.robot.description import joint_name
from core.values.robots import Robot
from plugins.simulators.links import split_joints
from plugins.simulators.mujoco.shapes import Element

HELD = 1e3  # N m or N, of dry friction that holds a joint of the tool


class Joints:
    """Where the robot's joints are among a model's positions.

    Attributes:
        driven: those with a motor: the arm's, and the fingers' of a gripper tool.
        loose: the tool's; joints, speeds and positions have the same numbers.
        arm: how many are the arm's.

    Args:
        robot: the arm.
        tool: what it holds.
        model: of both.
    """

    def __init__(self, robot: Robot, tool: Tool, model: Element) -> None:
        names = [joint_name(bearer.name) for bearer in tool.bearers]
        self._robot = robot
        self._tool = tool
        self.driven = _find_positions(model, robot.joints(tool.gripper))
        self.loose = _find_positions(model, names)
        self.arm = len(robot.arm_joints)

    @property
    def count(self) -> int:
        """How many there are; the free bodies' positions follow."""
        return len(self.driven) + len(self.loose)

    def hold(self, model: Element, *, held: bool) -> None:
        """Hold the tool's joints, or let them go: held, they have no springs, and their friction bears everything."""
        if held:
            model.jnt_stiffness[self.loose] = 0.0
            model.dof_frictionloss[self.loose] = HELD
            return

        joints = [bearer.joint for bearer in self._tool.bearers]
        model.jnt_stiffness[self.loose] = [joint.stiffness for joint in joints]
        model.dof_frictionloss[self.loose] = [joint.friction for joint in joints]

    def read(self, qpos: Array) -> tuple[Array, Array]:
        """Take the arm's joints (T, J), and the fingers' with the tool's (T, F + K), from positions (T, Q)."""
        joints = qpos[:, [*self.driven, *self.loose]]
        return split_joints(self._robot, self._tool, joints)


def _find_positions(model: Element, names: Sequence[str]) -> list[int]:
    """Return the numbers of joints' positions in the model."""
    return [int(model.joint(name).qposadr[0]) for name in names]
