"""Read the shapes of a model that MuJoCo compiled of an MJCF file; callers bring the model, so core needs no engine."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from core.geometry import Array, Box, Capsule, Color, Cylinder, Mesh, Shape, Sphere

JOINT_KINDS = ("free", "ball", "slider", "hinge")  # by MuJoCo's numbers
_GEOM_KINDS = (
    *("plane", "hfield", "sphere", "capsule", "ellipsoid", "cylinder", "box"),
    *("mesh", "sdf"),
)
_DRAWN_GROUPS = 3  # MuJoCo's viewer shows the groups before
_GREY = (
    0.5,
    0.5,
    0.5,
    1.0,
)  # of a geom without a colour, so that its material's counts
_SHAPES: dict[str, Callable[[float, float, float], Shape]] = {
    "sphere": lambda x, y, z: Sphere(x),
    "capsule": lambda x, y, z: Capsule(x, 2 * y),
    "cylinder": lambda x, y, z: Cylinder(x, 2 * y),
    "box": lambda x, y, z: Box((2 * x, 2 * y, 2 * z)),
    "ellipsoid": lambda *radii: Mesh.from_trimesh(
        Sphere(1.0).to_trimesh().apply_scale(radii)
    ),
}


@dataclass(frozen=True)
class MjcfGeom:
    """A shape of a compiled body.

    Attributes:
        number: of the geom in the model.
        kind: such as ``mesh``.
        shape: as it is drawn; None: it is of a kind that is not read.
        color: its own, or its material's; the opacity may be 0.
        collides: whether it does with anything.
        drawn: whether MuJoCo's viewer shows its group.
        friction: the coefficient.
        solid: as it collides: a mesh as its hull.
    """

    number: int
    kind: str
    shape: Shape | None
    color: Color
    collides: bool
    drawn: bool
    friction: float
    solid: Shape | None


@dataclass(frozen=True, eq=False)
class MjcfShapes:
    """The geoms of a compiled ``model``, a ``mujoco.MjModel``."""

    model: Any
    _meshes: dict[int, tuple[Mesh, Mesh]] = field(default_factory=dict)

    def of_bodies(self, chosen: Any) -> list[MjcfGeom]:
        """Return the geoms of bodies: ``chosen`` (B,) says of each body whether its count."""
        numbers = np.flatnonzero(chosen[self.model.geom_bodyid])
        return [self._geom(int(number)) for number in numbers]

    def _geom(self, number: int) -> MjcfGeom:
        geom = self.model.geom(number)
        kind = _GEOM_KINDS[geom.type[0]]
        shape: Shape | None = None
        solid: Shape | None = None
        if kind == "mesh":
            shape, solid = self._mesh(int(geom.dataid[0]))
        elif kind in _SHAPES:
            shape = _SHAPES[kind](*geom.size.tolist())
            solid = shape

        shown = geom.rgba
        if geom.matid[0] >= 0 and np.allclose(shown, _GREY):
            shown = self.model.mat_rgba[geom.matid[0]]

        red, green, blue, opacity = np.clip(shown, 0, 1).tolist()
        return MjcfGeom(
            number,
            kind,
            shape,
            color=(red, green, blue, opacity),
            collides=bool(geom.contype[0] or geom.conaffinity[0]),
            drawn=bool(geom.group[0] < _DRAWN_GROUPS),
            friction=float(geom.friction[0]),
            solid=solid,
        )

    def _mesh(self, number: int) -> tuple[Mesh, Mesh]:
        """Return what is drawn of a mesh, and its hull, from the numbers that MuJoCo keeps of it."""
        if number not in self._meshes:
            mesh = self.model.mesh(number)
            corners = self.model.mesh_vert[mesh.vertadr[0] :][: mesh.vertnum[0]]
            triangles = self.model.mesh_face[mesh.faceadr[0] :][: mesh.facenum[0]]
            drawn = Mesh(corners, triangles)
            hull = drawn
            if mesh.graphadr[0] >= 0:  # it collides
                graph = self.model.mesh_graph[mesh.graphadr[0] :]
                hull = _read_hull(corners, graph)

            self._meshes[number] = (drawn, hull)

        return self._meshes[number]


def _read_hull(corners: Array, graph: Any) -> Mesh:
    """Read the convex hull of corners (V, 3) from MuJoCo's graph of it."""
    count, faces = graph[:2]
    hull = graph[2 + 3 * (count + faces) :][: 3 * faces]
    used, numbers = np.unique(hull, return_inverse=True)
    return Mesh(corners[used], numbers.reshape(-1, 3))
