"""Say of the robot's links and joints with a tool what every engine asks."""

from __future__ import annotations

import numpy as np

from core.design import GRIPPER_MOUNTS, Tool
from core.geometry import Array
from core.values.robots import Robot


def friction_of(robot: Robot, tool: Tool, link: str) -> float:
    """Return the friction coefficient of a link, or of a component of the tool."""
    if robot.gripper is not None and link in GRIPPER_MOUNTS:
        return robot.gripper.friction
    if link in tool.borne_on:
        return tool.friction
    return robot.friction


def bearers(robot: Robot, tool: Tool) -> tuple[str, ...]:
    """Return the links that the tool overlaps where it is mounted, and so never touches."""
    if tool.gripper and robot.gripper is not None:
        return robot.gripper.near_mount
    return robot.near_mount


def split_joints(robot: Robot, tool: Tool, values: Array) -> tuple[Array, Array]:
    """Split values of the joints with motors, behind which those of the tool stand, see `Recording`.

    Args:
        robot: the arm.
        tool: without the gripper, nothing moves the fingers, and they have 0.
        values: (..., N).

    Returns:
        The arm's (..., J), and the fingers' with the tool's (..., F + K).
    """
    arm = len(robot.arm_joints)
    idle = 0 if tool.gripper else len(robot.finger_joints)
    fingers = np.zeros((*values.shape[:-1], idle))
    return values[..., :arm], np.concatenate([fingers, values[..., arm:]], axis=-1)
