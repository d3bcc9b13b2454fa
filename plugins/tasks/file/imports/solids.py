"""Find mesh files within their folder, and keep what they are cut into, by their content."""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull

from core.errors import UserError
from core.geometry import Array, Mesh, frozen_array
from core.robot.meshes import keep_file
from core.scene import Color
from core.support.files import read_untrusted
from core.support.sandbox import isolated
from plugins.tasks.file.imports.convex import cut_bytes

KINDS = (".glb", ".obj", ".stl")
MAX_MB = 64
MAX_PARTS = 32
_LARGEST_M = 5.0
_NO_TURN = frozen_array(np.eye(3))


@dataclass(frozen=True)
class MeshSolid:
    """What a mesh file holds, in metres: what is drawn, with a colour or None, and convex parts.

    ``volume`` is that of the mesh, m^3, or nan if it is not closed.
    """

    drawn: tuple[tuple[Mesh, Color | None], ...]
    parts: tuple[Mesh, ...]
    volume: float

    @property
    def filled(self) -> float:
        """The volume of the mesh, or of its parts if it is not closed, m^3."""
        if np.isfinite(self.volume):
            return self.volume
        return sum(part.volume for part in self.parts)


def read_inside(file: Path, folder: Path, kind: str, max_mb: float = MAX_MB) -> bytes:
    """Read a file of a folder.

    Raises:
        UserError: it lies elsewhere, is no file, is too large, or can't be read.
    """
    try:
        there = file.resolve()
        inside = there.is_relative_to(folder.resolve())
    # ValueError: a name with a zero byte; RuntimeError: links in a circle.
    except (OSError, ValueError, RuntimeError) as error:
        raise UserError(f"{kind} {str(file)[:200]!r} can't be read: {error}") from error

    if not inside:
        raise UserError(f"{kind} {file} is not in folder {folder}; put it there")
    try:
        return read_untrusted(there, int(max_mb * 1e6))
    except UserError as error:
        raise UserError(f"{kind} {error}") from error


def load_solid(
    file: Path,
    folder: Path,
    scale: Sequence[float] = (1.0, 1.0, 1.0),
    *,
    drawn_only: bool = False,
    turn: Array = _NO_TURN,
) -> MeshSolid:
    """Read a mesh file, and cut it into convex parts unless it was cut before.

    Args:
        file: OBJ, STL or GLB.
        folder: where it must lie.
        scale: of x, y and z.
        drawn_only: without convex parts.
        turn: (3, 3) a rotation, before the scale.

    Raises:
        UserError: it can't be read or cut.
    """
    suffix = file.suffix.lower()
    if suffix not in KINDS:
        raise UserError(
            f"mesh {file} is of no kind that is read: {', '.join(KINDS)}; export it as one of them"
        )

    data = read_inside(file, folder, "mesh")
    max_parts = MAX_PARTS
    if drawn_only:
        max_parts = 0
    found = _cut(data, suffix[1:], max_parts, str(file))
    change = np.diag(np.asarray(scale, dtype=np.float64)) @ turn
    determinant = float(np.linalg.det(change))

    drawn: list[tuple[Mesh, Color | None]] = []
    while f"v{len(drawn)}" in found:
        number = len(drawn)
        faces = found[f"f{number}"].astype(np.int64)
        if determinant < 0:  # mirrored
            faces = faces[:, ::-1]
        mesh = Mesh(found[f"v{number}"] @ change.T, faces)
        red, green, blue, opacity = found[f"c{number}"].tolist()
        if np.isnan(red):
            drawn.append((mesh, None))
        else:
            drawn.append((mesh, (red, green, blue, opacity)))

    parts: list[Mesh] = []
    while f"p{len(parts)}" in found:
        parts.append(_hull(found[f"p{len(parts)}"] @ change.T))

    size = float(max(mesh.bounds[1].max() for mesh, _ in drawn))
    if size > _LARGEST_M:
        raise UserError(
            f"mesh {file} is {size:.4g} m large; if it is in millimetres, give its scale as 0.001"
        )

    if size < 1e-4:
        raise UserError(
            f"mesh {file} is only {size:.2g} m large; give it another scale"
        )

    volume = float(found["volume"]) * abs(determinant)
    return MeshSolid(tuple(drawn), tuple(parts), volume)


def _hull(corners: Array) -> Mesh:
    """Make a mesh of the convex hull of corners (N, 3), whose faces look outward."""
    hull = ConvexHull(corners)
    faces: npt.NDArray[np.int64] = hull.simplices.astype(np.int64)
    first, second = np.diff(corners[faces], axis=1).swapaxes(0, 1)
    inward = (np.cross(first, second) * hull.equations[:, :3]).sum(axis=1) < 0
    faces[inward] = faces[inward, ::-1]
    return Mesh(corners, faces)


@lru_cache(maxsize=64)
def _cut(data: bytes, kind: str, max_parts: int, name: str) -> dict[str, Array]:
    """Cut a mesh in a process of its own, see `cut_mesh`; kept on disk by its content."""

    def cut() -> bytes:
        return isolated(cut_bytes, f"mesh {name}", data, kind, str(max_parts))

    key = f"{kind} {max_parts} ".encode() + data
    file = keep_file("imports", "npz", key, cut)
    try:
        with np.load(file) as found:
            return dict(found)
    except (OSError, ValueError, zipfile.BadZipFile) as error:
        raise UserError(
            f"what mesh {name} was cut into can't be read; delete {file}"
        ) from error
