"""Tools as a JSON list of boxes, cylinders, capsules and spheres, placed in the frame of their mount."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import chain, islice
from types import MappingProxyType
from typing import Any

from core.design import DesignError
from core.geometry import KINDS, PRIMITIVES, Array, Box, Pose, Primitive, Shape
from core.support.text import shorten
from plugins.tools.components import (
    DIGITS,
    NUMBER,
    TEXT,
    TRIPLE,
    ComponentTools,
    ReadShape,
    check_keys,
    read_number,
    read_numbers,
    rounded,
)

FIELD = "tool_components"
_KEYS = ("shape", *dict.fromkeys(chain(*(kind.lengths() for kind in KINDS))))


def _read_shape(item: Mapping[str, Any], where: str) -> tuple[Shape, Pose]:
    """Read a component's shape, which is centred on the component's frame.

    Raises:
        DesignError: the shape is unknown, a size is missing or not above 0, or there is one that it has not.
    """
    name = item.get("shape", Box.kind)
    if not isinstance(name, str) or name not in PRIMITIVES:
        raise DesignError(
            f"{where}: shape must be one of {', '.join(PRIMITIVES)}, not {shorten(str(name))}"
        )

    kind = PRIMITIVES[name]
    check_keys(
        {key: None for key in _KEYS if key in item},
        ("shape", *kind.lengths()),
        f"{where}, a {name},",
    )

    sizes = []
    for size, count in kind.lengths().items():
        place = f"{where}: {size}"
        value = item.get(size)
        if count == 1:
            numbers = [read_number(value, place)]
        else:
            numbers = read_numbers(value, count, place)

        for number in numbers:
            if number < 10.0**-DIGITS:  # it would be written as 0
                raise DesignError(
                    f"{place} must be greater than 0, in metres, not {number:g}"
                )

        sizes += numbers

    return kind.of(*sizes), Pose()


def _shape_schemas() -> Iterator[dict[str, Any]]:
    """Yield the schema of the keys of shapes; those with the same lengths share one."""
    alike: dict[tuple[str, ...], list[type[Primitive]]] = {}
    for kind in KINDS:
        alike.setdefault(tuple(kind.lengths()), []).append(kind)

    for kinds in alike.values():
        names = [kind.kind for kind in kinds]
        schema: dict[str, Any] = {"shape": TEXT | {"enum": names}}
        for size, count in kinds[0].lengths().items():
            schema[size] = NUMBER if count == 1 else TRIPLE

        yield schema


class BoxTools(ComponentTools):
    """A tool is one field, ``tool_components``: boxes and round shapes."""

    shapes = tuple(PRIMITIVES)
    field = FIELD
    keys = _KEYS
    template = "boxes"
    limits = MappingProxyType({"kinds": KINDS})
    shape_schemas = tuple(_shape_schemas())

    def example_shape(self, size: Array) -> dict[str, Any]:
        return {"shape": Box.kind, "size": rounded(size)}

    def readers(self) -> Iterable[ReadShape]:
        return [_read_shape]

    def write_shape(self, shape: Shape, where: str) -> dict[str, Any]:
        if not isinstance(shape, Primitive):
            raise DesignError(
                f"{where} is a mesh, which tool=boxes can't write; use tool=solids"
            )

        sizes = iter(rounded(shape.numbers))
        item: dict[str, Any] = {"shape": shape.kind}
        for name, count in shape.lengths().items():
            numbers = list(islice(sizes, count))
            item[name] = numbers[0] if count == 1 else numbers

        return item
