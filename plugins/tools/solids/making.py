"""Make shapes of solids: primitives, convex meshes, and compounds whose convex parts keep near the solid."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache

import coal
import numpy as np
from manifold3d import Manifold, OpType

from core.design import DesignError
from core.geometry import (
    PRIMITIVES,
    Array,
    Compound,
    Mesh,
    Pose,
    Primitive,
    Shape,
)
from plugins.tools.refusals import ToolReason
from plugins.tools.solids.building import (
    MAX_TRIANGLES,
    TooFine,
    convex_parts,
    primitive,
    surface,
)
from plugins.tools.solids.cutting import (
    SLIVER,
    Tolerance,
    TooManyPieces,
    is_convex,
    vertices_of,
)
from plugins.tools.solids.tree_reading import Node

WITHIN_M = 0.001
"""The most between a solid and its convex parts, both ways."""

MAX_PARTS = 64
"""The most convex parts of a tool's solids that are not convex."""

MANY_VERTICES = 64
"""The corners of a convex part, from which on some are left out."""

_MIN_VOLUME = 0.1  # of a solid, mm^3
_MAX_PIECES = 16  # that are looked at, of a solid that falls apart
_TOUCH = 0.01  # pieces nearer than this touch, mm

# How far, in mm, a part may come out of the solid where this is hollow, and a hollow's corners may go into it. With the
# first the parts are fewest; at thin rims the others keep closer.
_TOLERANCES = (Tolerance(0.95, 0.95), Tolerance(0.85, 0.4), Tolerance(0.45, 0.2))
_SLIM = (0.02, 0.05, 0.1, 0.2, 0.4)  # within which corners are left out, mm
_SAMPLES = 400  # points of a surface


@dataclass(frozen=True, eq=False)
class WrittenMesh(Mesh):
    """A convex mesh that remembers the tree that it was made from."""

    tree: Node | None = None


@dataclass(frozen=True)
class WrittenCompound(Compound):
    """A compound that remembers the tree that it was made from."""

    tree: Node


@lru_cache(maxsize=512)
def make_shape(tree: Node, most: int = MAX_PARTS) -> tuple[Shape, Pose]:
    """Make the shape of a solid, and its pose in the component's frame.

    Args:
        tree: of the solid.
        most: convex parts that it may have, if it is not convex itself.

    Returns:
        A primitive at its pose, or a convex mesh or compound in the component's frame.

    Raises:
        DesignError: nothing is left of it, it falls apart, or it needs too many triangles or parts; a message to follow
            the words "its solid".
    """
    pose = Pose.xyz_rpy(tree.at[:3], tree.at[3:])
    if tree.kind in PRIMITIVES:
        shape = primitive(tree)
        if not shape.is_convex:
            _check_count(len(shape.convex_parts()), most)

        return shape, pose

    try:
        solid = surface(tree)
        if solid.volume() < _MIN_VOLUME:
            raise DesignError.because(
                ToolReason.SOLID_VOLUME, volume_mm3=solid.volume()
            )

        _check_whole(solid)

        if is_convex(solid):
            return WrittenMesh(*_triangles(_slim(solid.hull())), tree), Pose()

        parts = _parts(tree, solid, most)
        return WrittenCompound(Mesh(*_triangles(solid)), parts, tree), Pose()
    except TooFine as error:
        raise DesignError.because(
            ToolReason.SOLID_TRIANGLES, most=MAX_TRIANGLES
        ) from error


def node_of(shape: Shape) -> Node:
    """Return the tree that a shape was made from, or one that makes an equal shape; of a compound, of its parts."""
    if isinstance(shape, WrittenMesh | WrittenCompound) and shape.tree is not None:
        return shape.tree
    if isinstance(shape, Primitive):
        return Node(shape.kind, shape.numbers)
    if shape.is_convex:
        corners = shape.triangles.vertices.tolist()
        return Node("hull", points=tuple(map(tuple, corners)))

    return Node("union", children=tuple(map(node_of, shape.convex_parts())))


def _parts(tree: Node, solid: Manifold, most: int) -> tuple[Mesh, ...]:
    """Make the convex parts, with the first tolerance that keeps them near the solid."""
    problem = ""
    for tolerance in _TOLERANCES:
        parts = []
        with suppress(TooManyPieces):
            parts = convex_parts(tree, tolerance)
            parts = [part for part in parts if part.volume() >= SLIVER]

        _check_count(len(parts), most, problem)
        parts = [_slim(part) for part in parts]
        off = deviation(parts, solid)
        if off <= 1000 * WITHIN_M:
            return tuple(Mesh(*_triangles(part)) for part in parts)

        problem = f" (with fewer, {off:.2f} mm)"

    raise DesignError.because(
        ToolReason.SOLID_CONVEX, within_mm=1000 * WITHIN_M, off_mm=off
    )


def _check_count(count: int, most: int, problem: str = "") -> None:
    """Refuse more convex parts than there may be.

    Args:
        count: of them; 0: too many to count.
        most: how many there may be.
        problem: words for what is wrong with fewer.
    """
    if 0 < count <= most:
        return

    needed = count or f"more than {MAX_PARTS}"
    left = ""
    if most < MAX_PARTS:
        left = f", of which {most} are left"

    raise DesignError.because(
        ToolReason.SOLID_PARTS,
        needed=needed,
        within_mm=1000 * WITHIN_M,
        problem=problem,
        most=MAX_PARTS,
        left=left,
    )


def deviation(parts: list[Manifold], solid: Manifold) -> float:
    """Measure how far parts come out of a solid; if that is allowed, also how far points of it are from the parts.

    Distances, in millimetres, are exact, at corners and at many points between these.

    Args:
        parts: convex solids.
        solid: what they stand for.
    """
    whole = Manifold.batch_boolean(parts, OpType.Add)
    out = _farthest(whole - solid, solid)
    if out > 1000 * WITHIN_M:
        return out

    return max(out, _farthest(solid - whole, whole))


def _farthest(pieces: Manifold, solid: Manifold) -> float:
    """Measure how far corners and random points of pieces are from a solid's surface, mm."""
    if pieces.volume() < SLIVER:
        return 0.0

    mesh = pieces.to_mesh64()
    corners = vertices_of(pieces)
    rng = np.random.default_rng(0)

    triangles = corners[np.asarray(mesh.tri_verts)]
    first, second, third = triangles.swapaxes(0, 1)
    areas = np.linalg.norm(np.cross(second - first, third - first), axis=1)
    chosen = triangles[rng.choice(len(triangles), _SAMPLES, p=areas / areas.sum())]
    points = np.einsum("pkx,pk->px", chosen, rng.dirichlet((1, 1, 1), _SAMPLES))
    points = np.vstack([points, corners[rng.permutation(len(corners))[:_SAMPLES]]])
    return farthest_from_surface(
        points, vertices_of(solid), solid.to_mesh64().tri_verts
    )


def _check_whole(solid: Manifold) -> None:
    """Refuse what falls apart; pieces that touch hang together."""
    pieces = solid.decompose()
    if len(pieces) > _MAX_PIECES:
        wanted = "a component is of one piece"
        raise DesignError.because(
            ToolReason.SOLID_PIECES, count=len(pieces), wanted=wanted
        )

    joined = pieces[:1]
    apart = pieces[1:]
    while joined and apart:
        piece = joined.pop()
        near = [other for other in apart if piece.min_gap(other, 1.0) < _TOUCH]
        joined = joined + near
        apart = [other for other in apart if other not in near]

    if apart:
        wanted = "join them, or write them as components that touch"
        raise DesignError.because(
            ToolReason.SOLID_PIECES, count=len(pieces), wanted=wanted
        )


def _slim(part: Manifold) -> Manifold:
    """Leave out corners of a convex part until it has few enough."""
    slim = part
    for tolerance in _SLIM:
        if slim.num_vert() <= MANY_VERTICES:
            break

        slim = part.simplify(tolerance).hull()

    return slim


def _triangles(
    solid: Manifold,
) -> tuple[Array, np.ndarray[tuple[int, int], np.dtype[np.int64]]]:
    """Return the corners (V, 3) of a solid, metres, and its triangles (F, 3) as numbers of corners."""
    faces = np.asarray(solid.to_mesh64().tri_verts, dtype=np.int64)
    return vertices_of(solid) / 1000, faces


def farthest_from_surface(points: Array, vertices: Array, faces: Array) -> float:
    """Measure the largest distance of points from a surface of triangles, in the unit of both.

    Args:
        points: (P, 3).
        vertices: (V, 3) the corners of the triangles.
        faces: (F, 3) the triangles, as numbers of their corners.
    """
    corners = coal.StdVec_Vec3s()
    triangles = coal.StdVec_Triangle()
    corners.extend(np.asarray(vertices))
    triangles.extend(coal.Triangle(*face) for face in np.asarray(faces).tolist())
    surface = coal.BVHModelOBBRSS()
    point = coal.Sphere(1e-9)
    surface.beginModel(len(triangles), len(corners))
    surface.addSubModel(corners, triangles)
    surface.endModel()

    measure = coal.ComputeDistance(surface, point)
    here = coal.Transform3s()
    request = coal.DistanceRequest()
    farthest = -math.inf

    for place in points:
        there = coal.Transform3s(np.eye(3), place)
        distance = measure(here, there, request, coal.DistanceResult())
        farthest = max(farthest, float(distance))

    return farthest
