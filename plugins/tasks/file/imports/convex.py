"""Read a mesh file, and cut what is not convex: called in processes of their own."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from scipy.spatial import QhullError

from core.errors import UserError
from core.geometry import Array
from core.imports.meshes import (
    MAX_CORNERS,
    find_color,
    hull_corners,
    load_parts,
)
from plugins.tasks.file.imports.pieces import find_pieces

MAX_FACES = 200_000
MAX_PARTS = 64  # into which what is not convex is cut
# How CoACD cuts: how concave a part may be, as it measures that, and how long it looks for each cut. Its own 150
# iterations with 20 nodes take minutes for a can of 950 triangles, and its parts are no better.
MANNERS: dict[str, dict[str, Any]] = {
    "fine": {"threshold": 0.02, "mcts_iterations": 60, "mcts_nodes": 10},
    "coarse": {
        "threshold": 0.1,
        "mcts_iterations": 30,
        "mcts_nodes": 6,
        "mcts_max_depth": 2,
        "resolution": 500,
        "preprocess_resolution": 20,
    },
}
DRAWN = "drawn"  # and not cut
_UNPAINTED = (np.nan,) * 4


def read_mesh(data: bytes, file: Path, wanted: str) -> dict[str, Any]:
    """Return arrays: ``v0``, ``f0``, ``c0`` of what is drawn in each colour, and what collides.

    That is ``p0``, the corners of each convex part, and ``volume``. All is in metres. A colour is nan where there is
    none, the volume where the mesh is not closed. ``wanted`` is one of `MANNERS`, or `DRAWN`: nothing collides.

    Raises:
        UserError: the mesh can't be read, or not be cut.
    """
    groups = [part.process() for part in load_parts(data, file)]
    _check_faces(groups)
    painted = [(find_color(part), part) for part in groups]
    found: dict[str, Any] = {}
    for number, color in enumerate(dict.fromkeys(color for color, _ in painted)):
        alike = [part for paint, part in painted if paint == color]
        vertices, faces = trimesh.util.append_faces(
            [part.vertices for part in alike], [part.faces for part in alike]
        )
        found[f"v{number}"] = vertices
        found[f"f{number}"] = faces
        found[f"c{number}"] = color or _UNPAINTED

    if wanted == DRAWN:
        return found

    try:
        parts, rest, found["volume"] = find_pieces(groups)
        if rest is not None:
            parts += cut(rest.vertices, rest.faces, MAX_PARTS, wanted)
            found[wanted] = True

        for number, corners in enumerate(parts):
            found[f"p{number}"] = hull_corners(corners)
    except QhullError as error:
        raise UserError("is flat: a body needs a volume; give it depth") from error

    return found


def _check_faces(groups: Sequence[trimesh.Trimesh]) -> None:
    """Refuse a mesh with too many triangles to look for pieces in it, and cut it."""
    faces = sum(len(part.faces) for part in groups)
    if faces > MAX_FACES:
        mend = "reduce them, for example with MeshLab's quadric edge collapse"
        raise UserError(f"has {faces} triangles; at most {MAX_FACES} are read: {mend}")


def cut(
    vertices: Array, faces: Array, max_parts: int, manner: str = "fine"
) -> list[Array]:
    """Cut a mesh that is not convex into the corners of convex parts, by CoACD, in one of `MANNERS`.

    Raises:
        UserError: it can't be cut.
    """
    try:
        import coacd
    except ImportError as error:
        raise UserError(
            "is not convex; to cut it into parts, pip install 'coacd>=1.0.14,<2'"
        ) from error

    coacd.set_log_level("error")
    found = coacd.run_coacd(
        coacd.Mesh(vertices, faces.astype(np.int32)),
        **MANNERS[manner],
        max_convex_hull=max_parts,
        decimate=True,
        max_ch_vertex=MAX_CORNERS // 2,
    )
    if not 1 <= len(found) <= max_parts:
        raise UserError(
            f"falls into {len(found)} convex parts; at most {max_parts} are made: make it simpler"
        )

    return [corners for corners, _ in found]


def read_bytes(data: bytes, file: str, wanted: str) -> bytes:
    """Return what `read_mesh` does as an .npz file."""
    stream = io.BytesIO()
    found = read_mesh(data, Path(file), wanted)
    np.savez_compressed(stream, **found)
    return stream.getvalue()
