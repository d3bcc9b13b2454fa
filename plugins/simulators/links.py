"""Say of the robot's links with a tool what every engine asks: friction, and which bear the tool."""

from __future__ import annotations

from core.design import GRIPPER_MOUNTS, Tool
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
