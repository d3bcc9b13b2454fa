"""Make a body of a mesh file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from core.errors import UsageError, UserError
from core.geometry import Pose
from core.scene import Body, Color, Geom
from core.values.urdf import NAME
from plugins.tasks.file.imports.bodies import Imported
from plugins.tasks.file.imports.solids import MAX_PARTS, THRESHOLD, MeshSolid, load_solid

_MORE = 0.05
_GREY: Color = (0.7, 0.7, 0.7, 1.0)
_UPRIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # y up to z up


@dataclass(frozen=True, kw_only=True)
class _Wanted:
    """What `read_mesh` is asked for, see there."""

    mass: float | None = None
    density: float | None = None
    name: str | None = None
    pose: Pose = field(default_factory=Pose)
    scale: float = 1.0
    color: Color | None = None
    friction: float = 0.5
    up: str | None = None
    max_parts: int = MAX_PARTS
    threshold: float = THRESHOLD

    def __post_init__(self) -> None:
        if (self.mass is None) == (self.density is None):
            raise UsageError("give either mass, kg, or density, kg/m^3")
        if not 1 <= self.max_parts <= 200 or not 0.01 <= self.threshold <= 1 or not 0 < self.scale < np.inf:
            raise UsageError("scale must be above 0, max_parts 1 to 200, threshold 0.01 to 1")
        if self.up not in (None, "y", "z"):
            raise UsageError(f"up must be y or z, got {self.up!r}")
        if not NAME.fullmatch(str(self.name)):
            raise UsageError(f"{self.name!r} is no body's name; give name=, of letters, digits, '_', '.' or '-'")


def read_mesh(file: str | Path, *, folder: Path | None = None, **options: Any) -> Imported:
    """Make a body of a mesh file, in the file's frame. A mesh that is not convex is cut into convex parts by CoACD.

    Args:
        file: OBJ, STL or GLB.
        folder: where the file, and what links lead to, must lie; None: where the file itself is.
        options: ``mass``: kg; 0: the body is fixed. Give it, or ``density``, kg/m^3. ``name``: the body's, by default
            the file's. ``pose``: in the world. ``scale``: metres for one unit of the file. ``color``: by default the
            file's own, of GLB and of corners; grey where there is none. ``friction``: the body's. ``up``: the file's
            axis that points up, ``y`` or ``z``, by default y for GLB, as its standard says, otherwise z.
            ``max_parts``: convex parts at most; with 1 the body collides as its convex hull. ``threshold``: of CoACD,
            0.01 to 1: how concave a part may be; less is finer, and slower.

    Raises:
        UserError: says what can't be used, where, and how to mend it.
    """
    file = Path(file).expanduser().absolute()
    try:
        wanted = _Wanted(**({"name": file.stem} | options))
    except UsageError as error:
        raise UsageError(f"{file}: {error}") from error
    stands = (wanted.up or ("y" if file.suffix.lower() == ".glb" else "z")) == "y"
    scale, turn = (wanted.scale,) * 3, _UPRIGHT if stands else None
    solid = load_solid(file, folder or file.parent, scale, wanted.max_parts, wanted.threshold, turn)
    mass = wanted.mass if wanted.density is None else wanted.density * solid.filled
    visuals = tuple(Geom(mesh, color=wanted.color or own or _GREY) for mesh, own in solid.drawn)
    collisions = tuple(Geom(part, color=visuals[0].color) for part in solid.parts)
    try:
        body = Body(str(wanted.name), wanted.pose, float(mass or 0.0), visuals, collisions, wanted.friction)
        return Imported((body,), notes=tuple(_notes(solid, turned=stands and wanted.up is None)))
    except ValueError as error:
        raise UserError(f"{file}: {error}") from error


def _notes(solid: MeshSolid, *, turned: bool) -> Iterator[str]:
    if turned:
        yield "y is up in a GLB file; it was turned so that z is up"
    if not np.isfinite(solid.volume):
        yield "the mesh is not closed, so that its volume is that of its convex parts"
    elif abs(excess := sum(part.volume for part in solid.parts) / solid.volume - 1) > _MORE:
        yield f"{len(solid.parts)} convex parts have {excess:+.0%} of volume; more max_parts fit better"
