"""Read the tree of a solid from JSON that a model wrote, and write it back. Nothing is built yet.

Everything that decides how long building takes is limited here: nodes, depth, points, sizes.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from manifold3d import CrossSection, FillRule
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    Field,
    Strict,
    create_model,
)

from core.design import DesignError
from core.designs.rules import MIN_SIDE_M
from core.geometry import KINDS, Primitive
from core.interfaces import JsonObject
from core.support.inputs import FIELDS, check, in_unit
from core.support.text import kind, shorten
from plugins.tools.components import (
    DIGITS,
    Number,
    rounded,
)
from plugins.tools.refusals import ToolReason

MAX_CHARACTERS = 20_000
"""The longest text of a component's solid."""

MAX_NODES = 40
"""The most shapes and operations of a tool."""

MAX_DEPTH = 8
"""The most operations within each other."""

MAX_POINTS = 48
"""The most points of an outline."""

MAX_HULL_POINTS = 128
"""The most points of a hull."""

MAX_SIZE_M = 1.0
"""The largest size of a shape, and the largest coordinate of a point."""

FULL_TURN = round(math.tau, DIGITS)
"""The largest angle of a revolution, as it is written."""

_SAME = 1e-6  # share of an outline's area
_PINCHED_MM = 1e-3  # an outline that is thinner somewhere touches itself

OPERATIONS = ("union", "difference", "intersection")
_EXTRA = {"extrude": "height", "revolve": "angle"}


@dataclass(frozen=True)
class Node:
    """A primitive, or what is made of children; metres and radians. Equal nodes make equal solids.

    Attributes:
        kind: a key of `SIZES`, ``extrude``, ``revolve``, ``hull``, or one of `OPERATIONS`.
        sizes: those of a primitive; or the height of an extrusion, the angle of a revolution.
        points: those of an outline or a hull.
        children: what an operation joins.
        at: x, y, z, roll, pitch and yaw in the parent's frame.
    """

    kind: str
    sizes: tuple[float, ...] = ()
    points: tuple[tuple[float, ...], ...] = ()
    children: tuple[Node, ...] = ()
    at: tuple[float, ...] = (0.0,) * 6


def dump_node(node: Node) -> JsonObject:
    """Write a tree as JSON values.

    Args:
        node: of any kind.
    """
    content: Any = rounded(node.sizes)
    if node.kind in OPERATIONS:
        content = [dump_node(child) for child in node.children]
    elif node.points:
        content = [rounded(point) for point in node.points]

    data: JsonObject = {node.kind: content}
    if node.kind in _EXTRA and node.sizes != (FULL_TURN,):
        data[_EXTRA[node.kind]] = rounded(node.sizes)[0]

    if any(node.at[3:]):
        data["at"] = rounded(node.at)
    elif any(node.at):
        data["at"] = rounded(node.at[:3])

    return data


class TreeReader:
    """Reads the solids of one tool; counts their nodes."""

    def __init__(self) -> None:
        self._nodes = 0

    def read(self, value: object, where: str) -> Node:
        """Read a solid from JSON text, or from the values in it.

        Args:
            value: what a model wrote.
            where: words for its place, for an error.

        Raises:
            DesignError: says what is wrong, where, and how to mend it.
        """
        if isinstance(value, str):
            value = _parse_json(value, where)

        return self._read_node(value, where, 1)

    def _read_node(
        self,
        value: object,
        where: str,
        depth: int,
    ) -> Node:
        """Read a node and what is below it; ``depth`` counts from 1."""
        self._nodes += 1
        if self._nodes > MAX_NODES:
            raise DesignError.because(
                ToolReason.SOLID_NODES, where=where, most=MAX_NODES
            )

        if depth > MAX_DEPTH:
            raise DesignError.because(
                ToolReason.SOLID_DEPTH, where=where, most=MAX_DEPTH
            )

        if not isinstance(value, Mapping):
            raise DesignError.because(
                ToolReason.SOLID_OBJECT, where=where, given=kind(value)
            )

        name = _read_kind(value, where)
        read = check(_WRITTEN[name], value, where, DesignError)
        where = f"{where}: {name}"
        content: Any = getattr(read, name)
        at: tuple[float, ...] = read.at
        if name in SIZES:
            return Node(name, content, at=at)
        if name in OPERATIONS:
            children = [
                self._read_node(child, f"{where} {number}", depth + 1)
                for number, child in enumerate(content, start=1)
            ]
            return Node(name, children=tuple(children), at=at)

        sizes = (getattr(read, _EXTRA[name]),) if name in _EXTRA else ()
        return Node(name, sizes, content, at=at)


def _parse_json(text: str, where: str) -> object:
    """Parse the text of a solid.

    Raises:
        DesignError: it is too long, or not JSON; or its numbers are too long, or it nests too deep.
    """
    if len(text) > MAX_CHARACTERS:
        raise DesignError.because(
            ToolReason.FIELD_LENGTH, field=where, count=len(text), most=MAX_CHARACTERS
        )

    try:
        value: object = json.loads(text)
    except json.JSONDecodeError as error:
        problem = f" is malformed JSON at column {error.colno}: {error.msg}"
        raise DesignError.because(
            ToolReason.SOLID_JSON, where=where, problem=problem
        ) from error
    except (ValueError, RecursionError) as error:
        problem = ": its JSON has a number of too many digits, or nests too deep"
        raise DesignError.because(
            ToolReason.SOLID_JSON, where=where, problem=problem
        ) from error

    return value


def _read_kind(value: Mapping[str, Any], where: str) -> str:
    """Return the only key that names a kind of node."""
    named = [name for name in _WRITTEN if name in value]
    if len(named) == 1:
        return named[0]

    others = ", ".join(shorten(str(key)) for key in list(value)[:3])
    found = " and ".join(named) or others or "nothing"
    raise DesignError.because(
        ToolReason.SOLID_KIND, where=where, possible=", ".join(_WRITTEN), found=found
    )


def _check_outline(outline: Outline) -> Outline:
    """Refuse outlines that cross themselves, or have no area.

    Raises:
        ValueError: it is one.
    """
    points = np.array(outline)
    x, y = 1000 * points.T
    area = abs(float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))) / 2

    if area < (1000 * MIN_SIDE_M) ** 2:
        raise ValueError(
            f"its outline has an area of {area:.3g} mm^2; give its corners in order"
        )

    # Where it crosses itself, less of it is filled.
    filled = CrossSection([1000 * points], FillRule.EvenOdd)
    crosses = abs(filled.area() - area) > _SAME * area

    if crosses or len(filled.offset(-_PINCHED_MM).decompose()) != 1:
        raise ValueError(
            "its outline crosses or touches itself; list its corners in order"
        )

    return outline


def _check_radii(outline: Outline) -> Outline:
    """Refuse an outline to be revolved, whose points are [r, z], that crosses its axis.

    Raises:
        ValueError: it does.
    """
    if min(r for r, _ in outline) < 0:
        raise ValueError(
            "its points are [r, z] with r from 0, the distance from the z axis"
        )
    return outline


def _pad(value: Any) -> Any:
    """Read a place without a turn."""
    return (
        [*value, 0.0, 0.0, 0.0]
        if isinstance(value, list) and len(value) == 3
        else value
    )


def _listed(value: Any) -> Any:
    """Read the only size of a shape, which may stand without a list."""
    return value if isinstance(value, list) else [value]


def _round(number: float) -> float:
    return round(number, DIGITS) + 0.0


_METRES = in_unit("it is in metres")
_ROUNDED = AfterValidator(_round)
Size = Annotated[
    float, Strict(), Field(ge=MIN_SIDE_M, le=MAX_SIZE_M), _METRES, _ROUNDED
]
Tip = Annotated[float, Strict(), Field(ge=0, le=MAX_SIZE_M), _METRES, _ROUNDED]
Coordinate = Annotated[
    float, Strict(), Field(ge=-MAX_SIZE_M, le=MAX_SIZE_M), _METRES, _ROUNDED
]
FullAngle = Annotated[
    float,
    Strict(),
    Field(ge=0.01, le=FULL_TURN + 1e-4),
    in_unit(f"it is in radians, and a full turn is {FULL_TURN}"),
    AfterValidator(lambda angle: _round(min(angle, FULL_TURN))),
]
Rounded = Annotated[Number, _ROUNDED]
At = Annotated[
    tuple[Coordinate, Coordinate, Coordinate, Rounded, Rounded, Rounded],
    BeforeValidator(_pad),
]
Outline = Annotated[
    tuple[tuple[Coordinate, Coordinate], ...],
    Field(min_length=3, max_length=MAX_POINTS),
    AfterValidator(_check_outline),
]
Corners = Annotated[
    tuple[tuple[Coordinate, Coordinate, Coordinate], ...],
    Field(min_length=4, max_length=MAX_HULL_POINTS),
]
Children = Annotated[list[Any], Field(min_length=2)]


def _list_of(kind: type[Primitive]) -> Any:
    """Make the type of the list of all numbers of a kind of shape."""

    def check_whole(sizes: tuple[float, ...]) -> tuple[float, ...]:
        return kind.of(*sizes).numbers

    sizes = (Size,) * sum(kind.lengths().values())
    listed: Any = Annotated[tuple[sizes], AfterValidator(check_whole)]  # type: ignore[valid-type]
    if len(sizes) > 1:
        return listed

    return Annotated[listed, BeforeValidator(_listed)]


SIZES: Mapping[str, Any] = {
    **{kind.kind: _list_of(kind) for kind in KINDS},
    "cone": tuple[Size, Tip, Size],
}
"""The sizes in each primitive's list: of a cone the radii below and above, and its length."""


def _written_as(name: str, content: Any, **extra: Any) -> type[BaseModel]:
    """Make the class of a kind of node as it is written."""
    fields: dict[str, Any] = {name: (content, ...), "at": (At, (0.0,) * 6), **extra}
    return create_model(name, __config__=FIELDS, **fields)


_WRITTEN: Mapping[str, Any] = {
    **{name: _written_as(name, sizes) for name, sizes in SIZES.items()},
    "extrude": _written_as("extrude", Outline, height=(Size, ...)),
    "revolve": _written_as(
        "revolve",
        Annotated[Outline, AfterValidator(_check_radii)],
        angle=(FullAngle, FULL_TURN),
    ),
    "hull": _written_as("hull", Corners),
    **{name: _written_as(name, Children) for name in OPERATIONS},
}
