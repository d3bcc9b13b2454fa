"""Press a number into a piece, where it has a flat side that is large enough. Lengths are millimetres."""

from __future__ import annotations

from typing import Any

import manifold3d
import numpy as np
import trimesh

from core.geometry import Array
from plugins.results.workshop.solid import to_mesh

DEEP_MM = 0.4
HEIGHTS_MM = (8.0, 6.0, 4.0)
"""Heights of digits; the largest for which there is room is taken."""

THICK_MM = 1.6  # of the wall that a number is pressed into
FREE_MM = 20.0  # before a side, so that one can read it
FLAT_MM = 1e-3  # what rises by more is round
SIDES = 12  # the largest, which are looked at


def engrave(solid: Any, number: int) -> Any:
    """Press a number into the largest flat side with room for it; without one a piece stays as it is.

    Args:
        solid: the piece, a Manifold.
        number: of the piece.
    """
    mesh = to_mesh(solid)
    by_area = np.argsort(-mesh.facets_area, kind="stable")[:SIDES]
    for height in HEIGHTS_MM:
        digits = _draw(str(number), height)
        low, high = np.reshape(digits.bounds(), (2, 2))
        radius = float(np.linalg.norm(high - low)) / 2
        digits = digits.translate(tuple(-(low + high) / 2))

        for side in by_area:
            frame = _find_place(solid, mesh, int(side), radius)
            if frame is not None:
                text = digits.extrude(DEEP_MM + 1).translate((0, 0, -DEEP_MM))
                return solid - text.transform(frame[:3])

    return solid


def _draw(text: str, height: float) -> Any:
    """Return a text as a CrossSection."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import TextPath

    bold = FontProperties(family="DejaVu Sans", weight="bold")
    path = TextPath((0, 0), text, size=1.37 * height, prop=bold)
    outlines = [np.asarray(outline) for outline in path.to_polygons(closed_only=True)]
    return manifold3d.CrossSection(outlines, manifold3d.FillRule.EvenOdd)


def _find_place(
    solid: Any, mesh: trimesh.Trimesh, side: int, radius: float
) -> Array | None:
    """Find a place on a flat side; None: it has no room.

    Args:
        solid: the piece.
        mesh: the piece.
        side: the number of the mesh's facet.
        radius: of the room that a number takes.

    Returns:
        A frame (4, 4): z points out of the side, x along it.
    """
    normal = mesh.facets_normal[side]
    to_side = trimesh.geometry.plane_transform(mesh.facets_origin[side], normal)
    corners = mesh.triangles[mesh.facets[side]].reshape(-1, 3)
    corners = trimesh.transform_points(corners, to_side)
    if np.ptp(corners[:, 2]) > FLAT_MM:
        return None

    triangles = list(corners[:, :2].reshape(-1, 3, 2))
    flat = manifold3d.CrossSection(triangles, manifold3d.FillRule.NonZero)
    outlines = flat.offset(-radius, manifold3d.JoinType.Round).to_polygons()
    if not outlines:
        return None

    inside = np.vstack(outlines)[manifold3d.triangulate(outlines)]
    edges = inside[:, 1:] - inside[:, :1]
    widest = int(np.abs(np.linalg.det(edges)).argmax())
    middle = [*inside[widest].mean(axis=0), 0.0]
    to_middle = trimesh.transformations.translation_matrix(middle)
    frame: Array = np.linalg.inv(to_side) @ to_middle
    place = frame[:3, 3]

    if solid.ray_cast(place + 0.01 * normal, place + FREE_MM * normal):
        return None

    hits = solid.ray_cast(place + 0.01 * normal, place - THICK_MM * normal)
    return frame if len(hits) <= 1 else None
