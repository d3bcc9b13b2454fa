"""Meshes and poses as Rerun has them."""

from __future__ import annotations

import numpy as np
import rerun as rr
import trimesh

from core.geometry import Pose
from core.interfaces import Robot
from core.robot.meshes import link_visuals
from core.scene import Color

_SHARP_RAD = np.radians(30.0)
"""Faces that meet at a wider angle are shaded apart."""


def shaded(solid: trimesh.Trimesh, color: Color) -> trimesh.Trimesh:
    """The solid with a normal and a colour at each vertex."""
    mesh = trimesh.graph.smooth_shade(solid, angle=_SHARP_RAD)
    mesh.visual.vertex_colors = np.clip(color, 0.0, 1.0)
    return mesh


def links(robot: Robot, gripper: bool) -> dict[str, trimesh.Trimesh]:
    """The visual mesh of each link of the bare arm, in the link's frame; with the gripper, or without."""
    meshes = {}
    for name, visuals in link_visuals(robot, gripper).items():
        pieces = []
        for part in visuals:
            mesh = part.shape.to_trimesh()
            piece = trimesh.Trimesh(mesh.vertices, mesh.faces, vertex_colors=part.color)
            pieces.append(piece.apply_transform(part.pose.matrix))

        meshes[name] = trimesh.util.concatenate(pieces)

    return meshes


def to_transform(pose: Pose) -> rr.Transform3D:
    """Return a pose as Rerun has it."""
    quaternion = np.roll(pose.quaternion, -1)
    return rr.Transform3D(translation=pose.position, quaternion=quaternion)


def to_mesh(solid: trimesh.Trimesh, opacity: float = 1.0) -> rr.Mesh3D:
    """Return a mesh with colours as Rerun has it."""
    return rr.Mesh3D(
        vertex_positions=solid.vertices,
        triangle_indices=solid.faces,
        vertex_normals=solid.vertex_normals,
        vertex_colors=solid.visual.vertex_colors,
        albedo_factor=(1.0, 1.0, 1.0, opacity),
    )
