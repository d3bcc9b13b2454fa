"""Tools as solids that a printer can make: one closed body for each mount and each joint, laid on the plate.

What speaks against printing it is said. Lengths are millimetres, as slicers expect.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from core.config.settings import Printer
from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Component, Tool
from core.geometry import Array, Compound, Mesh, Pose, Shape
from core.solids.held import solids
from core.values.materials import Material
from core.values.shapes import resized

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

LAYER_S = 4.0  # for each layer, besides the plastic: a guess
FILAMENT_MM = 1.75
_STEEP = math.sqrt(0.5)  # a face that looks down by more than 45 degrees overhangs

_SAMPLES = 3000  # points at which walls are measured
_SKIN_MM = 1e-4  # a hit nearer than this is the face where the ray began
_SLIVER_MM2 = 1e-3  # smaller faces have no reliable direction
_SPOT_MM2 = 5.0  # a surface of this size decides how thin a wall is; less of it is an edge
_WALL = 0.96  # cosine up to which two faces make a wall; beyond it they meet at an edge
_FLAT = 0.999  # cosine up to which two faces lie in one plane
_SIDES = 24  # on which a piece may be laid; the largest are tried first


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
        found.append(checked(piece_name(bearer), mesh, printer, weld, joined(components, tool, weld, printer)))
    return found


def piece_name(bearer: str) -> str:
    """Name a piece by what bears it."""
    return "tool" if bearer == RIGID_MOUNT else NAMES.get(bearer, bearer)


def checked(name: str, mesh: trimesh.Trimesh, printer: Printer, weld: float, *checks: Check) -> Piece:
    """Lay a solid, in millimetres, on the plate, and check it; ``weld``: by how much its sides were moved out."""
    lying, fits = lay(mesh, printer.plate_mm)
    wall = thinnest(mesh) - 2 * weld
    size = " × ".join(f"{side:.0f}" for side in lying.extents)
    plate = " × ".join(f"{side:g}" for side in printer.plate_mm)
    closed = Check("watertight", bool(mesh.is_volume), "closed" if mesh.is_volume else "the surface is not closed")
    walls = f"thinnest {wall:.2f} mm, at least {printer.min_wall_mm:g} mm"
    return Piece(
        name,
        lying,
        (
            closed,
            *checks,
            Check("walls", wall >= printer.min_wall_mm, walls),
            Check("fits the plate", fits, f"{size} mm as it lies, the plate is {plate} mm"),
        ),
    )


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


def grown(components: Sequence[Component], tool: Tool, by: float) -> list[tuple[Shape | Compound, Pose]]:
    """Shapes and their poses in their mount's frame, in metres, each side moved out by millimetres."""
    placed = tool.placed()
    return [(_moved_out(c.shape, by), placed[c.name][1]) for c in components]


def _moved_out(shape: Shape | Compound, by: float) -> Shape | Compound:
    if isinstance(shape, Compound) and by <= WELDS_MM[0]:
        return shape  # the inner walls of what is hollow would move with the outer ones
    return resized(shape, shape.bounds[1] + 0.002 * by)


def _grown(components: Sequence[Component], tool: Tool, by: float) -> list[trimesh.Trimesh]:
    """Solids in millimetres, in their mount's frame, each side moved out."""
    placed = grown(components, tool, by)
    return [shape.to_trimesh().apply_transform(pose.matrix).apply_scale(1000.0) for shape, pose in placed]


def joined(components: Sequence[Component], tool: Tool, weld: float, printer: Printer) -> Check:
    """Check that all components are connected by joints as wide as a wall, in two directions at least."""
    import networkx
    import trimesh.boolean

    solid = _grown(components, tool, weld)
    joints = networkx.empty_graph(len(solid))
    for a, b in itertools.combinations(range(len(solid)), 2):
        (low_a, high_a), (low_b, high_b) = solid[a].bounds, solid[b].bounds
        if (np.maximum(low_a, low_b) > np.minimum(high_a, high_b)).any() or networkx.has_path(joints, a, b):
            continue
        shared = trimesh.boolean.intersection([solid[a], solid[b]], engine="manifold")
        if not shared.is_empty and sorted(shared.bounding_box_oriented.extents)[1] >= printer.min_wall_mm:
            joints.add_edge(a, b)
    closed = f", gaps closed by {weld:g} mm on each side" if weld > WELDS_MM[0] else ""
    loose = [components[i].name for i in range(len(solid)) if not networkx.has_path(joints, 0, i)]
    if not loose:
        return Check("one piece", True, f"{len(solid)} component{'s' if len(solid) > 1 else ''}{closed}")
    thin = f"held by a joint thinner than a wall, or by none: {', '.join(loose[:3])}{closed}"
    return Check("one piece", False, thin)


def manifold(mesh: trimesh.Trimesh) -> Any:
    """Return a closed mesh as a Manifold."""
    import manifold3d

    corners, faces = np.array(mesh.vertices, np.float64, order="C"), np.array(mesh.faces, np.uint64, order="C")
    return manifold3d.Manifold(manifold3d.Mesh64(corners, faces))


def thinnest(mesh: trimesh.Trimesh) -> float:
    """The least thickness of a wall: from points of the surface straight in, to where the ray leaves the body."""
    import trimesh.sample

    areas, normals = np.asarray(mesh.area_faces), np.asarray(mesh.face_normals)
    sound = np.flatnonzero(areas > _SLIVER_MM2)
    points, faces = trimesh.sample.sample_surface(mesh, _SAMPLES, seed=0)
    kept = areas[faces] > _SLIVER_MM2
    share = float(areas.sum()) / _SAMPLES
    stands_for = np.concatenate([np.full(int(kept.sum()), share), np.minimum(areas[sound], share)])  # mm^2
    points = np.vstack([points[kept], mesh.triangles_center[sound]])
    inward = -normals[np.concatenate([faces[kept], sound])]
    solid = manifold(mesh)
    found = np.full(len(points), np.inf)
    for number, (start, direction) in enumerate(zip(points, inward, strict=True)):
        for hit in solid.ray_cast(start, start + mesh.scale * direction):
            length = float((np.asarray(hit.position) - start) @ direction)
            facing = float(np.dot(hit.normal, direction))
            if length > _SKIN_MM and facing > 1e-6:
                found[number] = length if facing > _WALL else np.inf
                break
    order = np.argsort(found)
    return float(found[order][np.searchsorted(np.cumsum(stands_for[order]), min(_SPOT_MM2, stands_for.sum()))])


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


def estimate(piece: Piece, material: Material, printer: Printer) -> dict[str, float]:
    """Estimate how a piece prints as it lies: mass_g, hours, filament_m, and overhang_share of its surface.

    It has the material's walls and infill; without a density it is solid PLA. The hours are roughly those of the
    plastic at `Printer.flow_mm3_s`, and `LAYER_S` for each layer, without supports.
    """
    mesh = piece.mesh
    plastic = 1e9 * material.volume_of(Mesh(np.asarray(mesh.vertices) / 1000, np.asarray(mesh.faces)))  # mm^3
    layers = math.ceil(float(mesh.extents[2]) / printer.layer_mm)
    hangs = np.asarray(mesh.face_normals)[:, 2] < -_STEEP
    hangs &= np.asarray(mesh.triangles)[:, :, 2].max(axis=1) > _SKIN_MM
    return {
        "mass_g": plastic * (material.density_kg_m3 or 1000 * PLA_G_PER_CM3) * 1e-6,
        "hours": (plastic / printer.flow_mm3_s + LAYER_S * layers) / 3600,
        "filament_m": plastic / (math.pi / 4 * FILAMENT_MM**2) / 1000,
        "overhang_share": float(mesh.area_faces[hangs].sum() / mesh.area),
    }


def grams(pieces: Sequence[Piece]) -> float:
    """The mass of the pieces, printed solid in PLA."""
    return PLA_G_PER_CM3 * math.fsum(piece.volume_cm3 for piece in pieces)
