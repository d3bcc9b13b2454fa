"""Make a body of a mesh file."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from core.errors import UserError
from core.geometry import Pose
from core.scene import Body, Color, Geom
from core.support.cli import expand
from plugins.tasks.file.imports.imported import Imported
from plugins.tasks.file.imports.solids import MeshSolid, load_solid, note_coarse

_MORE = 0.02
_GREY: Color = (0.7, 0.7, 0.7, 1.0)
# Turns y up to z up.
_UPRIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


def read_mesh(
    file: str | Path, scale: float = 1.0, folder: Path | None = None
) -> Imported:
    """Make a body of 1 kg/m^3 of a mesh file, in the file's frame. What is not convex is cut into parts by CoACD.

    The y axis of a GLB file points up, as its standard says, and is turned to z.

    Args:
        file: of one of `core.imports.meshes.KINDS`.
        scale: metres for one unit of the file.
        folder: where the file, and what links lead to, must lie; None: where the file itself is.

    Raises:
        UserError: says what can't be used, where, and how to mend it.
    """
    file = expand(file).absolute()
    upright = file.suffix.lower() != ".glb"
    turn = np.eye(3)
    if not upright:
        turn = _UPRIGHT

    solid = load_solid(file, folder or file.parent, (scale,) * 3, turn=turn)
    visuals = tuple(Geom(mesh, color=color or _GREY) for mesh, color in solid.drawn)
    collisions = tuple(Geom(part, color=visuals[0].color) for part in solid.parts)
    try:
        body = Body("body", Pose(), float(solid.filled), visuals, collisions)
        notes = list(_notes(solid, upright))
        if solid.coarse:
            notes.append(note_coarse(file))

        return Imported((body,), notes=tuple(notes))
    except ValueError as error:
        raise UserError(f"{file}: {error}") from error


def _notes(solid: MeshSolid, upright: bool) -> Iterator[str]:
    """Yield a line for each thing that a user should know of a mesh."""
    if not upright:
        yield "y is up in a GLB file; it was turned so that z is up"
    if not np.isfinite(solid.volume):
        yield "the mesh is not closed, so that its volume is that of its convex parts"
        return

    excess = sum(part.volume for part in solid.parts) / solid.volume - 1
    if abs(excess) > _MORE:
        yield f"{len(solid.parts)} convex parts have {excess:+.0%} of volume"
