"""Keep files that were made of meshes, and read what a robot looks like.

What is made is kept in the user's cache folder. A file is named by the content that it was made from, so that equal
meshes share one, and engines that load files by name never mix two up.
"""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Callable, Iterator
from functools import lru_cache
from pathlib import Path

import platformdirs

from core.design import Tool
from core.errors import UserError
from core.geometry import Color, Mesh, Shape, Triple
from core.imports.meshes import find_color, load_parts
from core.robot.description import assembled
from core.scene import Geom
from core.support.files import write_whole
from core.values.descriptions import RobotShape
from core.values.robots import Robot

_VERSION = 2  # of what is written
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

    for piece in load_parts(file.read_bytes(), file):
        color = find_color(piece)
        piece.merge_vertices(merge_tex=True, merge_norm=True)
        piece.apply_scale(scale)
        pieces.append((Mesh.from_trimesh(piece), color))

    return tuple(pieces)


def solid_of(shape: RobotShape) -> Shape:
    """Return what collides of a shape of a robot: of a file, its mesh."""
    if not isinstance(shape.shape, Path):
        return shape.shape

    import trimesh  # which takes half a second

    mesh = trimesh.load_mesh(shape.shape)
    return Mesh.from_trimesh(mesh.apply_scale(shape.scale))
