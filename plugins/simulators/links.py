"""Say of the robot's links with a tool what every engine asks: friction, which bear the tool, and inertia."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import GRIPPER_MOUNTS, Tool
from core.geometry import Array, Pose
from core.scene import Inertia
from core.values.robots import Robot


def friction_of(robot: Robot, tool: Tool, link: str) -> float:
    """Return the friction coefficient of a link, or of a component of the tool."""
    if robot.gripper is not None and link in GRIPPER_MOUNTS:
        return robot.gripper.friction
    return tool.friction if link in tool.borne_on else robot.friction


def bearers(robot: Robot, tool: Tool) -> tuple[str, ...]:
    """Return the links that the tool overlaps where it is mounted, and so never touches."""
    if tool.gripper and robot.gripper is not None:
        return robot.gripper.near_mount
    return robot.near_mount


def principal(mass: float, center: Array, tensor: Array) -> Inertia:
    """Make an inertia of a mass, kg, with its centre (3,) and its tensor (3, 3) about that."""
    moments, axes = np.linalg.eigh(tensor)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    return Inertia(
        mass, Pose.from_rotation(center, Rotation.from_matrix(axes)), moments
    )
