"""Find mesh files within their folder, and keep what was read of them and cut, by their content."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path

import numpy as np

from core.errors import UserError
from core.geometry import Array, Mesh, frozen_array
from core.imports.meshes import MAX_MB, check_size, kind_of, whole_content
from core.robot.meshes import keep_file
from core.scene import Color
from core.support.files import read_untrusted
from core.support.sandbox import TooSlowError, isolated
from plugins.tasks.file.imports.convex import DRAWN, read_bytes

FINE_S = 120.0  # in which a mesh is cut finely; else it is cut coarsely
_NO_TURN = frozen_array(np.eye(3))


@dataclass(frozen=True)
class MeshSolid:
    """What a mesh file holds, in metres: what is drawn, with a colour or None, and convex parts.

    ``volume`` is that of the mesh, m^3, or nan if it is not closed. ``coarse``: it was cut
    coarsely, as finely takes long.
    """

    drawn: tuple[tuple[Mesh, Color | None], ...]
    parts: tuple[Mesh, ...]
    volume: float
    coarse: bool = False

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
    """Read a mesh file: convex pieces as they are, the rest cut into convex parts, once for each content.

    Args:
        file: of one of the kinds that are read.
        folder: where it must lie.
        scale: of x, y and z.
        drawn_only: without convex parts.
        turn: (3, 3) a rotation, before the scale.

    Raises:
        UserError: it can't be read or cut.
    """
    kind_of(file)
    data = read_inside(file, folder, "mesh")
    found = _read(data, str(file.absolute()), drawn_only)
    change = np.diag(np.asarray(scale, dtype=np.float64)) @ turn
    determinant = float(np.linalg.det(change))

    drawn: list[tuple[Mesh, Color | None]] = []
    while f"v{len(drawn)}" in found:
        number = len(drawn)
        faces = found[f"f{number}"].astype(np.int64)
        if determinant < 0:  # mirrored
            faces = faces[:, ::-1]

        mesh = Mesh(found[f"v{number}"] @ change.T, faces)
        color = tuple(found[f"c{number}"].tolist())
        drawn.append((mesh, None if np.isnan(color[0]) else color))

    parts: list[Mesh] = []
    while f"p{len(parts)}" in found:
        corners = found[f"p{len(parts)}"] @ change.T
        parts.append(Mesh.hull_of(corners))

    try:
        check_size(float(max(mesh.bounds[1].max() for mesh, _ in drawn)))
    except UserError as error:
        raise UserError(f"mesh {file} {error}") from error

    volume = float(found.get("volume", np.nan)) * abs(determinant)
    return MeshSolid(tuple(drawn), tuple(parts), volume, "coarse" in found)


def note_coarse(file: Path) -> str:
    """Say that a mesh was cut coarsely."""
    return (
        f"mesh {file.name} was cut into convex parts coarsely, as finely takes more than {FINE_S:g} s; give it cut "
        "into convex pieces, or with fewer triangles"
    )


@lru_cache(maxsize=64)
def _read(data: bytes, name: str, drawn_only: bool) -> dict[str, Array]:
    """Read a mesh in a process of its own, see `convex.read_mesh`; kept on disk by its content."""
    wanted = DRAWN if drawn_only else "fine"
    step = f"reading {name}, and cutting what is not convex, which is kept for the next time"

    def read() -> bytes:
        call = partial(isolated, read_bytes, f"mesh {name}", data, name)
        try:
            return call(wanted, limit_s=FINE_S, step=step)
        except TooSlowError:
            if drawn_only:
                raise

        return call(
            "coarse",
            step=f"cutting {name} coarsely, as finely takes more than {FINE_S:g} s",
        )

    path = Path(name)
    content = f"{kind_of(path)} {wanted} ".encode() + whole_content(path, data)
    file = keep_file("pieces", "npz", content, read)
    with np.load(file) as found:
        return dict(found)
