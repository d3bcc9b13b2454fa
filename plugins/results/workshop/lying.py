"""Lay solids on a printer's plate as one would print them. Lengths are millimetres, as for slicers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from core.geometry import Array

OVERHANG_DEG = 45.0
"""From the vertical: what leans out by more needs a support."""

SLENDER = 50.0
"""A pose stands firmly where its height squared is at most so many times the area that touches the plate."""

SIDES = 30  # of a hull, on which it may lie; the largest are tried
SUPPORT = 0.2  # of the space below an overhang is filled by its support
LAYER_MM3 = 100.0  # what could be printed in the time that a millimetre of height takes to change layers

_FLAT = 0.999  # cosine up to which two faces lie in one plane
_TOUCH_MM = 0.1  # what is lower touches the plate: half of a first layer

_ANGLES = np.deg2rad(np.arange(180))
_TURNS = (
    Rotation.from_euler("z", _ANGLES[:, None]).as_matrix()[:, :2, :2].transpose(0, 2, 1)
)


@dataclass(frozen=True, eq=False)
class Lying:
    """A mesh as it lies on the plate.

    Attributes:
        whole: the mesh as it was.
        placed: (4, 4), lays it on the plate: its middle above the plate's, its lowest point at 0.
        size: of the plate that it takes, and its height, millimetres.
        contact_mm2: the area that touches the plate.
        overhang_mm2: the area beyond `OVERHANG_DEG`, without what touches the plate.
        support_mm3: the space between that and the plate.
        excess_mm: by how much it exceeds the plate; 0: it fits.
    """

    whole: trimesh.Trimesh
    placed: Array
    size: tuple[float, ...]
    contact_mm2: float
    overhang_mm2: float
    support_mm3: float
    excess_mm: float

    @cached_property
    def mesh(self) -> trimesh.Trimesh:
        """It as it lies."""
        return self.whole.copy().apply_transform(self.placed)

    @property
    def back(self) -> Array:
        """Lead (4, 4) from where it lies to where it came from."""
        return np.asarray(np.linalg.inv(self.placed), np.float64)

    @property
    def fits(self) -> bool:
        return self.excess_mm <= 0

    @property
    def cost(self) -> float:
        """How much more it takes to print, in mm³: supports, and layers."""
        return SUPPORT * self.support_mm3 + LAYER_MM3 * self.size[2]

    @property
    def slenderness(self) -> float:
        """Its height squared over the area that touches the plate."""
        return self.size[2] ** 2 / max(self.contact_mm2, 1e-6)

    @property
    def firm(self) -> bool:
        """Whether it stands firmly while it is printed."""
        return self.slenderness <= SLENDER


def lay(mesh: trimesh.Trimesh, plate: Sequence[float]) -> Lying:
    """Lay a mesh on the side on which it is printed best, and turn it so that it fits the plate.

    Where a pose stands firmly, others are left out, even where no firm one fits. Of those that fit it is the one that
    takes least support and height, else the one that exceeds the plate least.

    Args:
        mesh: closed, millimetres.
        plate: the printer's build volume (x, y, z), millimetres.
    """
    ways = [_rest(mesh, turned, plate) for turned in _find_poses(mesh)]
    firm = [way for way in ways if way.firm]
    if not firm:
        return min(ways, key=lambda way: way.slenderness)

    return min(firm, key=lambda way: (round(way.excess_mm, 3), way.cost))


def _find_poses(mesh: trimesh.Trimesh) -> list[Array]:
    """Return rotations (3, 3) that lay flat sides of a mesh's hull on the plate.

    Where its mass lies beyond that side it does not rest by itself: its supports hold it.
    """
    hull = mesh.convex_hull
    by_area = np.argsort(-hull.facets_area, kind="stable")[:SIDES]
    sides = [hull.facets_normal[i] for i in by_area]
    if not sides:
        sides = [hull.face_normals[np.argmax(hull.area_faces)]]

    return [stand_on(side) for side in sides]


def stand_on(side: Array) -> Array:
    """Return a rotation (3, 3) that turns a direction down."""
    turned = trimesh.geometry.align_vectors(side, [0.0, 0.0, -1.0])
    return np.asarray(turned, np.float64)[:3, :3]


def _rest(mesh: trimesh.Trimesh, turned: Array, plate: Sequence[float]) -> Lying:
    """Lay a mesh in a resting pose, turned about z as it fits best.

    Args:
        mesh: closed, millimetres.
        turned: a rotation (3, 3), after which it rests.
        plate: the printer's build volume (x, y, z), millimetres.
    """
    angle, excess = turn_to_fit(mesh.convex_hull.vertices @ turned.T, plate)
    placed = trimesh.transformations.rotation_matrix(angle, [0, 0, 1])
    placed[:3, :3] = placed[:3, :3] @ turned
    corners = mesh.convex_hull.vertices @ placed[:3, :3].T
    low, high = corners.min(axis=0), corners.max(axis=0)
    placed[:3, 3] = [*(-(low + high)[:2] / 2), -low[2]]

    down = -np.asarray(mesh.face_normals) @ placed[2, :3]
    heights = np.asarray(mesh.triangles_center) @ placed[2, :3] + placed[2, 3]
    areas = np.asarray(mesh.area_faces)
    touching = (down > _FLAT) & (heights < _TOUCH_MM)
    leaning = (down > math.cos(math.radians(OVERHANG_DEG)) + 1e-6) & ~touching

    return Lying(
        whole=mesh,
        placed=placed,
        size=tuple((high - low).tolist()),
        contact_mm2=float(areas[touching].sum()),
        overhang_mm2=float(areas[leaning].sum()),
        support_mm3=float((areas * down * heights)[leaning].sum()),
        excess_mm=max(excess, 0.0),
    )


def turn_to_fit(corners: Array, plate: Sequence[float]) -> tuple[float, float]:
    """Find the angle about z at which points exceed the plate least, in whole degrees; the first that fits, if any.

    Args:
        corners: points (N, 3), millimetres.
        plate: the build volume (x, y, z), millimetres.

    Returns:
        The angle, radians, and by how much they exceed the plate, millimetres.
    """
    sides = np.ptp(corners[:, :2] @ _TURNS, axis=1)
    height = float(np.ptp(corners[:, 2]))
    excess = np.maximum((sides - plate[:2]).max(axis=1), height - plate[2])
    chosen = int(np.argmin(np.maximum(excess, 0.0)))  # the first that fits, if any

    return float(_ANGLES[chosen]), float(excess[chosen])
