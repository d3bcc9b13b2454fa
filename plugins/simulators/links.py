"""Say of the robot's links with a tool what every engine asks: friction, and which bear the tool."""

from __future__ import annotations

from functools import lru_cache

from core.design import GRIPPER_MOUNTS, Tool
from core.robot.description import assembled
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


@lru_cache(maxsize=16)
def beyond(robot: Robot, tool: Tool) -> frozenset[str]:
    """Name the links that the arm's last joint moves, with those of the tool, as `assembled` for engines."""
    arm = assembled(robot, tool, fused=True)
    last = arm.named[robot.arm_joints[-1]].child
    return frozenset(name for name in arm.links if last in arm.above(name))
