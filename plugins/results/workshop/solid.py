"""Take a tool apart into its rigid links, and make solids of their shapes: Manifolds, and meshes of them.

Shapes are in metres, in the frame of the mount, with all joints at 0; solids and meshes are in millimetres.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import manifold3d
import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Tool, ToolJoint
from core.geometry import Array, Box, Cylinder, Pose, Shape

Placed = tuple[Shape, Pose]

NAMES = {
    RIGID_MOUNT: "tool",
    GRIPPER_MOUNTS[0]: "left",
    GRIPPER_MOUNTS[1]: "right",
}
"""Of links that mounts bear; others have their joints' names."""

WELDS_MM = (0.01, 0.05, 0.1, 0.25, 0.5)
"""By how much each side of a component is moved out, so that components that touch, or nearly do, become one body.

The least that does it is taken. A design may have gaps of up to 1 mm (`core.designs.rules`), so that 0.5 mm is enough.
"""

UNEVEN = 0.4
"""The share of the weld by which the last component is moved out less.

Where all sides moved out alike, an edge of one component may lie in a face of another, and their union touch itself
along it, which is no closed surface. So each component is moved out by a little less than the one before.
"""

SHORTEST_MM = (1e-3, 1e-2)
"""Lengths of a mesh's shortest edges: in an STL file's single precision, shorter ones vanish and may leave holes."""


@dataclass(frozen=True, eq=False)
class ToolLink:
    """A rigid body of a tool.

    Attributes:
        bearer: the mount that bears it, or the component with the joint that moves it.
        mount: the frame of its shapes.
        names: of its components.
        shapes: of its components, and their poses.
        parent: the bearer of the link that it moves on; with ``joint``.
        joint: what moves it.
    """

    bearer: str
    mount: str
    names: tuple[str, ...]
    shapes: tuple[Placed, ...]
    parent: str = ""
    joint: ToolJoint | None = None

    @property
    def name(self) -> str:
        return NAMES.get(self.bearer, self.bearer)

    def grown(self, weld_mm: float, uneven: float = 0.0) -> list[Placed]:
        """Return its shapes with each side moved out.

        Args:
            weld_mm: by how much.
            uneven: the share of that by which the last shape is moved out less.
        """
        step = uneven / max(1, len(self.shapes) - 1)
        grown = []
        for number, placed in enumerate(self.shapes):
            grown += widened([placed], weld_mm * (1 - number * step))

        return grown


def links_of(tool: Tool) -> list[ToolLink]:
    """Return the links of a tool, in the order of their first components."""
    placed = tool.placed()
    components = {component.name: component for component in tool.components}
    joints = {bearer.name: bearer for bearer in tool.bearers}
    names: dict[str, list[str]] = {}
    for name, (bearer, _) in tool.borne.items():
        names.setdefault(bearer, []).append(name)

    links = []
    for bearer, members in names.items():
        shapes = [(components[name].shape, placed[name][1]) for name in members]
        mount = placed[members[0]][0]
        link = ToolLink(bearer, mount, tuple(members), tuple(shapes))
        if bearer in joints:
            joint = joints[bearer]
            link = replace(link, parent=joint.parent, joint=joint.joint)

        links.append(link)

    return links


def widened(shapes: Sequence[Placed], weld_mm: float) -> list[Placed]:
    """Move each side of shapes out; by little, what is hollow stays: its inner walls would move, too.

    Args:
        shapes: with their poses, metres.
        weld_mm: by how much.
    """
    stays = weld_mm <= WELDS_MM[0]
    moved: list[Placed] = []
    for shape, pose in shapes:
        if stays and not shape.is_convex:
            moved.append((shape, pose))
        else:
            size = shape.bounds[1] + 0.002 * weld_mm
            moved.append((shape.resized(size), pose))

    return moved


def union(shapes: Sequence[Placed]) -> Any:
    """Return the union of shapes as a Manifold, in millimetres."""
    return _union(tuple(shapes))


@lru_cache(maxsize=256)
def _union(shapes: tuple[Placed, ...]) -> Any:
    if len(shapes) != 1:
        return joined_solids([_union((placed,)) for placed in shapes])

    ((shape, pose),) = shapes
    mesh = shape.to_trimesh().apply_transform(pose.matrix).apply_scale(1000.0)
    solid = manifold(mesh)
    if shape.is_convex and solid.status() != manifold3d.Error.NoError:
        # A hull of triangles that are thinner than numbers are exact.
        return manifold3d.Manifold.hull_points(mesh.vertices)

    return solid


def joined_solids(solids: Sequence[Any]) -> Any:
    """Return the union of Manifolds."""
    return manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Add)


def manifold(mesh: trimesh.Trimesh) -> Any:
    """Return a closed mesh as a Manifold."""
    corners = np.array(mesh.vertices, np.float64, order="C")
    faces = np.array(mesh.faces, np.uint64, order="C")
    return manifold3d.Manifold(manifold3d.Mesh64(corners, faces))


def to_mesh(solid: Any, shortest_mm: float = SHORTEST_MM[0]) -> trimesh.Trimesh:
    """Return a Manifold as a mesh, as closed as it is: where bodies touch along an edge they share no corner.

    Edges that STL files can't hold are merged.
    """
    data = solid.simplify(shortest_mm).to_mesh64()
    return trimesh.Trimesh(data.vert_properties[:, :3], data.tri_verts, process=False)


def closed(mesh: trimesh.Trimesh) -> bool:
    """Report whether a mesh is closed as STL files hold it: in single precision, corners at one place being one."""
    return bool(trimesh.Trimesh(mesh.vertices.astype(np.float32), mesh.faces).is_volume)


def box(low: Sequence[float] | Array, high: Sequence[float] | Array) -> Placed:
    """Return a box between two corners, in metres."""
    sides = np.subtract(high, low)
    return Box(tuple(sides)), Pose(np.add(low, high) / 2)


def rod(start: Array, end: Array, radius: float) -> Placed:
    """Return a cylinder from one point to another, in metres."""
    way = end - start
    turn, _ = Rotation.align_vectors(way[None], np.array([[0.0, 0.0, 1.0]]))
    length = float(np.linalg.norm(way))
    return Cylinder(radius, length), Pose.from_rotation((start + end) / 2, turn)
