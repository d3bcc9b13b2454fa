"""Read a mesh file, and cut what is not convex: called in processes of their own."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

import numpy as np
import trimesh
from scipy.spatial import ConvexHull, QhullError

from core.errors import UserError
from core.geometry import Array
from core.robot.meshes import MAX_CORNERS, farthest
from plugins.tasks.file.imports.pieces import find_pieces

MAX_FACES = 200_000
_CONCAVE = 0.02  # how concave a part may be, as CoACD measures it
_UNPAINTED = (np.nan,) * 4
# Groups of an OBJ file stay apart; no file is looked for that it names.
_OPTIONS = {
    "obj": {
        "split_objects": True,
        "split_groups": True,
        "group_material": False,
        "skip_materials": True,
    }
}


def read_mesh(data: bytes, kind: str, *, drawn_only: bool) -> dict[str, Any]:
    """Return arrays: ``v0``, ``f0``, ``c0`` of what is drawn in each colour, and unless ``drawn_only`` what collides.

    That is ``p0``, the corners of each convex piece, ``rest_v`` and ``rest_f`` of what is not convex, and ``volume``.
    A colour is nan where there is none, the volume where the mesh is not closed.

    Raises:
        UserError: the mesh can't be read.
    """
    try:
        scene = trimesh.load_scene(
            io.BytesIO(data), file_type=kind, **_OPTIONS.get(kind, {})
        )
        groups = [part for part in scene.dump() if _is_solid(part)]
        painted = [(_color(part), part) for part in groups]
    except Exception as error:  # the readers raise whatever they stumble over
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        raise UserError(
            f"can't be read as {kind.upper()} ({reason}); export it again"
        ) from error

    _check_size(groups)
    found: dict[str, Any] = {}
    for number, color in enumerate(dict.fromkeys(color for color, _ in painted)):
        alike = [part for paint, part in painted if paint == color]
        vertices, faces = trimesh.util.append_faces(
            [part.vertices for part in alike], [part.faces for part in alike]
        )
        found[f"v{number}"] = vertices
        found[f"f{number}"] = faces
        found[f"c{number}"] = color or _UNPAINTED

    if drawn_only:
        return found

    try:
        convex, rest, found["volume"] = find_pieces(groups)
        for number, corners in enumerate(convex):
            found[f"p{number}"] = _reduce(corners)
    except QhullError as error:
        raise UserError("is flat: a body needs a volume; give it depth") from error

    if rest is not None:
        found["rest_v"] = rest.vertices
        found["rest_f"] = rest.faces

    return found


def _is_solid(part: Any) -> bool:
    """Check if a part of a file has triangles."""
    return isinstance(part, trimesh.Trimesh) and len(part.faces) > 0


def _color(part: trimesh.Trimesh) -> tuple[float, ...] | None:
    """Read a part's colour, four numbers from 0 to 1; None: it has none."""
    if not part.visual.defined:
        return None

    color = getattr(part.visual, "material", part.visual).main_color
    return tuple((np.asarray(color, dtype=np.float64) / 255).tolist())


def _check_size(groups: Sequence[trimesh.Trimesh]) -> None:
    """Refuse a mesh without triangles, with too many, or with corners that are no usual numbers."""
    faces = sum(len(part.faces) for part in groups)
    if not faces:
        raise UserError("has no triangles; export it again")
    if faces > MAX_FACES:
        mend = "reduce them, for example with MeshLab's quadric edge collapse"
        raise UserError(f"has {faces} triangles; at most {MAX_FACES} are read: {mend}")

    for part in groups:
        used = part.vertices[part.referenced_vertices]
        if not np.isfinite(used).all() or np.abs(used).max() > 1e9:
            raise UserError(
                "has a corner that is no number of a usual size; export it again"
            )


def cut(vertices: Array, faces: Array, max_parts: int) -> list[Array]:
    """Cut a mesh that is not convex into the corners of convex parts, by CoACD.

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
        threshold=_CONCAVE,
        max_convex_hull=max_parts,
        decimate=True,
        max_ch_vertex=MAX_CORNERS // 2,
    )
    if not 1 <= len(found) <= max_parts:
        raise UserError(
            f"falls into {len(found)} convex parts; at most {max_parts} are made: make it simpler"
        )

    return [_reduce(corners) for corners, _ in found]


def _reduce(corners: Array) -> Array:
    """Return the corners of the convex hull, as many as an engine takes."""
    return farthest(corners[ConvexHull(corners).vertices])


def read_bytes(data: bytes, kind: str, wanted: str) -> bytes:
    """Return what `read_mesh` does as an .npz file."""
    return _pack(read_mesh(data, kind, drawn_only=wanted == "drawn"))


def cut_bytes(data: bytes, max_parts: str) -> bytes:
    """Cut a mesh, ``v`` and ``f`` of an .npz file, and return an .npz file of its parts, ``p0`` and so on."""
    with np.load(io.BytesIO(data)) as mesh:
        parts = cut(mesh["v"], mesh["f"], int(max_parts))

    return _pack({f"p{number}": part for number, part in enumerate(parts)})


def _pack(arrays: dict[str, Any]) -> bytes:
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    return stream.getvalue()
