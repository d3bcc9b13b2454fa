"""Read the tree of a solid from JSON that a model wrote, and write it back. Nothing is built yet.

Everything that decides how long building takes is limited here: nodes, depth, points, sizes.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from manifold3d import CrossSection, FillRule

from core.design import DesignError
from core.designs.rules import MIN_SIDE_M
from core.geometry import Array
from core.support.text import kind, shorten
from plugins.tools.components import (
    DIGITS,
    check_keys,
    describe,
    read_number,
    read_numbers,
    rounded,
)

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
SIZES = {  # the sizes in each primitive's list
    "box": ("x", "y", "z"),
    "sphere": ("radius",),
    "cylinder": ("radius", "length"),
    "capsule": ("radius", "length"),
    "cone": ("bottom radius", "top radius", "length"),
}
_KINDS = (*SIZES, "extrude", "revolve", "hull", *OPERATIONS)
_EXTRA = {"extrude": {"height"}, "revolve": {"angle"}}


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


def dump_node(node: Node) -> dict[str, Any]:
    """Write a tree as JSON values.

    Args:
        node: of any kind.
    """
    content: Any = rounded(node.sizes)
    if node.kind in OPERATIONS:
        content = [dump_node(child) for child in node.children]
    elif node.points:
        content = [rounded(point) for point in node.points]

    data: dict[str, Any] = {node.kind: content}
    if node.kind in _EXTRA and node.sizes != (FULL_TURN,):
        data |= dict.fromkeys(_EXTRA[node.kind], rounded(node.sizes)[0])

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
            raise DesignError(
                f"{where}: the tool's solids have more than {MAX_NODES} shapes in all; use fewer"
            )

        if depth > MAX_DEPTH:
            raise DesignError(
                f"{where} nests more than {MAX_DEPTH} deep; use fewer operations within each other"
            )

        if not isinstance(value, Mapping):
            raise DesignError(
                f'{where} must be an object such as {{"box": [0.02, 0.02, 0.1]}}, not {kind(value)}'
            )

        name = _read_kind(value, where)
        check_keys(value, {name, "at", *_EXTRA.get(name, ())}, where)
        content = value[name]

        where = f"{where}: {name}"
        at = _read_pose(value.get("at"), f"{where}: at")
        if name in OPERATIONS:
            return Node(name, children=self._children(content, where, depth), at=at)
        if name in SIZES:
            return Node(name, _read_sizes(content, name, where), at=at)

        if name == "hull":
            points = _read_points(content, 3, 4, MAX_HULL_POINTS, where)
            return Node(name, points=points, at=at)

        points = _read_points(content, 2, 3, MAX_POINTS, where)
        _check_outline(np.array(points), where)

        if name == "extrude":
            size = _read_size(value.get("height"), f"{where}: height")
        else:
            size = _read_turn(value.get("angle", FULL_TURN), points, where)

        return Node(name, (size,), points, at=at)

    def _children(
        self,
        content: object,
        where: str,
        depth: int,
    ) -> tuple[Node, ...]:
        """Read the children of an operation at this depth."""
        if not isinstance(content, list) or len(content) < 2:
            raise DesignError(f"{where} must be a list of two or more shapes")

        return tuple(
            self._read_node(child, f"{where} {number}", depth + 1)
            for number, child in enumerate(content, start=1)
        )


def _parse_json(text: str, where: str) -> object:
    """Parse the text of a solid.

    Raises:
        DesignError: it is too long, or not JSON; or its numbers are too long, or it nests too deep.
    """
    if len(text) > MAX_CHARACTERS:
        raise DesignError(
            f"{where} is {len(text)} characters long; at most {MAX_CHARACTERS} are allowed"
        )

    try:
        value: object = json.loads(text)
    except json.JSONDecodeError as error:
        raise DesignError(
            f"{where} is malformed JSON at column {error.colno}: {error.msg}"
        ) from error
    except (ValueError, RecursionError) as error:
        raise DesignError(
            f"{where}: its JSON has a number of too many digits, or nests too deep"
        ) from error

    return value


def _read_kind(value: Mapping[str, Any], where: str) -> str:
    """Return the only key that names a kind of node."""
    named = [name for name in _KINDS if name in value]
    if len(named) == 1:
        return named[0]

    others = ", ".join(shorten(str(key)) for key in list(value)[:3])
    found = " and ".join(named) or others or "nothing"
    raise DesignError(
        f"{where} must have exactly one of {', '.join(_KINDS)}; it has {found}"
    )


def _read_turn(
    angle: object,
    points: Sequence[Sequence[float]],
    where: str,
) -> float:
    """Read the angle of a revolution of an outline, whose points are [r, z]."""
    if min(r for r, _ in points) < 0:
        raise DesignError(
            f"{where}: its points are [r, z] with r from 0, the distance from the z axis"
        )

    radians = read_number(angle, f"{where}: angle")
    if not 0.01 <= radians <= FULL_TURN + 1e-4:
        raise DesignError(
            f"{where}: angle must be between 0.01 and {FULL_TURN} radians, a full turn"
        )

    return round(min(radians, FULL_TURN), DIGITS)


def _read_pose(value: object, where: str) -> tuple[float, ...]:
    """Read where a shape lies: x, y, z, and perhaps roll, pitch and yaw."""
    if value is None:
        return (0.0,) * 6

    count = 3
    if isinstance(value, list) and len(value) > 3:
        count = 6

    where = f"{where}, x, y, z and rpy if any,"
    numbers = [
        round(number, DIGITS) + 0.0 for number in read_numbers(value, count, where)
    ]
    if max(map(abs, numbers[:3])) > MAX_SIZE_M:
        raise DesignError(f"{where} is more than {MAX_SIZE_M:g} m away")

    return (*numbers, *[0.0] * (6 - count))


def _read_size(
    value: object,
    where: str,
    least: float = MIN_SIDE_M,
) -> float:
    """Read a size between ``least`` and `MAX_SIZE_M`, metres."""
    size = round(read_number(value, where), DIGITS)
    if not least <= size <= MAX_SIZE_M:
        raise DesignError(
            f"{where} is {size:g} m; it must be between {least:g} and {MAX_SIZE_M:g} m"
        )

    return size


def _read_sizes(
    content: object,
    name: str,
    where: str,
) -> tuple[float, ...]:
    """Read the sizes of a primitive; a sphere's may stand without a list."""
    names = SIZES[name]
    if name == "sphere" and not isinstance(content, list):
        content = [content]

    numbers = read_numbers(content, len(names), f"{where} [{', '.join(names)}]")

    sizes = []
    for size, number in zip(names, numbers, strict=True):
        least = 0.0 if size == "top radius" else MIN_SIDE_M
        sizes.append(_read_size(number, f"{where}: {size}", least))

    return tuple(sizes)


def _read_points(
    content: object,
    count: int,
    fewest: int,
    most: int,
    where: str,
) -> tuple[tuple[float, ...], ...]:
    """Read points of ``count`` coordinates each, from ``fewest`` to ``most`` of them."""
    if not isinstance(content, list) or not fewest <= len(content) <= most:
        raise DesignError(
            f"{where} must be a list of {fewest} to {most} points, not {describe(content)}"
        )

    points = []
    for number, point in enumerate(content, start=1):
        numbers = read_numbers(point, count, f"{where}: point {number}")
        points.append(tuple(round(value, DIGITS) + 0.0 for value in numbers))

    if np.abs(points).max() > MAX_SIZE_M:
        raise DesignError(f"{where}: a point is more than {MAX_SIZE_M:g} m away")

    return tuple(points)


def _check_outline(points: Array, where: str) -> None:
    """Refuse outlines that cross themselves, or have no area; ``points`` are (N, 2), metres."""
    x, y = 1000 * points.T
    area = abs(float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))) / 2

    if area < (1000 * MIN_SIDE_M) ** 2:
        raise DesignError(
            f"{where}: its outline has an area of {area:.3g} mm^2; give its corners in order"
        )

    # Where it crosses itself, less of it is filled.
    filled = CrossSection([1000 * points], FillRule.EvenOdd)
    crosses = abs(filled.area() - area) > _SAME * area

    if crosses or len(filled.offset(-_PINCHED_MM).decompose()) != 1:
        raise DesignError(
            f"{where}: its outline crosses or touches itself; list its corners in order"
        )
