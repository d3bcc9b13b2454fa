"""Make a body of a mesh file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from core.errors import UsageError, UserError
from core.geometry import Pose
from core.robot.urdf import NAME
from core.scene import Body, Color, Geom
from plugins.tasks.file.imports.bodies import Imported
from plugins.tasks.file.imports.solids import MAX_PARTS, THRESHOLD, load_solid

_MORE = 0.05
_GREY: Color = (0.7, 0.7, 0.7, 1.0)
_UPRIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # y up to z up


def read_mesh(
    file: str | Path,
    *,
    mass: float | None = None,
    density: float | None = None,
    name: str | None = None,
    pose: Pose | None = None,
    scale: float = 1.0,
    color: Color | None = None,
    friction: float = 0.5,
    up: str | None = None,
    max_parts: int = MAX_PARTS,
    threshold: float = THRESHOLD,
    folder: Path | None = None,
) -> Imported:
    """Make a body of a mesh file, in the file's frame. A mesh that is not convex is cut into convex parts by CoACD.

    Args:
        file: OBJ, STL or GLB.
        mass: kg; 0: the body is fixed. Give it, or ``density``.
        density: kg/m^3.
        name: the body's; None: the file's.
        pose: in the world.
        scale: metres for one unit of the file.
        color: None: the file's own, of GLB and of corners; grey where there is none.
        friction: the body's.
        up: the file's axis that points up, ``y`` or ``z``; None: y for GLB, as its standard says, otherwise z.
        max_parts: convex parts at most; with 1 the body collides as its convex hull.
        threshold: of CoACD, 0.01 to 1: how concave a part may be; less is finer, and slower.
        folder: where the file, and what links lead to, must lie; None: where the file itself is.

    Raises:
        UserError: says what can't be used, where, and how to mend it.
    """
    file = Path(file).expanduser().absolute()
    if (mass is None) == (density is None):
        raise UsageError(f"{file}: give either mass, kg, or density, kg/m^3")
    if not 1 <= max_parts <= 200 or not 0.01 <= threshold <= 1 or not 0 < scale < np.inf:
        raise UsageError(f"{file}: scale must be above 0, max_parts 1 to 200, threshold 0.01 to 1")
    if up not in (None, "y", "z"):
        raise UsageError(f"{file}: up must be y or z, got {up!r}")
    name = name or file.stem
    if not NAME.fullmatch(name):
        raise UsageError(f"{file}: {name!r} is no body's name; give name=, of letters, digits, '_', '.' or '-'")
    stands = (up or ("y" if file.suffix.lower() == ".glb" else "z")) == "y"
    solid = load_solid(file, folder or file.parent, (scale,) * 3, max_parts, threshold, _UPRIGHT if stands else None)
    notes = []
    if stands and up is None:
        notes.append("y is up in a GLB file; it was turned so that z is up")
    if not np.isfinite(solid.volume):
        notes.append("the mesh is not closed, so that its volume is that of its convex parts")
    elif abs(excess := sum(part.volume for part in solid.parts) / solid.volume - 1) > _MORE:
        notes.append(f"{len(solid.parts)} convex parts have {excess:+.0%} of volume; more max_parts fit better")
    weight = mass if density is None else density * solid.filled
    visuals = tuple(Geom(mesh, color=color or own or _GREY) for mesh, own in solid.drawn)
    collisions = tuple(Geom(part, color=visuals[0].color) for part in solid.parts)
    try:
        body = Body(name, pose or Pose(), float(weight or 0.0), visuals, collisions, friction)
        return Imported((body,), notes=tuple(notes))
    except ValueError as error:
        raise UserError(f"{file}: {error}") from error
