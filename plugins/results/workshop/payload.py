"""Compute the payload that an arm's controller has to know: mass, centre of mass and inertia of the tool."""

from __future__ import annotations

from typing import Any

import numpy as np

from core.design import RIGID_MOUNT, Tool
from core.geometry import Pose, mass_properties
from core.robot.description import merged
from core.robot.frames import open_mounts
from core.values.robots import Robot

GRAVITY = 9.80665


def payload(robot: Robot, tool: Tool) -> dict[str, Any]:
    """Return the tool's ``mass_kg``, ``center_m`` (3,) and ``inertia_kg_m2`` (3, 3) about it, in the axes of ``frame``.

    ``frame`` is the link that bears the tool; attachments to fingers count where they are with the fingers open. A
    joint of the tool counts at its rest. ``moment_nm`` is the greatest moment of its weight at the mount.
    """
    mounts = open_mounts(robot, tool.gripper) | {RIGID_MOUNT: Pose()}
    parts = []
    for component in tool.components:
        mount, pose = tool.placed()[component.name]
        at = robot.mount @ mounts[mount] @ pose
        turn, (center, tensor) = at.rotation.as_matrix(), mass_properties(component.shape, component.mass)
        parts.append((component.mass, at.apply(center), turn @ tensor @ turn.T))
    mass, center, tensor = merged(parts) if parts else (0.0, np.zeros(3), np.zeros((3, 3)))
    lever = float(np.linalg.norm(center - robot.mount.position))
    return {
        "frame": robot.mount_link,
        "mass_kg": round(mass, 6),
        "center_m": np.round(center, 6).tolist(),
        "inertia_kg_m2": np.round(tensor, 9).tolist(),
        "moment_nm": round(mass * GRAVITY * lever, 4),
        "share_of_payload": round(mass / robot.payload_kg, 4),
    }
