"""Tools as a JSON list of boxes and other shapes of a few lengths, placed in the frame of their mount."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain
from types import MappingProxyType
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, Field, Strict, create_model

from core.design import DesignError
from core.geometry import KINDS, PRIMITIVES, Array, Box, Pose, Primitive, Shape
from core.interfaces import JsonObject
from core.support.inputs import FIELDS, check, in_unit
from core.support.text import shorten
from plugins.tools.components import (
    DIGITS,
    MAX_NUMBER,
    NUMBER,
    TEXT,
    TRIPLE,
    ComponentTools,
    ReadShape,
    rounded,
)
from plugins.tools.refusals import ToolReason

FIELD = "tool_components"
_KEYS = ("shape", *dict.fromkeys(chain(*(kind.lengths() for kind in KINDS))))


# What is shorter would be written as 0.
Length = Annotated[
    float, Strict(), Field(ge=10.0**-DIGITS, le=MAX_NUMBER), in_unit("it is in metres")
]

Sides = tuple[Length, Length, Length]


def _lengths_of(kind: type[Primitive]) -> type[BaseModel]:
    """Make the class of a kind's lengths as they are written."""
    fields: dict[str, Any] = {}
    for name, count in kind.lengths().items():
        fields[name] = (Length if count == 1 else Sides, ...)

    return create_model(kind.kind, __config__=FIELDS, **fields)


_LENGTHS = {name: _lengths_of(kind) for name, kind in PRIMITIVES.items()}


def _read_shape(item: JsonObject, where: str) -> tuple[Shape, Pose]:
    """Read a component's shape, which is centred on the component's frame.

    Raises:
        DesignError: the shape is unknown, a size is missing or not above 0, there is one that it has not, or they make
            no such shape.
    """
    name = item.get("shape", Box.kind)
    if not isinstance(name, str) or name not in PRIMITIVES:
        raise DesignError.because(
            ToolReason.SHAPE,
            where=where,
            possible=", ".join(PRIMITIVES),
            given=shorten(str(name)),
        )

    kind = PRIMITIVES[name]
    where = f"{where}, a {name}"
    written = {key: item[key] for key in _KEYS[1:] if key in item}
    read = check(_LENGTHS[name], written, where, DesignError)
    try:
        return kind(**vars(read)), Pose()
    except ValueError as error:
        raise DesignError(f"{where}: {error}") from error


def _shape_schemas() -> Iterator[JsonObject]:
    """Yield the schema of the keys of shapes; those with the same lengths share one."""
    alike: dict[tuple[str, ...], list[type[Primitive]]] = {}
    for kind in KINDS:
        alike.setdefault(tuple(kind.lengths()), []).append(kind)

    for kinds in alike.values():
        names = [kind.kind for kind in kinds]
        schema: JsonObject = {"shape": TEXT | {"enum": names}}
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

    def example_shape(self, size: Array) -> JsonObject:
        return {"shape": Box.kind, "size": rounded(size)}

    def readers(self) -> Iterable[ReadShape]:
        return [_read_shape]

    def write_shape(self, shape: Shape, where: str) -> JsonObject:
        if not isinstance(shape, Primitive):
            raise DesignError(
                f"{where} is a mesh, which tool=boxes can't write; use tool=solids"
            )

        item: JsonObject = {"shape": shape.kind}
        for name, size in shape.sizes.items():
            numbers = rounded(np.ravel(size))
            item[name] = numbers if isinstance(size, tuple) else numbers[0]

        return item
