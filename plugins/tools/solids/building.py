"""Build the surface and the convex parts of a solid from its tree. Lengths are millimetres."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Mapping

import numpy as np
from manifold3d import CrossSection, Manifold, Mesh64, OpType

from core.geometry import PRIMITIVES, Mesh, Pose, Primitive
from plugins.tools.solids.cutting import (
    MAX_PIECES,
    SLIVER,
    Tolerance,
    TooManyPieces,
    cut,
    few_planes,
    is_convex,
    outline_pieces,
)
from plugins.tools.solids.tree_reading import Node

CHORD = 0.1
"""The most from an arc to the chord that stands for it, mm."""

MAX_SEGMENTS = 48
"""The most chords that stand for a circle."""

MAX_TRIANGLES = 8_000
"""The most triangles of a solid."""

_MAX_PAIRS = 500  # of parts that are intersected
_FEW = 6  # cutters, of which each leaves out what the others have taken
_ALIKE = 1e-3  # outlines of areas that differ by less are alike, mm^2
_OPERATIONS = {
    "union": OpType.Add,
    "difference": OpType.Subtract,
    "intersection": OpType.Intersect,
}


class TooFine(Exception):
    """A solid has more triangles than `MAX_TRIANGLES`."""


def segments(radius: float) -> int:
    """Choose how many chords stand for a circle of a ``radius`` in mm: a multiple of 4, `MAX_SEGMENTS` at most."""
    half_angle = math.acos(max(0.0, 1 - CHORD / radius))
    return min(MAX_SEGMENTS, 4 * math.ceil(math.pi / half_angle / 4))


def count_triangles(node: Node) -> int:
    """Count the triangles of all shapes of a tree, before they are joined or cut."""
    if node.children:
        return sum(map(count_triangles, node.children))

    return int(_leaf(node).num_tri())


def _placed(node: Node, solid: Manifold) -> Manifold:
    """Place a node's solid as the node says."""
    if not any(node.at):
        return solid

    matrix = Pose.xyz_rpy(1000 * np.array(node.at[:3]), node.at[3:]).matrix

    return solid.transform(matrix[:3])


def primitive(node: Node) -> Primitive:
    """Make the shape of a node that is one of `core.geometry.KINDS`."""
    return PRIMITIVES[node.kind].of(*node.sizes)


def _sphere(radius: float) -> Manifold:
    return Manifold.sphere(radius, segments(radius))


def _cone(low: float, high: float, length: float) -> Manifold:
    return Manifold.cylinder(length, low, high, segments(max(low, high)), True)


def _capsule(radius: float, length: float) -> Manifold:
    ball = _sphere(radius)
    ends = [ball.translate([0, 0, way * length / 2]) for way in (-1, 1)]
    return Manifold.batch_hull(ends)


NATIVES: Mapping[str, Callable[..., Manifold]] = {
    "box": lambda *sides: Manifold.cube(sides, True),
    "sphere": _sphere,
    "cylinder": lambda radius, length: _cone(radius, radius, length),
    "capsule": _capsule,
    "cone": _cone,
}
"""What Manifold has itself, about the origin, of the sizes in mm; other shapes are built of their triangles."""


def _leaf(node: Node) -> Manifold:
    """Build a node without children about the origin."""
    match node.kind:
        case kind if kind in NATIVES:
            return NATIVES[kind](*(1000 * size for size in node.sizes))

        case "hull":
            return Manifold.hull_points(1000 * np.array(node.points))

        case "extrude":
            return _extrude(_outline(node), node)

        case "revolve":
            outline = _outline(node)
            around = segments(outline.bounds()[2])
            return outline.revolve(around, math.degrees(node.sizes[0]))

        case _:
            return _closed(primitive(node).triangles)


def _closed(mesh: Mesh) -> Manifold:
    """Build the solid of a closed mesh."""
    faces = mesh.faces.astype(np.uint64)
    return Manifold(Mesh64(1000 * mesh.vertices, faces))


def _leaf_parts(node: Node) -> list[Manifold]:
    """Build the convex parts of a primitive about the origin, or the hull of points."""
    if node.kind not in PRIMITIVES or primitive(node).is_convex:
        return [_leaf(node)]

    return [_closed(part.triangles) for part in primitive(node).convex_parts()]


def _outline(node: Node) -> CrossSection:
    """Build a node's outline, whose corners may be listed either way round."""
    points = 1000 * np.array(node.points)
    x, y = points.T
    clockwise = np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) < 0

    if clockwise:
        points = points[::-1]

    return CrossSection([points])


def _extrude(outline: CrossSection, node: Node) -> Manifold:
    """Extrude an outline to a node's height, about the origin."""
    height = 1000 * node.sizes[0]
    return outline.extrude(height).translate([0, 0, -height / 2])


def surface(node: Node) -> Manifold:
    """Build a solid, mm.

    Args:
        node: the tree of the solid.

    Raises:
        TooFine: there are too many triangles.
    """
    if node.children:
        operation = _OPERATIONS[node.kind]
        solid = surface(node.children[0])
        for child in node.children[1:]:
            solid = Manifold.batch_boolean([solid, surface(child)], operation)
            if solid.num_tri() > MAX_TRIANGLES:
                raise TooFine
    else:
        solid = _leaf(node)

    if solid.num_tri() > MAX_TRIANGLES:
        raise TooFine

    return _placed(node, solid)


def convex_parts(node: Node, tolerance: Tolerance) -> list[Manifold]:
    """Build convex solids that together are the solid, within about ``tolerance``.

    Args:
        node: the tree of the solid.
        tolerance: of round hollows, which become hollows of few planes.

    Raises:
        TooManyPieces: while it was cut.
    """
    match node.kind:
        case "union":
            parts = _all_parts(node.children, tolerance)

        case "intersection":
            parts = _intersect(node, tolerance)

        case "difference":
            parts = _subtract(node, tolerance)

        case "extrude":
            pieces = outline_pieces(_outline(node), tolerance)
            parts = [_extrude(piece, node) for piece in pieces]

        case "revolve":
            parts = _revolved(_outline(node), math.degrees(node.sizes[0]), tolerance)

        case _:
            parts = _leaf_parts(node)

    if len(parts) > MAX_PIECES:
        raise TooManyPieces

    # A flat hull has no volume.
    return [_placed(node, part) for part in parts if part.volume() >= SLIVER]


def _all_parts(nodes: Iterable[Node], tolerance: Tolerance) -> list[Manifold]:
    """Build the convex parts of several solids."""
    parts: list[Manifold] = []
    for node in nodes:
        parts += convex_parts(node, tolerance)

    return parts


def _intersect(node: Node, tolerance: Tolerance) -> list[Manifold]:
    """Intersect each part of the first child with each part of the others.

    Raises:
        TooManyPieces: there are more than `_MAX_PAIRS` of them.
    """
    parts = convex_parts(node.children[0], tolerance)
    for child in node.children[1:]:
        others = convex_parts(child, tolerance)
        if len(parts) * len(others) > _MAX_PAIRS:
            raise TooManyPieces

        overlaps = [a ^ b for a, b in itertools.product(parts, others)]
        parts = [overlap for overlap in overlaps if overlap.volume() >= SLIVER]

    return parts


def _subtract(node: Node, tolerance: Tolerance) -> list[Manifold]:
    """Cut the parts of all other children away from those of the first.

    Of few cutters each leaves out what the others have taken already, where that is convex.
    """
    first, *others = node.children
    parts = convex_parts(first, tolerance)

    cutters = _all_parts(others, tolerance)
    cutters.sort(key=lambda solid: solid.num_tri())  # fewer pieces than otherwise

    few = len(cutters) <= _FEW
    gone = Manifold()

    for cutter in cutters:
        rest = cutter - gone if few else cutter
        if rest.volume() < SLIVER:
            continue

        if not is_convex(rest):
            rest = cutter

        parts = cut(parts, few_planes(rest, tolerance))
        if few:
            gone += cutter

    return parts


def _round_hull(outline: CrossSection) -> CrossSection:
    """Return the outline whose full turn is the convex hull of the given outline's."""
    _, low, right, high = outline.bounds()
    half = CrossSection.square([right, high - low]).translate([0, low])

    return (outline + outline.mirror([1, 0])).hull() ^ half


def _convex_when_turned(outline: CrossSection) -> bool:
    """Report whether a full turn of an outline is a convex solid."""
    return bool(_round_hull(outline).area() - outline.area() < _ALIKE)


def _revolved(
    outline: CrossSection,
    degrees: float,
    tolerance: Tolerance,
) -> list[Manifold]:
    """Build the convex parts of a revolved outline.

    Where all of its pockets are convex when they are turned, they are cut away from the hull; else the outline itself
    is cut into convex outlines, and each of these is revolved.
    """
    hull = _round_hull(outline)
    around = segments(outline.bounds()[2])

    gaps = (hull - outline).decompose()
    pockets = [pocket for pocket in gaps if pocket.area() >= _ALIKE]

    if all(map(_convex_when_turned, pockets)):
        parts = _sectors(hull, degrees, tolerance)
        for pocket in pockets:
            parts = cut(parts, few_planes(pocket.revolve(around), tolerance))

        return parts

    sectors: list[Manifold] = []
    for piece in outline_pieces(outline, tolerance):
        sectors += _sectors(piece, degrees, tolerance)
        if len(sectors) > MAX_PIECES:
            raise TooManyPieces

    return sectors


def _sectors(
    outline: CrossSection,
    degrees: float,
    tolerance: Tolerance,
) -> list[Manifold]:
    """Revolve a convex outline in as few convex sectors as the tolerance allows: one, where the whole is convex.

    Args:
        outline: a convex outline, mm; x is the distance from the axis.
        degrees: the angle of the revolution.
        tolerance: how far the hull of a sector may come out of it, towards the axis.
    """
    radius = outline.bounds()[2]

    if not _convex_when_turned(outline):
        widest = 2 * math.acos(max(0.5, 1 - tolerance.short / radius))
        count = math.ceil(degrees / math.degrees(widest))
    elif degrees >= 360:
        count = 1
    else:
        count = math.ceil(degrees / 180 - 1e-6)

    sector = outline.revolve(segments(radius), degrees / count).hull()

    return [sector.rotate([0, 0, k * degrees / count]) for k in range(count)]
