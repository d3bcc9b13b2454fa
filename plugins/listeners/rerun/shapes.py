"""Shapes as triangles for shading: sharp edges stay sharp, round faces round."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
import trimesh

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Tool
from core.geometry import Array, Pose, Shape
from core.robot.description import FINGER_OPEN
from core.scene import Color

_SHARP_RAD = np.radians(30.0)  # faces that meet at a wider angle are shaded apart

Bytes = npt.NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Triangles:
    """Vertices (V, 3) in metres, faces (F, 3), normals (V, 3), and colours (V, 4), 0..255."""

    vertices: Array
    faces: npt.NDArray[np.int64]
    normals: Array
    colors: Bytes

    @classmethod
    def of(cls, vertices: Array, faces: npt.NDArray[np.int64], normals: Array, color: Bytes) -> Triangles:
        """Triangles in one colour (4,)."""
        return cls(vertices, faces, normals, np.tile(color, (len(vertices), 1)))

    @classmethod
    def joined(cls, pieces: Sequence[Triangles]) -> Triangles:
        starts = np.cumsum([0, *(len(piece.vertices) for piece in pieces)])[:-1]
        return cls(
            np.concatenate([piece.vertices for piece in pieces]),
            np.concatenate([piece.faces + start for piece, start in zip(pieces, starts, strict=True)]),
            np.concatenate([piece.normals for piece in pieces]),
            np.concatenate([piece.colors for piece in pieces]),
        )

    def moved(self, pose: Pose) -> Triangles:
        """The triangles, moved by ``pose``."""
        axes = pose.rotation.as_matrix()
        return Triangles(pose.apply(self.vertices), self.faces, self.normals @ axes.T, self.colors)


def rgba(color: Color) -> Bytes:
    return np.round(np.clip(color, 0.0, 1.0) * 255.0).astype(np.uint8)


def triangles(shape: Shape, color: Color) -> Triangles:
    mesh = _shaded(shape)
    return Triangles.of(mesh.vertices, mesh.faces, mesh.vertex_normals, rgba(color))


@lru_cache(maxsize=256)
def _shaded(shape: Shape) -> trimesh.Trimesh:
    return trimesh.graph.smooth_shade(shape.to_trimesh(), angle=_SHARP_RAD)


def tool_by_mount(tool: Tool) -> dict[str, Triangles]:
    """The tool's components, joined by mount, in that mount's frame."""
    placed = tool.placed()
    found: dict[str, list[Triangles]] = {}
    for component in tool.components:
        mount, pose = placed[component.name]
        found.setdefault(mount, []).append(triangles(component.shape, component.color).moved(pose))
    return {mount: Triangles.joined(pieces) for mount, pieces in found.items()}


def tool_alone(tool: Tool) -> Triangles:
    """The whole tool as it hangs from the arm at home, in axes parallel to the world's. It has components."""
    meshes = tool_by_mount(tool)
    down = Pose.xyz_rpy((0.0, 0.0, 0.0), (np.pi, 0.0, 0.0))  # the axes of the hand and the fingers are upside down
    stands = {
        RIGID_MOUNT: Pose(),
        GRIPPER_MOUNTS[0]: down @ Pose(np.array([0.0, FINGER_OPEN, 0.0])),
        GRIPPER_MOUNTS[1]: down @ Pose(np.array([0.0, -FINGER_OPEN, 0.0])),
    }
    return Triangles.joined([mesh.moved(stands[mount]) for mount, mesh in meshes.items()])
