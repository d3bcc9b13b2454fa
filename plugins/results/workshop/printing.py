"""Lay solids on a printer's plate, check and weigh them. Lengths are millimetres, as for slicers."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import networkx
import numpy as np
import trimesh
import trimesh.sample

from core.geometry import Array, Mesh
from core.support.templates import macros
from core.values.materials import PAPER, Material
from core.values.printers import Printer
from plugins.results.workshop.lying import OVERHANG_DEG, Lying, lay
from plugins.results.workshop.solid import (
    SHORTEST_MM,
    WELDS_MM,
    Placed,
    ToolLink,
    closed,
    manifold,
    to_mesh,
    union,
)

PLA_G_PER_CM3 = 1.24  # density of polylactide, data sheets of filaments

OVERLAP = "let components overlap by more than a wall"
THICKEN = "thicken the thinnest component"
LARGER = "shorten it, or choose a larger printer"

_SAMPLES = 3000  # points at which walls are measured
_SKIN_MM = 1e-4  # a hit nearer than this is the face where the ray began
_SLIVER_MM2 = 1e-3  # smaller faces have no reliable direction
_SPOT_MM2 = 5.0  # of a surface that decides how thin a wall is; less of it is an edge
_WALL = 0.96  # cosine up to which two faces make a wall; beyond it they meet at an edge


class Check(NamedTuple):
    """One thing that was checked.

    Attributes:
        name: of what was checked.
        passed: None: it is not known.
        found: what was found, with figures.
        mend: where it fails, what to change.
        part: the link or component that it is of; empty: it is of the whole.
    """

    name: str
    passed: bool | None
    found: str
    mend: str = ""
    part: str = ""

    def __str__(self) -> str:
        name = f"{self.name}, {self.part}" if self.part else self.name
        text = f"{name}: {self.found}"
        if self.passed is False and self.mend:
            text += f"; {self.mend}"

        return text


@dataclass(frozen=True, eq=False)
class PrintedPart:
    """A solid to print.

    Attributes:
        name: of the link of the tool that it is, with its number where the tool comes in pieces.
        link: the link of the tool that it is of, by its name.
        mount: what bears it.
        solid: a Manifold in the frame of its mount.
        lying: it as a mesh on the plate.
        weld_mm: by how much its sides were moved out.
        mass_g: with walls and infill of its material; without a density it is solid PLA.
        checks: what was checked.
    """

    name: str
    link: str
    mount: str
    solid: Any
    lying: Lying
    weld_mm: float
    mass_g: float
    checks: tuple[Check, ...]

    @property
    def file(self) -> str:
        return f"{self.name}.stl"

    @property
    def mesh(self) -> trimesh.Trimesh:
        """It as it lies on the plate, centred, its lowest point at 0."""
        return self.lying.mesh

    @property
    def to_mount(self) -> Array:
        """Lead (4, 4) from the mesh to the frame of its mount, millimetres."""
        return self.lying.back


def print_part(
    name: str,
    link: ToolLink,
    solid: Any,
    weld_mm: float,
    printer: Printer,
    material: Material = PAPER,
    known: Sequence[Check] = (),
    too_large: str = "",
) -> PrintedPart:
    """Lay a solid on the plate, check it, and weigh it.

    Args:
        name: of the part.
        link: of the tool that it is of.
        solid: a Manifold in the frame of its mount, millimetres.
        weld_mm: by how much its sides were moved out.
        printer: whose plate and thinnest wall count; metal is milled, and needs no plate.
        material: what it is made of.
        known: what was checked of it already.
        too_large: what to change where it does not fit the plate.
    """
    for shortest_mm in SHORTEST_MM:
        mesh = to_mesh(solid, shortest_mm)
        lying = lay(mesh, printer.plate_mm)
        is_closed = closed(lying.mesh)
        if is_closed:
            break

    wall = thinnest(mesh) - 2 * weld_mm
    least = printer.min_wall_mm
    walls = f"thinnest {wall:.2f} mm, at least {least:g} mm"
    checks = [
        Check(
            "watertight",
            is_closed,
            "closed" if is_closed else "the surface is not closed",
            "let components overlap, or part them clearly",
            name,
        ),
        *known,
        Check("walls", wall >= least, walls, THICKEN, name),
    ]
    if not material.is_metal:
        checks += check_lying(lying, printer, name, too_large)

    metres = Mesh(np.asarray(lying.mesh.vertices) / 1000, np.asarray(lying.mesh.faces))
    density = material.density_kg_m3 or 1000 * PLA_G_PER_CM3
    mass_g = 1000 * material.volume_of(metres) * density

    return PrintedPart(
        name, link.name, link.mount, solid, lying, weld_mm, mass_g, tuple(checks)
    )


def check_lying(
    lying: Lying, printer: Printer, name: str, too_large: str
) -> list[Check]:
    """Check that a part fits the plate, and say how it stands there and what it leans out by.

    Args:
        lying: the part on the plate.
        printer: whose plate counts.
        name: of the part.
        too_large: what to change where it does not fit.
    """
    words = macros("plugins.results.workshop", "words")
    fits = words.fits(lying, printer.plate_mm)
    lies = words.lies(lying, OVERHANG_DEG)
    return [
        Check("fits the plate", lying.fits, fits, too_large or LARGER, name),
        Check("lies", True if lying.firm else None, lies, "", name),
    ]


def joined(
    names: Sequence[str], shapes: Sequence[Placed], weld_mm: float, printer: Printer
) -> Check:
    """Check that all shapes are connected by joints as wide as a wall, in two directions at least.

    Args:
        names: of the shapes.
        shapes: with their poses, metres, already moved out.
        weld_mm: by how much that was.
        printer: whose thinnest wall counts.
    """
    solids = [union([shape]) for shape in shapes]
    joints = networkx.empty_graph(len(solids))
    for a, b in itertools.combinations(range(len(solids)), 2):
        if networkx.has_path(joints, a, b):
            continue
        if _joint_width(solids[a], solids[b]) >= printer.min_wall_mm:
            joints.add_edge(a, b)

    connected = networkx.node_connected_component(joints, 0)
    loose = [name for i, name in enumerate(names) if i not in connected]
    gap_mm = weld_mm if weld_mm > WELDS_MM[0] else 0.0
    found = macros("plugins.results.workshop", "words").pieces(
        len(solids), loose, gap_mm
    )
    return Check("one piece", not loose, found, OVERLAP if loose else "")


def _joint_width(solid: Any, other: Any) -> float:
    """Measure what two solids share across its second longest side, mm; -inf: they share nothing."""
    shared = solid ^ other
    if shared.is_empty():
        return -math.inf

    return float(sorted(to_mesh(shared).bounding_box_oriented.extents)[1])


def thinnest(mesh: trimesh.Trimesh) -> float:
    """Measure the thinnest wall: from points of the surface straight in, to where the ray leaves the body.

    Args:
        mesh: closed, millimetres.

    Returns:
        The least thickness that a surface of `_SPOT_MM2` has, millimetres.
    """
    areas = np.asarray(mesh.area_faces)
    sound = np.flatnonzero(areas > _SLIVER_MM2)
    points, faces = trimesh.sample.sample_surface(mesh, _SAMPLES, seed=0)
    kept = areas[faces] > _SLIVER_MM2
    points = np.vstack([points[kept], mesh.triangles_center[sound]])
    inward = -np.asarray(mesh.face_normals)[np.concatenate([faces[kept], sound])]

    share = float(areas.sum()) / _SAMPLES
    sampled = np.full(int(kept.sum()), share)
    stands_for = np.concatenate([sampled, np.minimum(areas[sound], share)])  # mm²

    solid = manifold(mesh)
    found = np.array(
        [
            _measure_wall(solid, start, direction, mesh.scale)
            for start, direction in zip(points, inward, strict=True)
        ]
    )
    order = np.argsort(found)
    spot = min(_SPOT_MM2, stands_for.sum())
    decides = np.searchsorted(np.cumsum(stands_for[order]), spot)

    return float(found[order][decides])


def _measure_wall(solid: Any, start: Array, direction: Array, length: float) -> float:
    """Measure how far it is from a point of a surface to the other side of a wall.

    Args:
        solid: a Manifold, millimetres.
        start: the point (3,).
        direction: straight in, a unit vector (3,).
        length: of the ray, more than the solid's size.

    Returns:
        Millimetres; inf where two faces meet at an edge, and are no wall.
    """
    for hit in solid.ray_cast(start, start + length * direction):
        thickness = float((np.asarray(hit.position) - start) @ direction)
        facing = float(np.dot(hit.normal, direction))
        if thickness > _SKIN_MM and facing > 1e-6:
            return thickness if facing > _WALL else math.inf

    return math.inf


def to_stl(part: PrintedPart) -> bytes:
    """Return a part as an STL file."""
    return bytes(part.mesh.export(file_type="stl"))


def grams(parts: Sequence[PrintedPart]) -> float:
    """Return the mass of parts together."""
    return math.fsum(part.mass_g for part in parts)
