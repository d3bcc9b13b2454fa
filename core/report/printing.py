"""Tools as solids that a printer can make: one closed body for each mount and each joint, laid on the plate.

What speaks against printing it is said. Lengths are millimetres, as slicers expect.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Component, Tool
from core.errors import UsageError, check_positive
from core.geometry import Array
from core.report.tools import solids
from core.shapes import resized

if TYPE_CHECKING:
    import trimesh

NAMES = {
    GRIPPER_MOUNTS[0]: "left",
    GRIPPER_MOUNTS[1]: "right",
}  # of the pieces; others are "tool", and joints'
PLA_G_PER_CM3 = 1.24  # density of polylactide, data sheets of filaments

# By how much each side of a component is moved out, so that components that touch, or nearly do, become one body: the
# least that does it. A design may have gaps of up to 1 mm (`core.designs.rules`), so that 0.5 mm is enough.
WELDS_MM = (0.01, 0.05, 0.1, 0.25, 0.5)

_SAMPLES = 3000  # points at which walls are measured
_SKIN_MM = 1e-4  # a hit nearer than this is the face where the ray began
_SLIVER_MM2 = 1e-3  # smaller faces have no reliable direction
_FLAT = 0.999  # cosine up to which two faces lie in one plane
_SIDES = 24  # on which a piece may be laid; the largest are tried first


@dataclass(frozen=True)
class Printer:
    """A printer. The defaults are a Prusa MK4's: its build volume (x, y, z), and two lines of a 0.4 mm nozzle.

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
    """A check of a piece: its name, whether it passed, and what was found."""

    name: str
    passed: bool
    found: str


@dataclass(frozen=True, eq=False)
class Piece:
    """A body to print: ``mesh`` in millimetres, as it lies on the plate, centred, its lowest point at 0."""

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
    """The bodies of a tool, one for each mount and for what each joint moves; none for the bare hand."""
    found = []
    for bearer, placed in solids(tool, loose=True).items():
        components = [component for component, _ in placed]
        mesh, weld = fused(components, tool)
        joined, joint = _joined(components, tool, weld, printer)
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
        name = "tool" if bearer == RIGID_MOUNT else NAMES.get(bearer, bearer)
        found.append(Piece(name, lying, checks))
    return found


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
        grown_by = resized(component.shape, component.shape.bounds[1] + 0.002 * by).to_trimesh().apply_scale(1000.0)
        matrix = placed[component.name][1].matrix
        matrix[:3, 3] *= 1000
        grown.append(grown_by.apply_transform(matrix))
    return grown


def _joined(components: Sequence[Component], tool: Tool, weld: float, printer: Printer) -> tuple[bool, str]:
    """Check that all components are connected by joints as wide as a wall, in two directions at least."""
    import networkx
    import trimesh.boolean

    grown = _grown(components, tool, weld)
    joints = networkx.empty_graph(len(grown))
    for a, b in itertools.combinations(range(len(grown)), 2):
        (low_a, high_a), (low_b, high_b) = grown[a].bounds, grown[b].bounds
        if (np.maximum(low_a, low_b) > np.minimum(high_a, high_b)).any() or networkx.has_path(joints, a, b):
            continue
        shared = trimesh.boolean.intersection([grown[a], grown[b]], engine="manifold")
        if not shared.is_empty and sorted(shared.bounding_box_oriented.extents)[1] >= printer.min_wall_mm:
            joints.add_edge(a, b)
    closed = f", gaps closed by {weld:g} mm on each side" if weld > WELDS_MM[0] else ""
    loose = [components[i].name for i in range(len(grown)) if not networkx.has_path(joints, 0, i)]
    if not loose:
        return True, f"{len(grown)} component{'s' if len(grown) > 1 else ''}{closed}"
    return False, f"held by a joint thinner than a wall, or by none: {', '.join(loose[:3])}{closed}"


def thinnest(mesh: trimesh.Trimesh) -> float:
    """The least thickness of a wall: from points of the surface straight in, to where the ray leaves the body."""
    import manifold3d
    import trimesh.sample

    areas, normals = np.asarray(mesh.area_faces), np.asarray(mesh.face_normals)
    sound = np.flatnonzero(areas > _SLIVER_MM2)
    points, faces = trimesh.sample.sample_surface(mesh, _SAMPLES, seed=0)
    kept = areas[faces] > _SLIVER_MM2
    points = np.vstack([points[kept], mesh.triangles_center[sound]])
    inward = -normals[np.concatenate([faces[kept], sound])]
    solid = manifold3d.Manifold(
        manifold3d.Mesh64(np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.uint64))
    )
    least = math.inf
    for start, direction in zip(points, inward, strict=True):
        for hit in solid.ray_cast(start, start + mesh.scale * direction):
            length = float((np.asarray(hit.position) - start) @ direction)
            if length > _SKIN_MM and np.dot(hit.normal, direction) > 1e-6:
                least = min(least, length)
                break
    return least


def lay(mesh: trimesh.Trimesh, plate: Sequence[float]) -> tuple[trimesh.Trimesh, bool]:
    """Lay a mesh on one of its sides and turn it so that it fits the plate; of the ways that fit, the one that touches
    the plate most, else the one that exceeds it least.

    Returns:
        The mesh as it lies, and whether it fits.
    """
    import trimesh

    hull = mesh.convex_hull
    by_area = np.argsort(-hull.facets_area, kind="stable")[:_SIDES]
    ways: list[tuple[tuple[bool, float, float], Array]] = []
    for down in [hull.facets_normal[i] for i in by_area] or [np.array([0.0, 0.0, -1.0])]:
        turned = trimesh.geometry.align_vectors(down, [0.0, 0.0, -1.0])
        angle, excess = _turn(hull.vertices @ turned[:3, :3].T, plate)
        touching = float(mesh.area_faces[np.asarray(mesh.face_normals) @ down > _FLAT].sum())
        matrix = trimesh.transformations.rotation_matrix(angle, [0, 0, 1]) @ turned
        ways.append(((excess > 0, max(excess, 0.0), -touching), matrix))
    (exceeds, *_), matrix = min(ways, key=lambda way: way[0])
    lying = mesh.copy().apply_transform(matrix)
    low, high = lying.bounds
    lying.apply_translation([-(low[0] + high[0]) / 2, -(low[1] + high[1]) / 2, -low[2]])
    return lying, not exceeds


def _turn(corners: Array, plate: Sequence[float]) -> tuple[float, float]:
    """The angle about z, in whole degrees, at which points (N, 3) exceed the plate least, and by how many mm."""
    angles = np.deg2rad(np.arange(180))
    x = np.outer(np.cos(angles), corners[:, 0]) - np.outer(np.sin(angles), corners[:, 1])
    y = np.outer(np.sin(angles), corners[:, 0]) + np.outer(np.cos(angles), corners[:, 1])
    excess = np.maximum(np.ptp(x, axis=1) - plate[0], np.ptp(y, axis=1) - plate[1])
    excess = np.maximum(excess, np.ptp(corners[:, 2]) - plate[2])
    chosen = int(np.argmin(np.maximum(excess, 0.0)))  # the first that fits, if any
    return float(angles[chosen]), float(excess[chosen])


def to_3mf(pieces: Sequence[Piece]) -> bytes:
    """All pieces as one 3MF file, side by side."""
    import trimesh

    scene = trimesh.Scene()
    at = 0.0
    for piece in pieces:
        width = float(piece.mesh.extents[0])
        place = trimesh.transformations.translation_matrix([at + width / 2, 0, 0])
        scene.add_geometry(piece.mesh, geom_name=piece.name, node_name=piece.name, transform=place)
        at += width + 10
    data = scene.export(file_type="3mf")
    assert isinstance(data, bytes)
    return data


def grams(pieces: Sequence[Piece]) -> float:
    """The mass of the pieces, printed solid in PLA."""
    return PLA_G_PER_CM3 * math.fsum(piece.volume_cm3 for piece in pieces)
