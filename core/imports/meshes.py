"""Read mesh files that others made, and reduce them to hulls that every engine takes. A file is untrusted."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import trimesh
from scipy.spatial import ConvexHull

from core.errors import UserError
from core.geometry import Array, Color

# PhysX takes at most 255 faces, and cuts larger hulls its own way; a hull of V corners has up to 2 V - 4.
MAX_CORNERS = 128
_MANY = 8_000  # corners of a hull: of more, only those farthest in many directions are looked at


def load_parts(
    source: Path | BinaryIO, kind: str, options: Mapping[str, Any]
) -> tuple[list[trimesh.Trimesh], str | None]:
    """Read the parts of a mesh file that have triangles; call it in a process of its own.

    Args:
        source: the file, or its content.
        kind: such as ``obj``.
        options: of Trimesh's reader.

    Returns:
        the parts, in the file's unit; and the name of that, if the file says it.

    Raises:
        UserError: it can't be read, has no triangles, or a corner is no finite number.
    """
    try:
        scene = trimesh.load_scene(source, file_type=kind, **options)
        units = (part.units for part in scene.geometry.values() if part.units)
        unit = next(units, None)
        parts = [
            part
            for part in scene.dump()
            if isinstance(part, trimesh.Trimesh) and len(part.faces)
        ]
        corners = [used_corners(part) for part in parts]
    except Exception as error:  # the readers raise whatever they stumble over
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        raise UserError(
            f"can't be read as {kind.upper()} ({reason}); export it again"
        ) from error

    if not parts:
        raise UserError("has no triangles; export it again")
    if not all(np.isfinite(some).all() for some in corners):
        raise UserError("has a corner that is not a finite number; export it again")

    return parts, unit


def used_corners(part: trimesh.Trimesh) -> Array:
    """Return the corners (V, 3) of a part that its triangles have."""
    return np.asarray(part.vertices[part.referenced_vertices])


def find_color(part: trimesh.Trimesh) -> Color | None:
    """Find a part's main colour: red, green, blue and opacity, 0..1; None: it has none."""
    if not part.visual.defined:
        return None

    color = getattr(part.visual, "material", part.visual).main_color
    red, green, blue, opacity = (np.asarray(color, dtype=np.float64) / 255).tolist()
    return red, green, blue, opacity


def hull_corners(corners: Array) -> Array:
    """Return the corners (V, 3) of the convex hull, as many as an engine takes: those that stick out the most.

    Raises:
        QhullError: they are flat.
    """
    return _keep_farthest(corners[ConvexHull(corners).vertices])


def _keep_farthest(corners: Array) -> Array:
    """Choose few of a hull's corners, each the one farthest outside of the hull of those before it.

    Args:
        corners: (V, 3) of the hull.

    Returns:
        At most `MAX_CORNERS` of them.
    """
    if len(corners) <= MAX_CORNERS:
        return corners
    if len(corners) > _MANY:
        ways = np.random.default_rng(0).normal(size=(_MANY // 4, 3))
        corners = corners[np.unique([int((corners @ way).argmax()) for way in ways])]

    first = corners[:1]
    while len(first) < 4:
        center = first.mean(axis=0)

        # Of the line or plane through them.
        axes = np.linalg.svd(first - center)[2][: len(first) - 1]
        off = (corners - center) - (corners - center) @ axes.T @ axes
        first = np.vstack([first, corners[np.linalg.norm(off, axis=1).argmax()]])

    hull = ConvexHull(first, incremental=True)
    while len(hull.points) < MAX_CORNERS:
        outside = (corners @ hull.equations[:, :3].T + hull.equations[:, 3]).max(axis=1)
        hull.add_points(corners[[outside.argmax()]])

    return np.asarray(hull.points)
