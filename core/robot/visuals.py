"""Read what a robot looks like: the visual shapes of its links, in their colours.

Covered by `tests/plugins/listeners/test_rerun.py` and `tests/plugins/simulators/test_mujoco.py`.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import trimesh
from lxml import etree

from core.design import Tool
from core.geometry import Mesh, Pose, Shape
from core.robot.description import assemble, read_numbers, read_origin, read_shape
from core.scene import Color
from core.values.robots import Robot

GREY: Color = (0.8, 0.8, 0.8, 1.0)


class Visual(NamedTuple):
    """A shape in one colour, and its pose in the frame of its link."""

    shape: Shape
    pose: Pose
    color: Color


@lru_cache(maxsize=8)
def link_visuals(robot: Robot, gripper: bool) -> dict[str, tuple[Visual, ...]]:
    """List the visual shapes of each link of the bare arm, with its gripper or without."""
    root: Any = etree.fromstring(assemble(robot, Tool(gripper=gripper)).encode())
    named = {m.get("name"): c for m in root.iter("material") if (c := m.find("color")) is not None}
    found = {}
    for link in root.findall("link"):
        if visuals := tuple(v for element in link.findall("visual") for v in _visuals(element, named)):
            found[str(link.get("name"))] = visuals
    return found


def _visuals(element: Any, named: dict[str, Any]) -> Iterator[Visual]:
    pose, geometry, material = read_origin(element), element.find("geometry")[0], element.find("material")
    shape = read_shape(geometry)
    color = GREY
    if material is not None:
        given = material.find("color") if material.find("color") is not None else named.get(material.get("name"))
        if given is not None:
            red, green, blue, opacity = read_numbers(given, "rgba").tolist()
            color = (red, green, blue, opacity)
    if not isinstance(shape, Path):
        yield Visual(shape, pose, color)
        return
    scale = read_numbers(geometry, "scale") if geometry.get("scale") else None
    for mesh, own in _pieces(shape):
        scaled = mesh if scale is None else Mesh.from_trimesh(mesh.to_trimesh().apply_scale(scale))
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
