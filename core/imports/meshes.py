"""Read mesh files that others made, and reduce them to hulls that every engine takes. A file is untrusted."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial import ConvexHull

from core.errors import UserError, in_line
from core.geometry import Array, Color
from core.support.files import read_untrusted

if TYPE_CHECKING:
    import trimesh

KINDS = (".stl", ".obj", ".ply", ".dae", ".glb", ".3mf")
MAX_MB = 64
LARGEST_M = 5.0
SMALLEST_M = 1e-4
# PhysX takes at most 255 faces, and cuts larger hulls its own way; a hull of V corners has up to 2 V - 4.
MAX_CORNERS = 128
_MANY = 8_000  # corners of a hull: of more, only those farthest in many directions are looked at
_MAX_COORDINATE = 1e9  # in the unit of the file
# Groups of an OBJ file stay apart.
_OPTIONS: dict[str, dict[str, Any]] = {
    "obj": {"split_objects": True, "split_groups": True}
}
_MATERIALS = re.compile(rb"^mtllib[ \t]+(.+?)[ \t\r]*$", re.MULTILINE)


def kind_of(file: Path) -> str:
    """Return the kind of a mesh file, such as ``obj``.

    Raises:
        UserError: it is of another kind.
    """
    suffix = file.suffix.lower()
    if suffix not in KINDS:
        name = " ".join(str(file).split())
        raise UserError(
            f"mesh {name} is of no kind that is read: {', '.join(KINDS)}; export it as one of them"
        )

    return suffix[1:]


def whole_content(file: Path, data: bytes) -> bytes:
    """Return a file's content with that of the materials beside it, which tells equal meshes.

    Args:
        file: the mesh file.
        data: its content.
    """
    for found in _MATERIALS.findall(data) if kind_of(file) == "obj" else ():
        beside = file.parent / Path(found.decode("utf-8", "replace")).name
        if beside.is_file():
            data += read_untrusted(beside, MAX_MB * 1_000_000)

    return data


def load_parts(data: bytes, file: Path) -> list[trimesh.Trimesh]:
    """Read the parts of a mesh file that have triangles, in metres; call it in a process of its own.

    Groups of an OBJ file, nodes, and what has another material are parts. A unit that the file names counts, an axis
    that it calls up does not, as in RViz. Of other files, materials and textures are read that lie in its folder.

    Args:
        data: its content.
        file: where it lies.

    Raises:
        UserError: it can't be read, has no triangles, or a corner is no usual number.
    """
    import trimesh  # which takes half a second

    kind = kind_of(file)
    try:
        scene = trimesh.load_scene(
            io.BytesIO(data),
            file_type=kind,
            resolver=trimesh.resolvers.FilePathResolver(str(file)),
            process=False,
            **_OPTIONS.get(kind, {}),
        )
        units = (part.units for part in scene.geometry.values() if part.units)
        unit = next(units, None)
        factor = trimesh.units.unit_conversion(unit, "meters") if unit else 1.0
        parts = [
            part.apply_scale(factor)
            for part in scene.dump()
            if isinstance(part, trimesh.Trimesh) and len(part.faces)
        ]
        corners = [used_corners(part) for part in parts]
    except Exception as error:  # the readers raise whatever they stumble over
        reason = in_line(error)[:200]
        raise UserError(
            f"can't be read as {kind.upper()} ({reason}); export it again"
        ) from error

    if not parts:
        raise UserError("has no triangles; export it again")
    if not all((np.abs(some) <= _MAX_COORDINATE).all() for some in corners):
        raise UserError(
            "has a corner that is not a finite number of usual size; export it again"
        )

    return parts


def check_size(size: float) -> None:
    """Refuse a mesh that is far too large or small, such as one that was drawn in millimetres.

    Args:
        size: of the longest side of its bounding box, metres.

    Raises:
        UserError: it is.
    """
    if size > LARGEST_M:
        raise UserError(
            f"is {size:.4g} m large; if it is in millimetres, give it the scale 0.001 (in a URDF "
            '<mesh scale="0.001 0.001 0.001">)'
        )

    if size < SMALLEST_M:
        raise UserError(f"is only {size:.2g} m large; give it another scale")


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
