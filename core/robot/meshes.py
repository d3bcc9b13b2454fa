"""Turn mesh files of the usual kinds into what every engine reads alike, and read what a robot looks like.

What is made is kept in the user's cache folder. A file is named by the content that it was made from, so that equal
meshes share one, and engines that load files by name never mix two up.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import platformdirs
import trimesh
from scipy.spatial import ConvexHull, QhullError

from core.design import Tool
from core.errors import UserError
from core.geometry import Array, Color, Mesh, Pose, Shape
from core.robot.description import assembled
from core.support.files import write_whole
from core.values.descriptions import ONE, RobotShape, Scale
from core.values.robots import Robot

KINDS = (".stl", ".obj", ".dae", ".ply")
MAX_MB = 64
# PhysX takes at most 255 faces, and cuts larger hulls its own way; a hull of V corners has up to 2 V - 4.
MAX_CORNERS = 128
MAX_DRAWN = 100_000  # triangles
_MANY = 8_000  # corners of a hull: of more, only those farthest in many directions are looked at
_LARGEST_M = 10.0  # a link's mesh that is larger was drawn in millimetres
_VERSION = 1  # of what is written
_GREY: Color = (0.8, 0.8, 0.8, 1.0)  # of shapes without a material


class Visual(NamedTuple):
    """A shape in one colour, and its pose in the frame of its link."""

    shape: Shape
    pose: Pose
    color: Color


def hull_file(mesh: Path, scale: Scale = ONE) -> Path:
    """Write the convex hull of a mesh as a binary STL file in metres, or find it as it was written before.

    Of a hull with more than `MAX_CORNERS` corners those stay that stick out the most. The unit that a Collada file
    names counts, its upward axis does not, as in RViz.

    Args:
        mesh: an STL, OBJ, Collada or PLY file.
        scale: multiplies x, y and z.

    Raises:
        UserError: the mesh can't be read, is too large or flat, or its hull can't be written.
    """
    key = f"{mesh.suffix.lower()} {tuple(map(float, scale))}"
    return kept("hulls", "stl", key.encode() + _content(mesh), lambda: _hull(_load(mesh, scale), mesh))


def visual_file(mesh: Path, color: Color, scale: Scale = ONE) -> Path:
    """Write what is drawn of a mesh as a Collada file in metres, z up, or find it as it was written before.

    It keeps its own colours, one for each of its parts. Corners of a mesh with more than `MAX_DRAWN` triangles are
    merged where they are close.

    Args:
        mesh: an STL, OBJ, Collada or PLY file.
        color: of parts that have none, red, green, blue and opacity, 0..1.
        scale: multiplies x, y and z.

    Raises:
        UserError: the mesh can't be read or is too large, or the file can't be written.
    """
    key = f"{mesh.suffix.lower()} {tuple(map(float, scale))} {color}"
    return kept("visuals", "dae", key.encode() + _content(mesh), lambda: _collada(_load(mesh, scale), color))


def _content(mesh: Path) -> bytes:
    """Read a file's bytes.

    Raises:
        UserError: it is missing, of another kind, or too large.
    """
    if mesh.suffix.lower() not in KINDS:
        raise UserError(f"mesh {mesh} is of no kind that is read: {', '.join(KINDS)}")
    try:
        size = mesh.stat().st_size
        if size > MAX_MB * 1_000_000:
            mend = "reduce its triangles, for example with MeshLab's quadric edge collapse"
            raise UserError(f"mesh {mesh} has {size / 1e6:.0f} MB; at most {MAX_MB} MB are read: {mend}")
        return mesh.read_bytes()
    except FileNotFoundError as error:
        raise UserError(f"there is no mesh {mesh}") from error
    except OSError as error:
        raise UserError(f"mesh {mesh} can't be read: {error.strerror}") from error


def _load(mesh: Path, scale: Scale) -> list[trimesh.Trimesh]:
    """Read a mesh file's parts in metres, each with triangles and a colour of its own.

    Raises:
        UserError: it can't be read, is empty, or far too large for a link.
    """
    try:
        scene = trimesh.load_scene(mesh, process=False)
        unit = next((part.units for part in scene.geometry.values() if part.units), None)
        factor = trimesh.units.unit_conversion(unit, "meters") if unit else 1.0
        parts = [part for part in scene.dump() if isinstance(part, trimesh.Trimesh) and len(part.faces)]
        corners = [part.vertices[part.referenced_vertices] for part in parts]
    except Exception as error:  # the readers raise whatever they stumble over
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        raise UserError(
            f"mesh {mesh} can't be read as {mesh.suffix[1:].upper()} ({reason}); export it again"
        ) from error
    if not parts:
        raise UserError(f"mesh {mesh} has no triangles; export it again")
    if not all(np.isfinite(some).all() for some in corners):
        raise UserError(f"mesh {mesh} has a corner that is not a finite number; export it again")
    factors = factor * np.array(scale)
    if (size := max(float(np.abs(some * factors).max()) for some in corners)) > _LARGEST_M:
        mend = 'if it is in millimetres, give its <mesh> scale="0.001 0.001 0.001"'
        raise UserError(f"mesh {mesh} reaches {size:.4g} m from its origin; {mend}")
    for part in parts:
        part.apply_transform(np.diag([*factors, 1.0]))
    return parts


def kept(kind: str, suffix: str, content: bytes, make: Callable[[], bytes]) -> Path:
    """Make a file in the user's cache folder, once for each content.

    Raises:
        UserError: it can't be made, or not be written.
    """
    name = hashlib.sha256(f"{_VERSION} ".encode() + content).hexdigest()[:32]
    file = platformdirs.user_cache_path("vlmgineer") / "meshes" / kind / f"{name}.{suffix}"
    try:
        if not (file.is_file() and file.stat().st_size):  # a power cut may leave it empty
            data = make()
            file.parent.mkdir(parents=True, exist_ok=True)
            write_whole(file, data, shared=True)
    except OSError as error:
        mend = "make the folder writable, or choose another with XDG_CACHE_HOME"
        raise UserError(f"meshes can't be kept in {file.parent}: {error.strerror}; {mend}") from error
    return file


def _hull(parts: list[trimesh.Trimesh], mesh: Path) -> bytes:
    corners = np.concatenate([part.vertices[part.referenced_vertices] for part in parts])
    try:
        corners = farthest(corners[ConvexHull(corners).vertices])
        return bytes(trimesh.Trimesh(corners, process=False).convex_hull.export(file_type="stl"))
    except QhullError as error:
        mend = "a collision shape needs a volume: give it depth, or use a <box>"
        raise UserError(f"mesh {mesh} is flat; {mend}") from error


def farthest(corners: Array) -> Array:
    """Choose at most `MAX_CORNERS` of a hull's corners (V, 3), each the one farthest outside of those before it."""
    if len(corners) <= MAX_CORNERS:
        return corners
    if len(corners) > _MANY:
        ways = np.random.default_rng(0).normal(size=(_MANY // 4, 3))
        corners = corners[np.unique([int((corners @ way).argmax()) for way in ways])]
    first = corners[:1]
    while len(first) < 4:
        center = first.mean(axis=0)
        axes = np.linalg.svd(first - center)[2][: len(first) - 1]  # of the line or plane through them
        off = (corners - center) - (corners - center) @ axes.T @ axes
        first = np.vstack([first, corners[np.linalg.norm(off, axis=1).argmax()]])
    hull = ConvexHull(first, incremental=True)
    while len(hull.points) < MAX_CORNERS:
        outside = (corners @ hull.equations[:, :3].T + hull.equations[:, 3]).max(axis=1)
        hull.add_points(corners[[outside.argmax()]])
    return np.asarray(hull.points)


def _collada(parts: list[trimesh.Trimesh], color: Color) -> bytes:
    drawn = []
    for part in parts:
        own = getattr(part.visual, "material", part.visual).main_color / 255 if part.visual.defined else color
        plain = _coarse(part)
        plain.visual = trimesh.visual.TextureVisuals(material=trimesh.visual.material.PBRMaterial(baseColorFactor=own))
        drawn.append(plain)
    return bytes(trimesh.exchange.dae.export_collada(drawn)).replace(b"Y_UP", b"Z_UP")


def _coarse(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Copy a mesh with at most `MAX_DRAWN` triangles: corners of one cell of a grid become one."""
    coarse, cells = trimesh.Trimesh(mesh.vertices, mesh.faces), 256
    while len(coarse.faces) > MAX_DRAWN:
        width, cells = mesh.extents.max() / cells, cells // 2
        coarse = trimesh.Trimesh(np.round(mesh.vertices / width) * width, mesh.faces)  # merges what is equal
        coarse.update_faces(coarse.unique_faces() & (coarse.faces != np.roll(coarse.faces, 1, axis=1)).all(axis=1))
    return coarse


@lru_cache(maxsize=8)
def link_visuals(robot: Robot, gripper: bool) -> dict[str, tuple[Visual, ...]]:
    """List the visual shapes of each link of the bare arm that has some, with its gripper or without."""
    links = assembled(robot, Tool(gripper=gripper)).links.values()
    visuals = {link.name: tuple(visual for shape in link.visuals for visual in _visuals(shape)) for link in links}
    return {name: shapes for name, shapes in visuals.items() if shapes}


def _visuals(visual: RobotShape) -> Iterator[Visual]:
    shape, pose, color = visual.shape, visual.origin.pose, visual.color or _GREY
    if not isinstance(shape, Path):
        yield Visual(shape, pose, color)
        return
    for mesh, own in _pieces(shape):
        scaled = mesh if visual.scale == ONE else Mesh.from_trimesh(mesh.to_trimesh().apply_scale(visual.scale))
        yield Visual(scaled, pose, own or color)


@lru_cache(maxsize=64)
def _pieces(file: Path) -> tuple[tuple[Mesh, Color | None], ...]:
    """Read a file's meshes and their colours; None: the file has none."""
    pieces: list[tuple[Mesh, Color | None]] = []
    for piece in trimesh.load_scene(file).dump():
        if isinstance(piece, trimesh.Trimesh) and len(piece.faces):  # not lines
            color: Color | None = None
            if piece.visual.kind == "texture":
                red, green, blue, opacity = (float(x) / 255 for x in piece.visual.material.main_color)
                color = (red, green, blue, opacity)
            piece.merge_vertices(merge_tex=True, merge_norm=True)
            pieces.append((Mesh.from_trimesh(piece), color))
    return tuple(pieces)
