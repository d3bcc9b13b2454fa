"""Keep files that were made of meshes, reduce hulls, and read what a robot looks like.

What is made is kept in the user's cache folder. A file is named by the content that it was made from, so that equal
meshes share one, and engines that load files by name never mix two up.
"""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Callable, Iterator
from functools import lru_cache
from pathlib import Path

import numpy as np
import platformdirs
import trimesh
from scipy.spatial import ConvexHull

from core.design import Tool
from core.errors import UserError
from core.geometry import Array, Color, Mesh, Triple
from core.robot.description import assembled
from core.scene import Geom
from core.support.files import write_whole
from core.values.descriptions import RobotShape
from core.values.robots import Robot

# PhysX takes at most 255 faces, and cuts larger hulls its own way; a hull of V corners has up to 2 V - 4.
MAX_CORNERS = 128
_MANY = 8_000  # corners of a hull: of more, only those farthest in many directions are looked at
_VERSION = 1  # of what is written
_GREY: Color = (0.8, 0.8, 0.8, 1.0)  # of shapes without a material


def keep_file(
    kind: str,
    suffix: str,
    content: bytes,
    make: Callable[[], bytes],
) -> Path:
    """Make a file in the user's cache folder, once for each content.

    Args:
        kind: the folder in it.
        suffix: of the file's name.
        content: what it is made from.
        make: returns what is written.

    Raises:
        UserError: it can't be made, or not be written.
    """
    file = kept_file(kind, suffix, content)

    try:
        # A power cut may leave it empty.
        if not (file.is_file() and file.stat().st_size):
            file.parent.mkdir(parents=True, exist_ok=True)
            write_whole(file, make(), shared=True)
    except OSError as error:
        raise UserError(
            f"meshes can't be kept in {file.parent}: {error.strerror}; make the folder writable, or choose another "
            "with XDG_CACHE_HOME"
        ) from error

    return file


def kept_file(kind: str, suffix: str, content: bytes) -> Path:
    """Name the file that `keep_file` makes of a content."""
    name = hashlib.sha256(f"{_VERSION} ".encode() + content).hexdigest()[:32]
    folder = platformdirs.user_cache_path("vlmgineer") / "meshes" / kind

    return folder / f"{name}.{suffix}"


def farthest(corners: Array) -> Array:
    """Choose few of a hull's corners, each the one farthest outside of the hull of those before it.

    Args:
        corners: (V, 3) of the hull.

    Returns:
        At most `MAX_CORNERS` of them.
    """
    if len(corners) <= MAX_CORNERS:
        return corners
    if len(corners) > _MANY:
        ways = np.random.default_rng(0).normal(size=(_MANY // 4, 3))
        corners = corners[np.unique([int((corners @ way).argmax()) for way in ways])]

    first = corners[:1]
    while len(first) < 4:
        center = first.mean(axis=0)

        # Of the line or plane through them.
        axes = np.linalg.svd(first - center)[2][: len(first) - 1]
        off = (corners - center) - (corners - center) @ axes.T @ axes
        first = np.vstack([first, corners[np.linalg.norm(off, axis=1).argmax()]])

    hull = ConvexHull(first, incremental=True)
    while len(hull.points) < MAX_CORNERS:
        outside = (corners @ hull.equations[:, :3].T + hull.equations[:, 3]).max(axis=1)
        hull.add_points(corners[[outside.argmax()]])

    return np.asarray(hull.points)


@lru_cache(maxsize=8)
def link_visuals(robot: Robot, gripper: bool) -> dict[str, tuple[Geom, ...]]:
    """List the visual shapes of each link of the bare arm that has some.

    Args:
        robot: the arm.
        gripper: whether it has its gripper.
    """
    links = assembled(robot, Tool(gripper=gripper)).links.values()
    return {
        link.name: tuple(itertools.chain.from_iterable(map(_visuals, link.visuals)))
        for link in links
        if link.visuals
    }


def _visuals(visual: RobotShape) -> Iterator[Geom]:
    """Yield what is drawn for a shape of a description; a file may hold several meshes."""
    shape = visual.shape
    pose = visual.origin.pose
    color = visual.color or _GREY

    if not isinstance(shape, Path):
        yield Geom(shape, pose, color)
        return

    for mesh, painted in _pieces(shape, visual.scale):
        yield Geom(mesh, pose, painted or color)


@lru_cache(maxsize=64)
def _pieces(file: Path, scale: Triple) -> tuple[tuple[Mesh, Color | None], ...]:
    """Read a file's meshes, scaled, and their colours; None: the file has none."""
    pieces: list[tuple[Mesh, Color | None]] = []

    for piece in trimesh.load_scene(file).dump():
        if isinstance(piece, trimesh.Trimesh) and len(piece.faces):  # not lines
            color: Color | None = None
            if piece.visual.kind == "texture":
                rgba = piece.visual.material.main_color / 255
                color = tuple(rgba.tolist())

            piece.merge_vertices(merge_tex=True, merge_norm=True)
            piece.apply_scale(scale)
            pieces.append((Mesh.from_trimesh(piece), color))

    return tuple(pieces)
