"""Describe a solid as shapes that are added, cut away or kept, so that a mesh and an exact model can be made of it.

Shapes are in metres, in the frame of what bears the solid; meshes are in millimetres.
Covered by `tests/plugins/results/workshop/test_tool.py`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from core.geometry import Array, Box, Compound, Cylinder, Mesh, Pose, Shape
from plugins.results.workshop.printing import manifold

if TYPE_CHECKING:
    import trimesh

Placed = tuple[Shape | Compound, Pose]


@dataclass(frozen=True)
class Step:
    """What is done to a solid with the union of shapes: it is added, cut away, or what it shares with it is kept.

    With ``one`` the body whose middle is next to the origin of the only shape is kept.
    """

    kind: Literal["add", "cut", "keep", "one"]
    shapes: tuple[Placed, ...]


Solid = tuple[Step, ...]


def union(shapes: Iterable[Placed]) -> Any:
    """Return the union of shapes as a Manifold, in millimetres."""
    import manifold3d

    return manifold3d.Manifold.batch_boolean([_manifold(*placed) for placed in shapes], manifold3d.OpType.Add)


def body(solid: Solid) -> Any:
    """Return a solid as a Manifold, in millimetres."""
    import manifold3d

    whole = manifold3d.Manifold()
    for step in solid:
        if step.kind == "one":
            middle = 1000 * step.shapes[0][1].position
            whole = min(whole.decompose(), key=lambda each: float(np.linalg.norm(to_mesh(each).center_mass - middle)))
            continue
        other = union(step.shapes)
        whole = whole + other if step.kind == "add" else whole - other if step.kind == "cut" else whole ^ other
    return whole


def _manifold(shape: Shape | Compound, pose: Pose) -> Any:
    return manifold(shape.to_trimesh().apply_transform(pose.matrix).apply_scale(1000.0))


def to_mesh(whole: Any) -> trimesh.Trimesh:
    """Return a Manifold as a mesh."""
    import trimesh

    found = whole.to_mesh64()
    return trimesh.Trimesh(found.vert_properties[:, :3], found.tri_verts, process=True)


def hull(points: Array) -> Mesh:
    """Return the convex hull of points (N, 3)."""
    import trimesh

    return Mesh.from_trimesh(trimesh.convex.convex_hull(points))


def box(low: Sequence[float] | Array, high: Sequence[float] | Array) -> Placed:
    """Return a box between two corners, in metres."""
    low, high = np.asarray(low), np.asarray(high)
    x, y, z = (high - low).tolist()
    return Box((x, y, z)), Pose((low + high) / 2)


def rod(start: Array, end: Array, radius: float) -> Placed:
    """Return a cylinder from one point to another, in metres."""
    from scipy.spatial.transform import Rotation

    way = end - start
    turn, _ = Rotation.align_vectors(way[None], np.array([[0.0, 0.0, 1.0]]))
    return Cylinder(radius, float(np.linalg.norm(way))), Pose.from_rotation((start + end) / 2, turn)
