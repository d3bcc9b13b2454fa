"""The visual meshes of the arm's links, and the poses of the links at given joints."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import collada
import numpy as np
import trimesh
from collada.triangleset import BoundTriangleSet
from lxml import etree
from scipy.spatial.transform import Rotation

from core.design import Tool
from core.geometry import Array, Pose
from core.robot.description import assemble
from core.robot.frames import link_frames


def links(gripper: bool) -> dict[str, trimesh.Trimesh]:
    """The visual mesh of each link of the bare arm, in the link's frame; with the hand, or without."""
    robot = etree.fromstring(assemble(Tool(gripper=gripper)).encode())
    found = {}
    for link in robot.findall("link"):
        pieces = []
        for visual in link.findall("visual"):
            pose = Pose.xyz_rpy(_numbers(visual, "string(origin/@xyz)"), _numbers(visual, "string(origin/@rpy)"))
            mesh = _load(str(visual.xpath("string(geometry/mesh/@filename)")))
            pieces.append(mesh.copy().apply_transform(pose.matrix))
        if pieces:
            found[str(link.get("name"))] = trimesh.util.concatenate(pieces)
    return found


def _numbers(element: Any, path: str) -> list[float]:
    return [float(x) for x in str(element.xpath(path)).split()] or [0.0, 0.0, 0.0]


@lru_cache(maxsize=16)
def _load(file: str) -> trimesh.Trimesh:
    """The triangles of a Collada file, in the colours of its materials."""
    geometries = collada.Collada(file).scene.objects("geometry")
    return trimesh.util.concatenate(
        [
            trimesh.Trimesh(piece.vertex, piece.vertex_index, vertex_colors=piece.material.effect.diffuse)
            for geometry in geometries
            for piece in geometry.primitives()
            if isinstance(piece, BoundTriangleSet)  # the arm's files have lines too
        ]
    )


def tracks(gripper: bool, arm: Array, fingers: Array) -> dict[str, Array]:
    """The motion of each link in the world, at arm joints (T, 7) and fingers (T, 2): (T, 7), x, y, z in metres, then a
    quaternion (x, y, z, w), as Rerun has them.
    """
    return {
        name: np.hstack([positions, Rotation.from_matrix(rotations).as_quat()])
        for name, (rotations, positions) in link_frames(gripper, arm, fingers).items()
    }
