"""Tools as a JSON list of boxes, cylinders, capsules and spheres, placed in the frame of their mount."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

from core.design import DesignError, Tool
from core.designs.components import (
    DIGITS,
    check_keys,
    component_rules,
    component_schema,
    read_components,
    read_number,
    read_numbers,
    rounded,
    short_components,
    write_components,
)
from core.designs.mounting import describe_mount, first_box
from core.designs.rules import MAX_COMPONENTS, MAX_SIDE_M, MIN_SIDE_M
from core.designs.varying import VariedTools
from core.geometry import Box, Capsule, Compound, Cylinder, Pose, Shape, Sphere
from core.interfaces import Brief
from core.support.text import shorten

FIELD = "tool_components"
_SIZES = {"box": ("size",), "cylinder": ("radius", "length"), "capsule": ("radius", "length"), "sphere": ("radius",)}
_KEYS = ("shape", "size", "radius", "length")


class BoxTools(VariedTools):
    """A tool is one field, ``tool_components``: boxes and round shapes with their poses in the mount's frame.

    With ``joints`` components may move against their parents.
    """

    shapes = tuple(_SIZES)

    def __init__(self, joints: bool = False) -> None:
        self.joints = joints

    def schema(self) -> dict[str, Any]:
        number = {"type": "number"}
        size = {"type": "array", "items": number, "minItems": 3, "maxItems": 3}
        shapes = [
            {"shape": {"type": "string", "enum": ["box"]}, "size": size},
            {"shape": {"type": "string", "enum": ["cylinder", "capsule"]}, "radius": number, "length": number},
            {"shape": {"type": "string", "enum": ["sphere"]}, "radius": number},
        ]
        return {
            FIELD: {"type": "array", "items": {"anyOf": [component_schema(shape, self.joints) for shape in shapes]}}
        }

    def parse(self, data: Mapping[str, Any], *, gripper: bool) -> Tool:
        return read_components(data, FIELD, _KEYS, _read_shape, self.robot, gripper, self.joints)

    def dump(self, tool: Tool) -> dict[str, Any]:
        return {FIELD: write_components(tool, _write_shape, self.joints)}

    def abridge(self, tool: Tool) -> dict[str, Any]:
        return {FIELD: short_components(self.dump(tool)[FIELD])}

    def instructions(self, brief: Brief) -> str:
        mount, name, size, at = first_box(brief)
        example: dict[str, Any] = {
            "name": name,
            "parent": mount,
            "shape": "box",
            "size": rounded(size),
            "position": rounded(at),
        }
        example |= {"rpy": [0, 0, 0], "mass": 0.005, "color": "#3373cc"}
        return _RULES.format(
            mount=describe_mount(brief),
            rules=component_rules(brief.task.robot, brief.gripper, self.material, self.joints),
            example=json.dumps([example]),
        )


_RULES = f"""\
Write each tool as a list of components in `{FIELD}`, at most {MAX_COMPONENTS}.

{{mount}}

Each component is an object with these keys:
- `shape` and its sizes in metres, every side or diameter {MIN_SIDE_M:g} to {MAX_SIDE_M:g}. A shape is centred on its
  own frame:
  "box", which may be left out, with `size` [x, y, z], full side lengths along its own axes;
  "cylinder" with `radius` and `length`, along its own z;
  "capsule", the same with half a sphere added at each end, which `length` leaves out;
  "sphere" with `radius`.
{{rules}}
- Tools of several well-placed components (hooks, walls, scoops, bends) tend to do better than a plain bar.

Example of a list with one component:
{{example}}"""


def _read_shape(item: Mapping[str, Any], where: str) -> tuple[Shape, Pose]:
    name = item.get("shape", "box")
    if not isinstance(name, str) or name not in _SIZES:
        raise DesignError(f"{where}: shape must be one of {', '.join(_SIZES)}, not {shorten(str(name))}")
    check_keys({key: None for key in _KEYS if key in item}, ("shape", *_SIZES[name]), f"{where}, a {name},")
    if name == "box":
        x, y, z = (_positive(side, f"{where}: size") for side in read_numbers(item.get("size"), 3, f"{where}: size"))
        return Box((x, y, z)), Pose()
    sizes = [_positive(read_number(item.get(size), f"{where}: {size}"), f"{where}: {size}") for size in _SIZES[name]]
    kinds: dict[str, Callable[..., Shape]] = {"cylinder": Cylinder, "capsule": Capsule, "sphere": Sphere}
    return kinds[name](*sizes), Pose()


def _positive(value: float, where: str) -> float:
    if value < 10.0**-DIGITS:
        raise DesignError(f"{where} must be greater than 0, in metres, not {value:g}")
    return value


def _write_shape(shape: Shape | Compound, where: str) -> dict[str, Any]:
    match shape:
        case Box(size):
            return {"shape": "box", "size": rounded(size)}
        case Cylinder(radius, length) | Capsule(radius, length):
            radius, length = rounded((radius, length))
            return {"shape": type(shape).__name__.lower(), "radius": radius, "length": length}
        case Sphere(radius):
            return {"shape": "sphere", "radius": rounded([radius])[0]}
    raise DesignError(f"{where} is a mesh, which tool=boxes can't write; use tool=solids")
