"""Write where the bodies of a layout are at the start, and what they are like."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import groupby

import numpy as np

from core.geometry import Array, Pose, Primitive, Sphere
from core.interfaces import Task
from core.robot.solids import Solid, signed_distance, solid_geometry
from core.scene import Body, Soft
from core.support.text import short_number, short_numbers
from plugins.vlms.context.bodies_table import bounds, bounds_in_world
from plugins.vlms.context.phrases import phrase, table

_ALIKE = 3  # bodies alike, one after the other, from which on they share a row
_HOLLOW = (
    3  # parts of a hollow body, and sides on which they bound its middle, at least
)
_STEP_M = 0.0005
_UPRIGHT_RAD = 0.001
_HEAD = ("body", "position", "shape", "x", "y", "z", "mass", "friction")


def layout_table(task: Task, seed: int, *, worded: bool = False) -> str:
    """Write a row for each body of a layout: position, turn, shape, extent in the world, mass and friction.

    Lengths are rounded to a millimetre. Bodies that differ in pose alone share a row. Of a hollow body, the row has the
    free space along the axes through its middle. ``worded``: mass and friction are words.

    Args:
        task: whose scene it is.
        seed: of the layout.
        worded: whether mass and friction are words.
    """
    rows = []
    for _, group in groupby(task.scene(seed).bodies, _collect_properties):
        bodies = list(group)
        if len(bodies) >= _ALIKE:
            rows.append(_write_row(bodies, worded))
        else:
            rows += [_write_row([body], worded) for body in bodies]

    return table(_HEAD, rows)


def _write_row(bodies: Sequence[Body], worded: bool) -> tuple[str, ...]:
    """Write the row of one body, or of bodies alike.

    Args:
        bodies: which differ in pose alone.
        worded: whether mass and friction are words.
    """
    first = bodies[0]
    is_alone = len(bodies) == 1
    name = first.name
    if not is_alone:
        name = f"{len(bodies)} alike: {first.name} ... {bodies[-1].name}"

    places = []
    for body in bodies:
        rpy = body.pose.rpy.round(3) + 0.0
        place = phrase("layout", "pose", body.pose.position, rpy, short_numbers)
        places.append(place)

    lows, highs = bounds_in_world(bodies)

    extents = [short_numbers(span, 3, " to ") for span in zip(lows, highs, strict=True)]

    mass = "fixed"
    if first.mass:
        mass = (
            phrase("bodies", "weight", first.mass) if worded else f"{first.mass:.3g} kg"
        )

    friction = phrase("bodies", "slip", first)
    if not worded:
        friction = phrase("layout", "friction", first)

    return (
        name,
        "; ".join(places),
        _describe_body(first, is_alone),
        *extents,
        mass,
        friction,
    )


def _collect_properties(body: Body) -> tuple[object, ...]:
    """Return the properties that bodies of one row share."""
    parts = [
        (part.shape.describe(), part.pose) for part in body.collisions or body.visuals
    ]

    substance = body.elastic if isinstance(body, Soft) else bool(body.collisions)
    return (
        substance,
        tuple(parts),
        body.mass,
        body.friction,
        body.rolling_friction,
        body.restitution,
        body.surface,
    )


def _describe_body(body: Body, is_alone: bool) -> str:
    """Describe a body's collision shapes, or a soft body; ``is_alone``: it has its row to itself.

    Args:
        body: rigid or soft.
        is_alone: whether the row is about this body alone.
    """
    if isinstance(body, Soft):
        size = short_numbers(np.ptp(body.form.nodes, axis=0), 3)
        return phrase("layout", "soft", body, size)

    if not body.collisions:
        return "a mark: nothing touches it"

    first = body.collisions[0].shape
    if len(body.collisions) == 1 and isinstance(first, Primitive):
        return first.describe()

    counts = Counter(type(part.shape) for part in body.collisions)
    text = " + ".join(kind.count(number) for kind, number in counts.items())
    low, high = bounds(body, Pose())
    if not (_is_upright(body) and is_alone):
        text += f", {short_numbers(high - low, 3)} along its own axes"

    return text + _describe_inside(body, low, high)


def _is_upright(body: Body) -> bool:
    """Report whether a body's axes are the world's."""
    return float(np.abs(body.pose.rpy).max()) <= _UPRIGHT_RAD


def _describe_inside(body: Body, low: Array, high: Array) -> str:
    """Describe the free space through the middle of a hollow body, between its corners (3,) in its own frame.

    Args:
        body: of one shape or more.
        low: the lowest corner of its bounds.
        high: the highest corner of its bounds.
    """
    inside = _Inside(body, low, high)
    if len(body.collisions) < _HOLLOW or inside.clearance(inside.middle) <= 0:
        return ""

    text = ", ".join(inside.describe_axis(axis) for axis in range(3))
    if text.count("open") > 6 - _HOLLOW:
        return ""

    frame = "" if _is_upright(body) else " in its own frame"
    return f"; hollow, free through its middle{frame}: {text}"


class _Inside:
    """The free space in a body, found by steps that are as long as it is clear around.

    Found by sphere tracing: a point that is clear by a distance can go as far along an axis without meeting anything.

    Attributes:
        middle: of the body's bounds in its own frame, (3,).
    """

    def __init__(self, body: Body, low: Array, high: Array) -> None:
        self.middle = (low + high) / 2
        self._low = low
        self._high = high
        self._shift = body.pose.position if _is_upright(body) else np.zeros(3)
        self._solids = []

        for part in body.collisions:
            self._solids.append(Solid("", solid_geometry(part.shape), part.pose))

    def clearance(self, point: Array) -> float:
        """Measure how far a point (3,) is from the body's shapes, metres."""
        dot = Solid("", solid_geometry(Sphere(1e-6)), Pose(point))
        return min(signed_distance(dot, solid) for solid in self._solids)

    def describe_axis(self, axis: int) -> str:
        """Say from where to where it is free along an axis through the middle."""
        return f"{'xyz'[axis]} {self._find_end(axis, -1)} to {self._find_end(axis, 1)}"

    def _find_end(self, axis: int, sign: int) -> str:
        """Go from the middle along an axis until a shape is met; ``open``: none is, up to the body's bounds.

        Args:
            axis: number of the body's own axis.
            sign: which way along it.
        """
        point = self.middle.copy()
        while self._low[axis] < point[axis] < self._high[axis]:
            gap = self.clearance(point)
            if gap <= _STEP_M:
                return short_number((point + self._shift)[axis], 3)

            point[axis] += sign * gap

        return "open"
