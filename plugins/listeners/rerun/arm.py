"""The visual meshes of the arm's links, and the poses of the links at given joints."""

from __future__ import annotations

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from core.geometry import Array
from core.interfaces import Robot
from core.robot.frames import link_frames
from core.robot.visuals import link_visuals


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


def tracks(robot: Robot, gripper: bool, arm: Array, fingers: Array) -> dict[str, Array]:
    """The motion of each link in the world, at arm joints (T, J) and fingers (T, F): (T, 7), x, y, z in metres, then a
    quaternion (x, y, z, w), as Rerun has them.
    """
    return {
        name: np.hstack([positions, Rotation.from_matrix(rotations).as_quat()])
        for name, (rotations, positions) in link_frames(robot, gripper, arm, fingers).items()
    }
