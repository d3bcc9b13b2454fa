"""Tools as solids that a printer can make: one closed body per mount, laid on the plate, and what speaks against it.

Lengths are millimetres, as slicers expect.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from core.design import GRIPPER_MOUNTS, Component, Tool
from core.errors import UsageError, check_positive
from core.geometry import Array, Box
from core.report.tools import solids

if TYPE_CHECKING:
    import trimesh

NAMES = {GRIPPER_MOUNTS[0]: "left", GRIPPER_MOUNTS[1]: "right"}  # of the pieces; a rigid tool is one, "tool"
PLA_G_PER_CM3 = 1.24  # density of polylactide, data sheets of filaments

# How much each side of a part is moved out so that parts which touch, or nearly do, become one body. A design may have
# gaps of up to 1 mm (`core.designs.rules`), hence 0.5 mm at most; of these the least that does it.
WELDS_MM = (0.01, 0.05, 0.1, 0.25, 0.5)

_SAMPLES = 3000  # points at which walls are measured
_SKIN_MM = 1e-4  # nearer than this is where the ray began
_SLIVER_MM2 = 1e-3
_FLAT = 0.999  # cosine up to which two faces lie in one plane
_SIDES = 24  # on which a piece is tried to be laid, the largest first


@dataclass(frozen=True)
class Printer:
    """What is printed on. The defaults are a Prusa MK4's: its build volume (x, y, z), and two lines of a 0.4 mm nozzle.

    Raises:
        UsageError: a length that is not positive, or not three of them.
    """

    plate_mm: tuple[float, float, float] = (250.0, 210.0, 220.0)
    min_wall_mm: float = 0.8

    def __post_init__(self) -> None:
        if len(self.plate_mm) != 3:
            raise UsageError(f"plate_mm must be three lengths (x, y, z), got {list(self.plate_mm)}")
        check_positive("plate_mm.", **dict(zip("xyz", self.plate_mm, strict=True)))
        check_positive("", min_wall_mm=self.min_wall_mm)


@dataclass(frozen=True)
class Check:
    """``name`` of what was looked at, whether it is well, and what was found."""

    name: str
    passed: bool
    found: str


@dataclass(frozen=True, eq=False)
class Piece:
    """One body to print: ``mesh`` in millimetres, as it lies on the plate, centred, its lowest point at 0."""

    name: str
    mesh: trimesh.Trimesh
    checks: tuple[Check, ...]

    @property
    def ready(self) -> bool:
        return all(check.passed for check in self.checks)

    @property
    def volume_cm3(self) -> float:
        return float(self.mesh.volume) / 1000


def pieces(tool: Tool, printer: Printer) -> list[Piece]:
    """The bodies of a tool, one per mount; none for the bare hand."""
    made = []
    for mount, parts in solids(tool).items():
        mesh, weld = fused([component for component, _ in parts], tool)
        joined, joint = _joined([component for component, _ in parts], tool, weld, printer)
        lying, fits = lay(mesh, printer.plate_mm)
        wall = thinnest(mesh) - 2 * weld
        size = " × ".join(f"{side:.0f}" for side in lying.extents)
        plate = " × ".join(f"{side:g}" for side in printer.plate_mm)
        checks = (
            Check("watertight", bool(mesh.is_volume), "closed" if mesh.is_volume else "the surface is not closed"),
            Check("one piece", joined, joint),
            Check("walls", wall >= printer.min_wall_mm, f"thinnest {wall:.2f} mm, at least {printer.min_wall_mm:g} mm"),
            Check("fits the plate", fits, f"{size} mm as it lies, the plate is {plate} mm"),
        )
        made.append(Piece(NAMES.get(mount, "tool"), lying, checks))
    return made


def fused(components: Sequence[Component], tool: Tool) -> tuple[trimesh.Trimesh, float]:
    """The union of components of one mount, and by how much each was grown for it to be one body (`WELDS_MM`)."""
    import trimesh.boolean

    mesh, weld = None, WELDS_MM[0]
    for weld in WELDS_MM:
        mesh = trimesh.boolean.union(_grown(components, tool, weld), engine="manifold")
        if mesh.body_count == 1:
            break
    assert mesh is not None
    return mesh, weld


def _grown(components: Sequence[Component], tool: Tool, by: float) -> list[trimesh.Trimesh]:
    """Solids in millimetres, in their mount's frame, each side moved out."""
    placed = tool.placed()
    grown = []
    for component in components:
        x, y, z = (1000 * side + 2 * by for side in component.shape.size)
        matrix = placed[component.name][1].matrix
        matrix[:3, 3] *= 1000
        grown.append(Box((x, y, z)).to_trimesh().apply_transform(matrix))
    return grown


def _joined(components: Sequence[Component], tool: Tool, weld: float, printer: Printer) -> tuple[bool, str]:
    """Whether the parts hang together by joints that are as wide as a wall, in two directions at least."""
    import trimesh.boolean

    grown = _grown(components, tool, weld)
    group = list(range(len(grown)))
    for a, b in itertools.combinations(range(len(grown)), 2):
        low, high = (
            np.maximum(grown[a].bounds[0], grown[b].bounds[0]),
            np.minimum(grown[a].bounds[1], grown[b].bounds[1]),
        )
        if group[a] == group[b] or (low > high).any():
            continue
        shared = trimesh.boolean.intersection([grown[a], grown[b]], engine="manifold")
        if shared.is_empty or sorted(shared.bounding_box_oriented.extents)[1] < printer.min_wall_mm:
            continue
        group = [group[a] if of == group[b] else of for of in group]
    closed = f", gaps closed by {weld:g} mm on each side" if weld > WELDS_MM[0] else ""
    if len(set(group)) == 1:
        return True, f"{len(grown)} part{'s' if len(grown) > 1 else ''}{closed}"
    loose = [component.name for component, of in zip(components, group, strict=True) if of != group[0]]
    return False, f"held by a joint thinner than a wall, or by none: {', '.join(loose[:3])}{closed}"


def thinnest(mesh: trimesh.Trimesh) -> float:
    """The least thickness of a wall: from points of the surface straight in, to where the other side is."""
    import trimesh.sample

    sound = np.flatnonzero(mesh.area_faces > _SLIVER_MM2)  # the others have no direction to speak of
    points, faces = trimesh.sample.sample_surface(mesh, _SAMPLES, seed=0)
    points, faces = points[mesh.area_faces[faces] > _SLIVER_MM2], faces[mesh.area_faces[faces] > _SLIVER_MM2]
    points, faces = np.vstack([points, mesh.triangles_center[sound]]), np.concatenate([faces, sound])
    normals = np.asarray(mesh.face_normals)
    return float(_to_the_other_side(points, -normals[faces], np.asarray(mesh.triangles)[sound], normals[sound]).min())


def _to_the_other_side(origins: Array, directions: Array, triangles: Array, normals: Array) -> Array:
    """Along each ray (N, 3) to the first of the triangles (F, 3, 3) where it leaves: lengths (N,), inf where there is
    none.

    T. Moeller and B. Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", Journal of Graphics Tools, 1997.
    """
    corner, first, second = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    lengths = np.full(len(origins), np.inf)
    for start in range(0, len(origins), 256):  # some tens of megabytes at a time
        o, d = origins[start : start + 256, None], directions[start : start + 256, None]
        p = np.cross(d, second[None])
        t = o - corner
        q = np.cross(t, first[None])
        with np.errstate(divide="ignore", invalid="ignore"):
            determinant = (first * p).sum(axis=-1)
            u, v = (t * p).sum(axis=-1) / determinant, (d * q).sum(axis=-1) / determinant
            along = (second * q).sum(axis=-1) / determinant
            hit = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9) & (along > _SKIN_MM)
        hit &= (d * normals).sum(axis=-1) > 1e-6
        lengths[start : start + 256] = np.where(hit, along, np.inf).min(axis=1)
    return lengths


def lay(mesh: trimesh.Trimesh, plate: Sequence[float]) -> tuple[trimesh.Trimesh, bool]:
    """The mesh laid on one of its sides, turned so that it fits the plate: of the ways that fit the one that touches
    the plate most; failing that, the one that exceeds it least. And whether it fits.
    """
    import trimesh

    hull = mesh.convex_hull
    by_area = sorted(range(len(hull.facets)), key=lambda i: -hull.facets_area[i])[:_SIDES]
    downs = [hull.facets_normal[i] for i in by_area] or [np.array([0.0, 0.0, -1.0])]
    best: tuple[tuple[bool, float, float], Array] | None = None
    for down in downs:
        turned = trimesh.geometry.align_vectors(down, [0.0, 0.0, -1.0])
        corners = hull.vertices @ turned[:3, :3].T
        angle, excess = _turn(corners, plate)
        touching = float(mesh.area_faces[np.asarray(mesh.face_normals) @ down > _FLAT].sum())
        rank = (excess > 0, max(excess, 0.0), -touching)
        if best is None or rank < best[0]:
            best = rank, trimesh.transformations.rotation_matrix(angle, [0, 0, 1]) @ turned
    assert best is not None
    lying = mesh.copy().apply_transform(best[1])
    low, high = lying.bounds
    lying.apply_translation([-(low[0] + high[0]) / 2, -(low[1] + high[1]) / 2, -low[2]])
    return lying, not best[0][0]


def _turn(corners: Array, plate: Sequence[float]) -> tuple[float, float]:
    """The angle about z, in whole degrees, at which points (N, 3) exceed the plate least, and by how many mm."""
    angles = np.deg2rad(np.arange(180))
    x = np.outer(np.cos(angles), corners[:, 0]) - np.outer(np.sin(angles), corners[:, 1])
    y = np.outer(np.sin(angles), corners[:, 0]) + np.outer(np.cos(angles), corners[:, 1])
    excess = np.maximum(np.ptp(x, axis=1) - plate[0], np.ptp(y, axis=1) - plate[1])
    excess = np.maximum(excess, np.ptp(corners[:, 2]) - plate[2])
    fitting = np.flatnonzero(excess <= 0)
    chosen = int(fitting[0]) if len(fitting) else int(np.argmin(excess))
    return float(angles[chosen]), float(excess[chosen])


def to_3mf(made: Sequence[Piece]) -> bytes:
    """All pieces as one 3MF file, side by side."""
    import trimesh

    scene = trimesh.Scene()
    at = 0.0
    for piece in made:
        width = float(piece.mesh.extents[0])
        scene.add_geometry(
            piece.mesh,
            geom_name=piece.name,
            node_name=piece.name,
            transform=trimesh.transformations.translation_matrix([at + width / 2, 0, 0]),
        )
        at += width + 10
    data = scene.export(file_type="3mf")
    assert isinstance(data, bytes)
    return data


def grams(made: Sequence[Piece]) -> float:
    """What the pieces weigh, printed solid in PLA."""
    return PLA_G_PER_CM3 * math.fsum(piece.volume_cm3 for piece in made)
