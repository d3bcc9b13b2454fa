"""Find the robot's joints in a MuJoCo model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from core.design import Tool
from core.geometry import Array
from core.robot.description import joint_name
from core.values.robots import Robot
from plugins.simulators.mujoco.shapes import Element

HELD = 1e3  # N m or N, of dry friction that holds a joint of the tool


@dataclass(frozen=True, eq=False)
class Joints:
    """Where the robot's joints are among a model's positions.

    Attributes:
        driven: those with a motor: the arm's, and the fingers' of a gripper tool.
        loose: the tool's; joints, speeds and positions have the same numbers.
        stiffness: of the tool's joints (K,).
        friction: their dry friction (K,).
        arm: how many are the arm's.
        fingers: how many the robot has.
    """

    driven: list[int]
    loose: list[int]
    stiffness: Array
    friction: Array
    arm: int
    fingers: int

    @classmethod
    def find(cls, robot: Robot, tool: Tool, model: Element) -> Joints:
        """Find the joints of a robot with a tool in their model."""
        tools = [bearer.joint for bearer in tool.bearers]
        names = [joint_name(bearer.name) for bearer in tool.bearers]
        return cls(
            driven=_find_positions(model, robot.joints(tool.gripper)),
            loose=_find_positions(model, names),
            stiffness=np.array([joint.stiffness for joint in tools]),
            friction=np.array([joint.friction for joint in tools]),
            arm=len(robot.arm_joints),
            fingers=len(robot.finger_joints),
        )

    @property
    def count(self) -> int:
        """How many there are; the free bodies' positions follow."""
        return len(self.driven) + len(self.loose)

    @property
    def grip(self) -> int:
        """How many of the driven ones are fingers'."""
        return len(self.driven) - self.arm

    def hold(self, model: Element, *, held: bool) -> None:
        """Hold the tool's joints, or let them go: held, they have no springs, and their friction bears everything."""
        if held:
            model.jnt_stiffness[self.loose] = 0.0
            model.dof_frictionloss[self.loose] = HELD
            return

        model.jnt_stiffness[self.loose] = self.stiffness
        model.dof_frictionloss[self.loose] = self.friction

    def read(self, qpos: Array) -> tuple[Array, Array]:
        """Take the arm's joints (T, J), and the fingers' with the tool's (T, F + K), from positions (T, Q)."""
        others = np.zeros((len(qpos), self.fingers + len(self.loose)))
        others[:, : self.grip] = qpos[:, self.driven[self.arm :]]
        others[:, self.fingers :] = qpos[:, self.loose]
        return qpos[:, self.driven[: self.arm]], others


def _find_positions(model: Element, names: Sequence[str]) -> list[int]:
    """Return the numbers of joints' positions in the model."""
    return [int(model.joint(name).qposadr[0]) for name in names]
