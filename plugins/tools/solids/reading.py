"""Read the tree of a solid from JSON that a model wrote, and write it back. Nothing is built yet.

Everything that decides how long building takes is limited here: nodes, depth, points, sizes.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
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
    read_number,
    read_numbers,
    rounded,
)

MAX_CHARACTERS = 20_000  # of a component's solid
MAX_NODES = 40  # of a tool
MAX_DEPTH = 8
MAX_POINTS = 48  # of an outline
MAX_HULL_POINTS = 128
MAX_SIZE_M = 1.0
_SAME = 1e-6  # share of an outline's area
_PINCHED_MM = 1e-3  # an outline that is thinner somewhere touches itself
FULL_TURN = round(math.tau, DIGITS)

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
    """A primitive, or what is made of children; metres and radians. Equal nodes make equal solids."""

    kind: str
    sizes: tuple[
        float, ...
    ] = ()  # of a primitive; the height of an extrusion, the angle of a revolution
    points: tuple[tuple[float, ...], ...] = ()
    children: tuple[Node, ...] = ()
    at: tuple[float, ...] = (
        0.0,
    ) * 6  # x, y, z, roll, pitch, yaw in the parent's frame


def dump_node(node: Node) -> dict[str, Any]:
    """Write a tree as JSON values."""
    content: Any = rounded(node.sizes)
    if node.kind in OPERATIONS:
        content = [dump_node(child) for child in node.children]
    elif node.points:
        content = [rounded(point) for point in node.points]
    data: dict[str, Any] = {node.kind: content}
    if node.kind in _EXTRA and node.sizes != (FULL_TURN,):
        data |= dict.fromkeys(_EXTRA[node.kind], rounded(node.sizes)[0])
    if any(node.at):
        data["at"] = rounded(node.at if any(node.at[3:]) else node.at[:3])
    return data


class TreeReader:
    """Reads the solids of one tool; counts their nodes."""

    def __init__(self) -> None:
        self._nodes = 0

    def read(self, value: object, where: str) -> Node:
        """Read a solid from JSON text, or from the values in it.

        Raises:
            DesignError: says what is wrong, where, and how to mend it.
        """
        if isinstance(value, str):
            if len(value) > MAX_CHARACTERS:
                raise DesignError(
                    f"{where} is {len(value)} characters long; at most {MAX_CHARACTERS} are allowed"
                )
            try:
                value = json.loads(value)
            except json.JSONDecodeError as error:
                raise DesignError(
                    f"{where} is malformed JSON at column {error.colno}: {error.msg}"
                ) from error
            except (ValueError, RecursionError) as error:
                raise DesignError(
                    f"{where}: its JSON has a number of too many digits, or nests too deep"
                ) from error
        return self._node(value, where, 1)

    def _node(self, value: object, where: str, depth: int) -> Node:
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
        named = [name for name in _KINDS if name in value]
        if len(named) != 1:
            found = (
                " and ".join(named)
                or ", ".join(shorten(str(key)) for key in list(value)[:3])
                or "nothing"
            )
            raise DesignError(
                f"{where} must have exactly one of {', '.join(_KINDS)}; it has {found}"
            )
        (name,) = named
        check_keys(value, {name, "at", *_EXTRA.get(name, ())}, where)
        content = value[name]
        where = f"{where}: {name}"
        at = _read_pose(value.get("at"), f"{where}: at")
        if name in OPERATIONS:
            if not isinstance(content, list) or len(content) < 2:
                raise DesignError(f"{where} must be a list of two or more shapes")
            if self._nodes + len(content) > MAX_NODES:
                raise DesignError(
                    f"{where} has {len(content)} shapes; a tool may have {MAX_NODES} in all"
                )
            children = (
                self._node(child, f"{where} {k}", depth + 1)
                for k, child in enumerate(content, start=1)
            )
            return Node(name, children=tuple(children), at=at)
        if name in SIZES:
            return Node(name, _read_sizes(content, name, where), at=at)
        if name == "hull":
            return Node(
                name, points=_read_points(content, 3, 4, MAX_HULL_POINTS, where), at=at
            )
        points = _read_points(content, 2, 3, MAX_POINTS, where)
        _check_outline(np.array(points), where)
        if name == "extrude":
            return Node(
                name,
                (_read_size(value.get("height"), f"{where}: height"),),
                points,
                at=at,
            )
        if min(r for r, _ in points) < 0:
            raise DesignError(
                f"{where}: its points are [r, z] with r from 0, the distance from the z axis"
            )
        angle = read_number(value.get("angle", FULL_TURN), f"{where}: angle")
        if not 0.01 <= angle <= FULL_TURN + 1e-4:
            raise DesignError(
                f"{where}: angle must be between 0.01 and {FULL_TURN} radians, a full turn"
            )
        return Node(name, (round(min(angle, FULL_TURN), DIGITS),), points, at=at)


def _read_pose(value: object, where: str) -> tuple[float, ...]:
    if value is None:
        return (0.0,) * 6
    count = 6 if isinstance(value, list) and len(value) > 3 else 3
    numbers = [
        round(number, DIGITS) + 0.0
        for number in read_numbers(value, count, f"{where}, x, y, z and rpy if any,")
    ]
    if max(map(abs, numbers[:3])) > MAX_SIZE_M:
        raise DesignError(f"{where} is more than {MAX_SIZE_M:g} m away")
    return (*numbers, *[0.0] * (6 - count))


def _read_size(value: object, where: str, least: float = MIN_SIDE_M) -> float:
    size = round(read_number(value, where), DIGITS)
    if not least <= size <= MAX_SIZE_M:
        raise DesignError(
            f"{where} is {size:g} m; it must be between {least:g} and {MAX_SIZE_M:g} m"
        )
    return size


def _read_sizes(content: object, name: str, where: str) -> tuple[float, ...]:
    names = SIZES[name]
    if name == "sphere" and not isinstance(content, list):
        content = [content]
    numbers = read_numbers(content, len(names), f"{where} [{', '.join(names)}]")
    least = [0.0 if size == "top radius" else MIN_SIDE_M for size in names]
    sized = zip(numbers, names, least, strict=True)
    return tuple(
        _read_size(number, f"{where}: {size}", smallest)
        for number, size, smallest in sized
    )


def _read_points(
    content: object, count: int, fewest: int, most: int, where: str
) -> tuple[tuple[float, ...], ...]:
    if not isinstance(content, list) or not fewest <= len(content) <= most:
        found = (
            f"a list of {len(content)}" if isinstance(content, list) else kind(content)
        )
        raise DesignError(
            f"{where} must be a list of {fewest} to {most} points, not {found}"
        )
    points = [
        read_numbers(point, count, f"{where}: point {k}")
        for k, point in enumerate(content, start=1)
    ]
    if np.abs(points).max() > MAX_SIZE_M:
        raise DesignError(f"{where}: a point is more than {MAX_SIZE_M:g} m away")
    return tuple(
        tuple(round(number, DIGITS) + 0.0 for number in point) for point in points
    )


def _check_outline(points: Array, where: str) -> None:
    """Refuse outlines that cross themselves, or have no area."""
    x, y = 1000 * points.T
    area = abs(float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))) / 2
    if area < (1000 * MIN_SIDE_M) ** 2:
        raise DesignError(
            f"{where}: its outline has an area of {area:.3g} mm^2; give its corners in order"
        )
    filled = CrossSection(
        [1000 * points], FillRule.EvenOdd
    )  # where it crosses itself, less of it is filled
    if (
        abs(filled.area() - area) > _SAME * area
        or len(filled.offset(-_PINCHED_MM).decompose()) != 1
    ):
        raise DesignError(
            f"{where}: its outline crosses or touches itself; list its corners in order"
        )
