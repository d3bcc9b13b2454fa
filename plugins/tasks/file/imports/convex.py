"""Read a mesh file and cut it into convex parts: called in a process of its own."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import trimesh
from scipy.spatial import ConvexHull, QhullError

from core.errors import UserError
from core.geometry import Array
from core.robot.meshes import MAX_CORNERS, farthest

MAX_FACES = 200_000
_CONVEX = 0.97  # of its hull's volume
_CONCAVE = 0.05  # how concave a part may be, as CoACD measures it


def cut_mesh(data: bytes, kind: str, max_parts: int) -> dict[str, Any]:
    """Return arrays: ``v0``, ``f0``, ``c0`` of what is drawn, ``p0`` of each convex part's corners, and ``volume``.

    The colour is nan where there is none, the volume where the mesh is not closed.

    Raises:
        UserError: the mesh can't be read or cut.
    """
    try:
        scene = trimesh.load_scene(io.BytesIO(data), file_type=kind)
        drawn = [part for part in scene.dump() if _solid(part)]
        colors = [_color(part) for part in drawn]
    except Exception as error:  # the readers raise whatever they stumble over
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        raise UserError(
            f"can't be read as {kind.upper()} ({reason}); export it again"
        ) from error

    faces = sum(len(part.faces) for part in drawn)
    if not faces:
        raise UserError("has no triangles; export it again")
    if faces > MAX_FACES:
        mend = "reduce them, for example with MeshLab's quadric edge collapse"
        raise UserError(f"has {faces} triangles; at most {MAX_FACES} are read: {mend}")

    found: dict[str, Any] = {}
    for number, (part, color) in enumerate(zip(drawn, colors, strict=True)):
        found[f"v{number}"] = part.vertices
        found[f"f{number}"] = part.faces
        found[f"c{number}"] = color

    vertices = [part.vertices for part in drawn]
    triangles = [part.faces for part in drawn]
    whole = trimesh.Trimesh(*trimesh.util.append_faces(vertices, triangles))
    if not np.isfinite(whole.vertices).all() or np.abs(whole.vertices).max() > 1e9:
        raise UserError(
            "has a corner that is no number of a usual size; export it again"
        )

    whole.remove_unreferenced_vertices()
    whole.fix_normals()
    found["volume"] = np.nan
    if whole.is_watertight:
        found["volume"] = whole.volume
    try:
        for number, corners in enumerate(_parts(whole, max_parts)):
            found[f"p{number}"] = farthest(corners[ConvexHull(corners).vertices])
    except QhullError as error:
        raise UserError("is flat: a body needs a volume; give it depth") from error

    return found


def _solid(part: Any) -> bool:
    """Check if a part of a file has triangles."""
    return isinstance(part, trimesh.Trimesh) and len(part.faces) > 0


def _color(part: trimesh.Trimesh) -> Array:
    """Read a part's colour, four numbers from 0 to 1; nan where it has none."""
    if not part.visual.defined:
        return np.full(4, np.nan)
    color = getattr(part.visual, "material", part.visual).main_color
    return np.asarray(color, dtype=np.float64) / 255


def _parts(whole: trimesh.Trimesh, max_parts: int) -> list[Array]:
    """Cut a mesh into the corners of convex parts: its separate pieces if they are convex, otherwise by CoACD."""
    if max_parts == 0:
        return []
    if _is_convex(whole):
        return [whole.vertices]
    if whole.body_count <= max_parts:
        pieces = whole.split(only_watertight=False)
        if len(pieces) > 1 and all(map(_is_convex, pieces)):
            return [piece.vertices for piece in pieces]

    if ConvexHull(whole.vertices).volume == 0:
        raise QhullError
    try:
        import coacd
    except ImportError as error:
        raise UserError(
            "is not convex; to cut it into parts, pip install 'coacd>=1.0.14,<2'"
        ) from error

    coacd.set_log_level("error")
    found = coacd.run_coacd(
        coacd.Mesh(whole.vertices, whole.faces.astype(np.int32)),
        threshold=_CONCAVE,
        max_convex_hull=max_parts,
        decimate=True,
        max_ch_vertex=MAX_CORNERS // 2,
    )
    parts = [corners for corners, _ in found]
    if not 1 <= len(parts) <= max_parts:
        raise UserError(
            f"falls into {len(parts)} convex parts; at most {max_parts} are made: make it simpler"
        )

    return parts


def _is_convex(mesh: trimesh.Trimesh) -> bool:
    """Check if a mesh is closed and nearly fills its convex hull."""
    return bool(
        mesh.is_watertight and mesh.volume > _CONVEX * ConvexHull(mesh.vertices).volume
    )


def cut_bytes(data: bytes, kind: str, max_parts: str) -> bytes:
    """Return what `cut_mesh` does as an .npz file."""
    stream = io.BytesIO()
    np.savez_compressed(stream, **cut_mesh(data, kind, int(max_parts)))
    return stream.getvalue()
