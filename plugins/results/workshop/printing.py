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
from scipy.spatial.transform import Rotation

from core.geometry import Array, Mesh
from core.values.materials import PAPER, Material
from plugins.results.workshop.settings import Printer
from plugins.results.workshop.solid import (
    WELDS_MM,
    Placed,
    closed,
    manifold,
    to_mesh,
    union,
)

PLA_G_PER_CM3 = 1.24  # density of polylactide, data sheets of filaments
METAL_KG_M3 = 2000.0  # metals are denser, plastics are not

OVERLAP = "let components overlap by more than a wall"
THICKEN = "thicken the thinnest component"

_SAMPLES = 3000  # points at which walls are measured
_SKIN_MM = 1e-4  # a hit nearer than this is the face where the ray began
_SLIVER_MM2 = 1e-3  # smaller faces have no reliable direction
_SPOT_MM2 = 5.0  # of a surface that decides how thin a wall is; less of it is an edge
_WALL = 0.96  # cosine up to which two faces make a wall; beyond it they meet at an edge
_FLAT = 0.999  # cosine up to which two faces lie in one plane
_SIDES = 24  # on which a piece may be laid; the largest are tried first


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


class Lying(NamedTuple):
    """A mesh as it lies on the plate.

    Attributes:
        mesh: its lowest point is at 0.
        fits: whether the plate holds it.
        back: (4, 4), takes it back to where it came from.
    """

    mesh: trimesh.Trimesh
    fits: bool
    back: Array


@dataclass(frozen=True, eq=False)
class PrintedPart:
    """A solid to print.

    Attributes:
        name: of the link of the tool that it is.
        solid: a Manifold in the frame of its mount.
        mesh: as it lies on the plate, centred, its lowest point at 0.
        to_mount: (4, 4) from the mesh to the frame of its mount, millimetres.
        weld_mm: by how much its sides were moved out.
        mass_g: with walls and infill of its material; without a density it is solid PLA.
        checks: what was checked.
    """

    name: str
    solid: Any
    mesh: trimesh.Trimesh
    to_mount: Array
    weld_mm: float
    mass_g: float
    checks: tuple[Check, ...]

    @property
    def file(self) -> str:
        return f"{self.name}.stl"


def print_part(
    name: str,
    solid: Any,
    weld_mm: float,
    one_piece: Check,
    printer: Printer,
    material: Material = PAPER,
) -> PrintedPart:
    """Lay a solid on the plate, check it, and weigh it.

    Args:
        name: of the tool's link that it is.
        solid: a Manifold in the frame of its mount, millimetres.
        weld_mm: by how much its sides were moved out.
        one_piece: the check that it is in one piece.
        printer: whose plate and thinnest wall count; metal is milled, and needs no plate.
        material: what it is made of.
    """
    mesh = to_mesh(solid)
    lying = lay(mesh, printer.plate_mm)
    is_closed = closed(lying.mesh)
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
        one_piece._replace(part=name),
        Check("walls", wall >= least, walls, THICKEN, name),
    ]
    if not is_metal(material):
        size = " × ".join(f"{side:.0f}" for side in lying.mesh.extents)
        room = " × ".join(f"{side:g}" for side in printer.plate_mm)
        found = f"{size} mm as it lies, the plate is {room} mm"
        mend = "shorten it, choose a larger printer, or cut and join it in the slicer"
        checks.append(Check("fits the plate", lying.fits, found, mend, name))

    metres = Mesh(np.asarray(lying.mesh.vertices) / 1000, np.asarray(lying.mesh.faces))
    density = material.density_kg_m3 or 1000 * PLA_G_PER_CM3
    mass_g = 1000 * material.volume_of(metres) * density

    return PrintedPart(
        name, solid, lying.mesh, lying.back, weld_mm, mass_g, tuple(checks)
    )


def is_metal(material: Material) -> bool:
    """Say whether parts of a material are milled, and not printed."""
    return (material.density_kg_m3 or 0.0) >= METAL_KG_M3


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

    gaps = ""
    if weld_mm > WELDS_MM[0]:
        gaps = f", gaps closed by {weld_mm:g} mm on each side"

    connected = networkx.node_connected_component(joints, 0)
    loose = [name for i, name in enumerate(names) if i not in connected]
    if loose:
        thin = "held by a joint thinner than a wall, or by none"
        found = f"{thin}: {', '.join(loose[:3])}{gaps}"
        return Check("one piece", False, found, OVERLAP)

    plural = "s" if len(solids) > 1 else ""

    return Check("one piece", True, f"{len(solids)} component{plural}{gaps}")


def _joint_width(solid: Any, other: Any) -> float:
    """Measure what two solids share across its second longest side, mm; -inf: they share nothing."""
    low, high = np.reshape(solid.bounding_box(), (2, 3))
    other_low, other_high = np.reshape(other.bounding_box(), (2, 3))
    if (np.maximum(low, other_low) > np.minimum(high, other_high)).any():
        return -math.inf

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


def lay(mesh: trimesh.Trimesh, plate: Sequence[float]) -> Lying:
    """Lay a mesh on one of its sides and turn it so that it fits the plate.

    Of the ways that fit it is the one that touches the plate most, else the one that exceeds it least.

    Args:
        mesh: closed, millimetres.
        plate: the printer's build volume (x, y, z), millimetres.
    """
    hull = mesh.convex_hull
    by_area = np.argsort(-hull.facets_area, kind="stable")[:_SIDES]
    sides = [hull.facets_normal[i] for i in by_area] or [np.array([0.0, 0.0, -1.0])]
    ways = []
    for down in sides:
        turned = trimesh.geometry.align_vectors(down, [0.0, 0.0, -1.0])
        angle, excess = _turn(hull.vertices @ turned[:3, :3].T, plate)
        matrix = trimesh.transformations.rotation_matrix(angle, [0, 0, 1]) @ turned
        looks_down = np.asarray(mesh.face_normals) @ down > _FLAT
        touching = float(mesh.area_faces[looks_down].sum())
        ways.append((max(excess, 0.0), -touching, matrix))

    excess, _, matrix = min(ways, key=lambda way: way[:2])

    lying = mesh.copy().apply_transform(matrix)
    low, high = lying.bounds
    to_middle = [*(-(low + high)[:2] / 2), -low[2]]
    moved = trimesh.transformations.translation_matrix(to_middle)
    back = np.linalg.inv(moved @ matrix)

    return Lying(lying.apply_transform(moved), excess == 0, back)


def _turn(corners: Array, plate: Sequence[float]) -> tuple[float, float]:
    """Find the angle about z at which points exceed the plate least, in whole degrees; the first that fits, if any.

    Args:
        corners: points (N, 3), millimetres.
        plate: the build volume (x, y, z), millimetres.

    Returns:
        The angle, radians, and by how much they exceed the plate, millimetres.
    """
    angles = np.deg2rad(np.arange(180))
    turns = Rotation.from_rotvec(np.outer(angles, [0.0, 0.0, 1.0])).as_matrix()
    sides = np.ptp(corners @ turns.transpose(0, 2, 1), axis=1)
    excess = (sides - plate).max(axis=1)
    chosen = int(np.argmin(np.maximum(excess, 0.0)))  # the first that fits, if any

    return float(angles[chosen]), float(excess[chosen])


def to_stl(part: PrintedPart) -> bytes:
    """Return a part as an STL file."""
    return bytes(part.mesh.export(file_type="stl"))


def grams(parts: Sequence[PrintedPart]) -> float:
    """Return the mass of parts together."""
    return math.fsum(part.mass_g for part in parts)
