"""The visual meshes of the arm's links, and the poses of the links at given joints."""

from __future__ import annotations

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from core.design import Tool
from core.geometry import Array
from core.interfaces import Robot
from core.robot.frames import bearer_frames, link_frames, tool_values
from core.robot.meshes import link_visuals


def links(robot: Robot, gripper: bool) -> dict[str, trimesh.Trimesh]:
    """The visual mesh of each link of the bare arm, in the link's frame; with the gripper, or without."""
    found = {}
    for name, visuals in link_visuals(robot, gripper).items():
        pieces = []
        for shape, pose, color in visuals:
            mesh = shape.to_trimesh()
            pieces.append(trimesh.Trimesh(mesh.vertices, mesh.faces, vertex_colors=color).apply_transform(pose.matrix))
        found[name] = trimesh.util.concatenate(pieces)
    return found


def tracks(robot: Robot, tool: Tool, arm: Array, fingers: Array) -> dict[str, Array]:
    """The motion of each link in the world, at arm joints (T, J) and fingers with the tool's joints (T, F + K).

    Each is (T, 7): x, y, z in metres, then a quaternion (x, y, z, w), as Rerun has them.
    """
    frames = link_frames(robot, tool.gripper, arm, fingers)
    frames |= bearer_frames(tool, tool_values(robot, tool, fingers), frames)
    return {
        name: np.hstack([positions, Rotation.from_matrix(rotations).as_quat()])
        for name, (rotations, positions) in frames.items()
    }
