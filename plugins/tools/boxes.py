"""Tools as a JSON list of boxes, cylinders, capsules and spheres, placed in the frame of their mount."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from core.design import DesignError
from core.geometry import Array, Box, Capsule, Compound, Cylinder, Pose, Shape, Sphere
from core.support.text import shorten
from plugins.tools.components import (
    DIGITS,
    NUMBER,
    TRIPLE,
    ComponentTools,
    ReadShape,
    check_keys,
    read_number,
    read_numbers,
    rounded,
)

FIELD = "tool_components"
_SIZES = {"box": ("size",), "cylinder": ("radius", "length"), "capsule": ("radius", "length"), "sphere": ("radius",)}
_KEYS = ("shape", "size", "radius", "length")


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


class BoxTools(ComponentTools):
    """A tool is one field, ``tool_components``: boxes and round shapes."""

    shapes = tuple(_SIZES)
    field = FIELD
    keys = _KEYS
    template = "boxes"
    shape_schemas = (
        {"shape": {"type": "string", "enum": ["box"]}, "size": TRIPLE},
        {"shape": {"type": "string", "enum": ["cylinder", "capsule"]}, "radius": NUMBER, "length": NUMBER},
        {"shape": {"type": "string", "enum": ["sphere"]}, "radius": NUMBER},
    )

    def example_shape(self, size: Array) -> dict[str, Any]:
        return {"shape": "box", "size": rounded(size)}

    def readers(self) -> Iterable[ReadShape]:
        return [_read_shape]

    def write_shape(self, shape: Shape | Compound, where: str) -> dict[str, Any]:
        match shape:
            case Box(size):
                return {"shape": "box", "size": rounded(size)}
            case Cylinder(radius, length) | Capsule(radius, length):
                radius, length = rounded((radius, length))
                return {"shape": type(shape).__name__.lower(), "radius": radius, "length": length}
            case Sphere(radius):
                return {"shape": "sphere", "radius": rounded([radius])[0]}
        raise DesignError(f"{where} is a mesh, which tool=boxes can't write; use tool=solids")
