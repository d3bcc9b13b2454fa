"""Vary one or two numbers of a design over ranges, as a model asks for: what would have come of another yaw?

A design may have a ``curve``: a list of one or two `Axis`. Its values are added to places, turns or sizes of the
design, and each design so made is a candidate like any other.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from core.design import Candidate, Component, DesignError, Varied
from core.geometry import Pose
from core.support.inputs import FIELDS, check
from core.values.plans import ActionPlan, Waypoints

CURVE = "curve"
"""The field of a design."""

COORDINATES = ("x", "y", "z", "roll", "pitch", "yaw")
SIZES = ("size_x", "size_y", "size_z")
MOST = 2
"""Axes of a curve."""

Value = Annotated[float, Field(ge=-10, le=10, allow_inf_nan=False)]


@dataclass(frozen=True, config=FIELDS)
class Axis:
    """A number that is varied.

    Attributes:
        add_to: which: a coordinate, or a size of a component.
        low: the least that is added, m or rad, and ``high``: the most.
        component: whose; empty: that of waypoints.
        waypoints: which, from 1; none: all.
    """

    add_to: Literal["x", "y", "z", "roll", "pitch", "yaw", "size_x", "size_y", "size_z"]
    low: Value
    high: Value
    component: str = ""
    waypoints: tuple[int, ...] = ()

    def __str__(self) -> str:
        if self.component:
            return f"{self.component} {self.add_to}"
        where = ", ".join(map(str, self.waypoints)) or "all"
        return f"waypoints {where} {self.add_to}"


def curve_schema() -> dict[str, Any]:
    """Return the JSON schema of a design's curve; an empty list asks for none."""
    number = {"type": "number"}
    axis = {
        "add_to": {"type": "string", "enum": [*COORDINATES, *SIZES]},
        "low": number,
        "high": number,
        "component": {"type": "string"},
        "waypoints": {"type": "array", "items": {"type": "integer"}},
    }
    item = {
        "type": "object",
        "properties": axis,
        "required": [*axis],
        "additionalProperties": False,
    }
    return {"type": "array", "items": item, "maxItems": MOST}


def read_curve(design: object) -> list[Axis]:
    """Read the axes of a design's curve as it is written; none: it asks for no curve.

    Raises:
        DesignError: they can't be read.
    """
    written = design.get(CURVE) if isinstance(design, dict) else None
    if not written:
        return []

    axes = check(list[Axis], written, CURVE, DesignError)
    if len(axes) > MOST:
        raise DesignError(f"{CURVE}: at most {MOST} numbers are varied at once")

    return axes


def vary(base: Candidate, axes: Sequence[Axis], count: int) -> Iterator[Candidate]:
    """Yield the designs of a curve: of one axis ``count``, of two a grid of about as many.

    Each has the base's id and numbers, and says what was added to it (`Candidate.varied`).

    Raises:
        DesignError: the design has no such number.
    """
    shape = [count] if len(axes) == 1 else _divide(count)
    steps = [
        np.linspace(axis.low, axis.high, points)
        for axis, points in zip(axes, shape, strict=True)
    ]
    names = tuple(map(str, axes))

    for added in zip(*(grid.ravel() for grid in np.meshgrid(*steps)), strict=True):
        made = base
        for axis, value in zip(axes, added, strict=True):
            made = _add(made, axis, float(value))
        values = tuple(round(float(value), 4) for value in added)
        yield replace(made, varied=Varied(base.id, names, values))


def _divide(count: int) -> list[int]:
    """Divide so many points between two axes."""
    first = max(2, int(np.sqrt(count) + 0.5))
    return [first, max(2, count // first)]


def _add(candidate: Candidate, axis: Axis, value: float) -> Candidate:
    """Add a value to one number of a design, or to the same number of several waypoints."""
    if axis.component:
        return replace(candidate, tool=_add_to_tool(candidate, axis, value))
    return replace(candidate, plan=_add_to_plan(candidate.plan, axis, value))


def _add_to_plan(plan: ActionPlan, axis: Axis, value: float) -> ActionPlan:
    if not isinstance(plan, Waypoints) or axis.add_to not in COORDINATES:
        raise DesignError(
            f"{CURVE}: {axis}: of waypoints it adds to {', '.join(COORDINATES)}, and they are literal ones"
        )

    rows = [number - 1 for number in axis.waypoints] or [*range(len(plan))]
    if not all(0 <= row < len(plan) for row in rows):
        raise DesignError(f"{CURVE}: {axis}: the plan has waypoints 1 to {len(plan)}")

    poses = plan.poses.copy()
    poses[rows, COORDINATES.index(axis.add_to)] += value
    return replace(plan, poses=poses)


def _add_to_tool(candidate: Candidate, axis: Axis, value: float) -> Any:
    tool = candidate.tool
    parts = () if tool is None else tool.components
    if tool is None or axis.component not in [part.name for part in parts]:
        known = ", ".join(part.name for part in parts)
        raise DesignError(f"{CURVE}: {axis}: the tool's components are {known}")

    changed = tuple(
        _change(part, axis, value) if part.name == axis.component else part
        for part in parts
    )
    return replace(tool, components=changed, written=("", ""))


def _change(part: Component, axis: Axis, value: float) -> Component:
    """Move, turn or resize a component on its parent."""
    if axis.add_to in SIZES:
        sides = part.shape.bounds[1].copy()
        sides[SIZES.index(axis.add_to)] += value
        if sides.min() <= 0:
            raise DesignError(f"{CURVE}: {axis}: no side is left at {value:g}")
        return replace(part, shape=part.shape.resized(sides))

    numbers = np.concatenate([part.pose.position, part.pose.rpy])
    numbers[COORDINATES.index(axis.add_to)] += value
    return replace(part, pose=Pose.xyz_rpy(numbers[:3], numbers[3:]))
