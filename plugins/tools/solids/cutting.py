"""Cut solids into convex parts: what a hull has too much is cut away along planes. Lengths are millimetres.

Every shape but a revolved ring is a convex solid less convex cutters. A part that a cutter enters falls into one piece
for each plane of the cutter. So the number of pieces is that of the cutter's planes; a round cutter is first replaced
by a polyhedron of few planes, within a tolerance.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from manifold3d import CrossSection, Manifold
from scipy.spatial import HalfspaceIntersection, QhullError, cKDTree

from core.geometry import Array

MAX_PIECES = 80
"""The most pieces while a solid is cut; slivers are left out at the end."""

SLIVER = 0.01
"""What has less volume is left out, mm^3."""

_AREA = 1e-3  # twice the least area of a triangle, and the least of an outline, mm^2
_MAX_NESTED = 6  # outlines within the pockets of each other
_CURVED = 0.35  # radians between facets of a curved surface, at most
_ROUNDS = 10  # in which planes are spread over a curved surface
_ON = 0.01  # a corner this near a plane lies on it, mm
_FACETS = 2500  # of curved surfaces, that are looked at

Planes = tuple[Array, Array]
"""Planes of a solid: their normals (N, 3), which point outward, and the offsets (N,) along these, mm."""


class Tolerance(NamedTuple):
    """Limits in mm where a cutter's curved face becomes a few planes: ``short`` of the face, and ``beyond`` it."""

    short: float
    beyond: float


class TooManyPieces(Exception):
    """A solid falls into more pieces than `MAX_PIECES`."""


def vertices_of(solid: Manifold) -> Array:
    """Return the corners (V, 3) of a solid, mm."""
    return np.asarray(solid.to_mesh64().vert_properties, dtype=np.float64)[:, :3]


def is_convex(solid: Manifold) -> bool:
    """Report whether a solid fills its convex hull."""
    return float(solid.volume()) >= (1 - 1e-6) * float(solid.hull().volume())


@dataclass(frozen=True)
class Faces:
    """The faces of a convex solid with the origin inside.

    Triangles in one plane are one face.

    Attributes:
        normals: (F, 3) unit vectors that point outward.
        offsets: (F,) of the faces' planes along the normals, mm.
        centers: (F, 3) mm.
        areas: (F,) twice the area of each, mm^2.
        curved: (F,) whether it is a facet of a curved surface.
        corners: (V, 3) those of the solid, mm.
    """

    normals: Array
    offsets: Array
    centers: Array
    areas: Array
    curved: npt.NDArray[np.bool_]
    corners: Array

    @classmethod
    def of(cls, solid: Manifold) -> Faces:
        """Find the faces of a convex solid."""
        corners = vertices_of(solid)
        triangles = corners[np.asarray(solid.to_mesh64().tri_verts)]
        first, second, third = triangles.swapaxes(0, 1)
        normals = np.cross(second - first, third - first)
        twice = np.linalg.norm(normals, axis=1)
        large = twice > _AREA
        triangles = triangles[large]
        normals = normals[large] / twice[large, None]
        twice = twice[large]

        # Join the triangles of each plane.
        _, chosen, group = np.unique(
            np.round(normals, 4), axis=0, return_index=True, return_inverse=True
        )
        sums = np.zeros((len(chosen), 3))
        np.add.at(sums, group.ravel(), triangles.mean(axis=1) * twice[:, None])
        areas = np.bincount(group.ravel(), twice).astype(np.float64)
        normals = normals[chosen]

        # The distances of each normal to itself and to the nearest other one.
        chords, _ = cKDTree(normals).query(normals, k=2)
        curved = np.asarray(chords)[:, 1] < _CURVED
        # Of very many facets of a curved surface, some stand for the others.
        kept = ~curved | (np.cumsum(curved) % (1 + curved.sum() // _FACETS) == 0)
        normals = normals[kept]
        areas = areas[kept]

        return cls(
            normals=normals,
            offsets=np.max(normals @ corners.T, axis=1),
            centers=sums[kept] / areas[:, None],
            areas=areas,
            curved=curved[kept],
            corners=corners,
        )

    def excess(self, planes: Planes) -> tuple[Array, Array]:
        """Return the corners (C, 3) of the polyhedron of planes, and how far each exceeds each face (C, F).

        The polyhedron is in a box that is far larger than the solid; both have the origin inside.

        Raises:
            TooManyPieces: the polyhedron is thinner than numbers are exact.
        """
        size = 4 * np.abs(self.corners).max()
        walls = np.column_stack([np.vstack([np.eye(3), -np.eye(3)]), np.full(6, -size)])
        halves = np.column_stack([planes[0], -planes[1]])

        try:
            found = HalfspaceIntersection(np.vstack([walls, halves]), np.zeros(3))
        except QhullError as error:
            raise TooManyPieces from error

        corners = found.intersections

        return corners, corners @ self.normals.T - self.offsets


def few_planes(solid: Manifold, tolerance: Tolerance) -> Planes:
    """Choose few planes of a convex solid, so that the polyhedron of these differs by ``tolerance`` at most.

    They are added where the polyhedron exceeds the solid most. Those of curved faces are then spread evenly, so that
    fewer will do, and move inward by a share of what their corners exceed the solid.

    Args:
        solid: a convex solid, anywhere.
        tolerance: how far the polyhedron may come out of the solid, and fall short of it.

    Raises:
        TooManyPieces: more than `MAX_PIECES` planes are needed.
    """
    middle = vertices_of(solid).mean(axis=0)
    faces = Faces.of(solid.translate(-middle))

    chosen: list[int] = []
    while True:
        _, excess = faces.excess((faces.normals[chosen], faces.offsets[chosen]))
        excess[:, chosen] = 0.0

        if excess.max() <= sum(tolerance):
            break

        if len(chosen) == MAX_PIECES:
            raise TooManyPieces

        chosen.append(int(excess.max(axis=0).argmax()))

    flat = [k for k in chosen if not faces.curved[k]]
    bent = [k for k in chosen if faces.curved[k]]
    normals, offsets = _spread_fewest(faces, flat, bent, tolerance)

    corners, excess = faces.excess((normals, offsets))
    moved = offsets.copy()

    for k in range(len(flat), len(offsets)):
        on = np.abs(corners @ normals[k] - offsets[k]) < _ON
        moved[k] -= excess[on].max(initial=0.0) * tolerance.short / sum(tolerance)

    return normals, moved + normals @ middle


def _spread_fewest(
    faces: Faces,
    flat: list[int],
    bent: list[int],
    tolerance: Tolerance,
) -> Planes:
    """Spread as few planes over the curved surface as the tolerance allows: see `_spread`.

    The number is found by bisection: with more planes the polyhedron is nearer to the solid.

    Args:
        faces: those of the solid.
        flat: the numbers of flat faces, whose planes stay.
        bent: the numbers of curved faces, of which the first ones are enough.
        tolerance: see `few_planes`.
    """
    best = _spread(faces, flat, bent)
    too_few = 0
    enough = len(bent)

    while enough - too_few > 1:
        count = (too_few + enough) // 2
        planes = _spread(faces, flat, bent[:count])
        _, excess = faces.excess(planes)

        if excess.max() <= sum(tolerance):
            best = planes
            enough = count
        else:
            too_few = count

    return best


def _spread(
    faces: Faces,
    flat: list[int],
    bent: list[int],
) -> Planes:
    """Return the flat faces' planes, and as many as ``bent`` that share the curved surface evenly.

    In each round a facet goes to the plane whose edge with it would stand out least, and a plane becomes the mean of
    its facets, by their areas.
    """
    normals = faces.normals[bent]
    centers = faces.centers[bent]
    facet_normals = faces.normals[faces.curved]
    facet_centers = faces.centers[faces.curved]
    areas = faces.areas[faces.curved]

    rounds = _ROUNDS if bent else 0

    for _ in range(rounds):
        # How far the edge between two tangent planes exceeds the surface grows with (c - c') (n - n').
        across = facet_centers @ normals.T + facet_normals @ centers.T
        facet_offsets = (facet_centers * facet_normals).sum(axis=1)
        offsets = (centers * normals).sum(axis=1)
        far = facet_offsets[:, None] + offsets - across
        nearest = np.abs(far).argmin(axis=1)[:, None]
        is_nearest = np.arange(len(bent)) == nearest
        shares = np.where(is_nearest, areas[:, None], 0.0)

        served = shares.sum(axis=0) > 0
        shares = shares[:, served] / shares[:, served].sum(axis=0)
        normals[served] = shares.T @ facet_normals
        centers[served] = shares.T @ facet_centers
        normals /= np.linalg.norm(normals, axis=1)[:, None]

    normals = np.vstack([faces.normals[flat], normals])

    return normals, np.max(normals @ faces.corners.T, axis=1)


def cut(parts: Iterable[Manifold], planes: Planes) -> list[Manifold]:
    """Cut a convex cutter, given by its planes, away from convex parts.

    Args:
        parts: convex solids.
        planes: the cutter's.

    Returns:
        Convex pieces: what the cutter leaves of the parts.

    Raises:
        TooManyPieces: there are more pieces than `MAX_PIECES`.
    """
    pieces: list[Manifold] = []
    for part in parts:
        pieces += _cut_part(part, planes)
        if len(pieces) > MAX_PIECES:
            raise TooManyPieces

    return pieces


def _cut_part(part: Manifold, planes: Planes) -> list[Manifold]:
    """Return the pieces of a convex part outside the planes; the part itself, if the cutter doesn't enter it."""
    normals, offsets = planes
    beyond = vertices_of(part) @ normals.T > offsets + 1e-6
    if beyond.all(axis=0).any():
        return [part]

    left = part

    pieces = []
    for plane in np.flatnonzero(beyond.any(axis=0)):
        piece, left = left.split_by_plane(normals[plane], offsets[plane])
        if piece.volume() >= SLIVER:
            pieces.append(piece)

        if left.volume() < SLIVER:
            return [part]

    return pieces if left.volume() >= SLIVER else [part]


def outline_pieces(
    outline: CrossSection,
    tolerance: Tolerance,
    nested: int = 0,
) -> list[CrossSection]:
    """Cut an outline into convex outlines: its hull, less the hulls of its pockets, and what lies within these.

    Args:
        outline: what is cut, mm.
        tolerance: of the pockets' round sides.
        nested: in how many pockets of pockets the outline lies.

    Raises:
        TooManyPieces: there are more than `MAX_PIECES`, or pockets lie within more than `_MAX_NESTED` others.
    """
    hull = outline.hull()
    solids = [hull.extrude(100.0)]

    within = []
    for pocket in (hull - outline).decompose():
        if pocket.area() < _AREA:
            continue

        around = pocket.hull()
        solids = cut(solids, few_planes(around.extrude(100.0), tolerance))
        if around.area() - pocket.area() < _AREA:
            continue
        if nested == _MAX_NESTED:
            raise TooManyPieces

        for inner in (outline ^ around).decompose():
            if inner.area() >= _AREA:
                within += outline_pieces(inner, tolerance, nested + 1)

    return [solid.slice(50.0) for solid in solids] + within
