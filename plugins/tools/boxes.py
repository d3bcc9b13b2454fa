"""Tools as a JSON list of boxes, cylinders, capsules and spheres, placed in the frame of their mount."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from core.design import DesignError
from core.geometry import Array, Compound, Mesh, Pose, Shape
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
from plugins.tools.solids.making import PRIMITIVES, node_of

FIELD = "tool_components"
_SIZES = {
    "box": ("size",),
    "cylinder": ("radius", "length"),
    "capsule": ("radius", "length"),
    "sphere": ("radius",),
}
_KEYS = ("shape", "size", "radius", "length")


def _read_shape(item: Mapping[str, Any], where: str) -> tuple[Shape, Pose]:
    """Read a component's shape, which is centred on the component's frame.

    Raises:
        DesignError: the shape is unknown, a size is missing or not above 0, or there is one that it has not.
    """
    name = item.get("shape", "box")
    if not isinstance(name, str) or name not in _SIZES:
        raise DesignError(
            f"{where}: shape must be one of {', '.join(_SIZES)}, not {shorten(str(name))}"
        )

    check_keys(
        {key: None for key in _KEYS if key in item},
        ("shape", *_SIZES[name]),
        f"{where}, a {name},",
    )

    sizes = []
    for size in _SIZES[name]:
        place = f"{where}: {size}"
        value = item.get(size)
        if name == "box":
            numbers = read_numbers(value, 3, place)
        else:
            numbers = [read_number(value, place)]

        for number in numbers:
            if number < 10.0**-DIGITS:  # it would be written as 0
                raise DesignError(
                    f"{place} must be greater than 0, in metres, not {number:g}"
                )

        sizes += numbers

    return PRIMITIVES[name](*sizes), Pose()


class BoxTools(ComponentTools):
    """A tool is one field, ``tool_components``: boxes and round shapes."""

    shapes = tuple(_SIZES)
    field = FIELD
    keys = _KEYS
    template = "boxes"
    shape_schemas = (
        {"shape": {"type": "string", "enum": ["box"]}, "size": TRIPLE},
        {
            "shape": {"type": "string", "enum": ["cylinder", "capsule"]},
            "radius": NUMBER,
            "length": NUMBER,
        },
        {"shape": {"type": "string", "enum": ["sphere"]}, "radius": NUMBER},
    )

    def example_shape(self, size: Array) -> dict[str, Any]:
        return {"shape": "box", "size": rounded(size)}

    def readers(self) -> Iterable[ReadShape]:
        return [_read_shape]

    def write_shape(self, shape: Shape | Compound, where: str) -> dict[str, Any]:
        if isinstance(shape, Mesh | Compound):
            raise DesignError(
                f"{where} is a mesh, which tool=boxes can't write; use tool=solids"
            )

        node = node_of(shape)
        sizes = rounded(node.sizes)
        if node.kind == "box":
            return {"shape": "box", "size": sizes}

        return {
            "shape": node.kind,
            **dict(zip(_SIZES[node.kind], sizes, strict=True)),
        }
