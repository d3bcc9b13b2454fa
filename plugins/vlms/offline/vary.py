"""Vary designs: mutate and cross the values of those that were made here, and the numbers of all others."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from core.design import Tool
from core.geometry import Array
from core.interfaces import ActionPlan, Brief, Numbers
from plugins.vlms.offline.mounting import MOUNT_RANGES
from plugins.vlms.offline.ways.way import Range, Values

_SPREAD = 0.15  # the deviation of a change, in widths of its parameter's range
_CHANGED = 0.3  # of the parameters, in a mutation
_VARIES_TOOL = 0.5  # how often the tool of a stranger is varied, beside the plan
_STEPS = 4.0  # the deviation of a shift, in steps of its number


def mutate(
    values: Values, ranges: Mapping[str, Range], scale: float, rng: Generator
) -> dict[str, float]:
    """Change some of the parameters by a little.

    A value stays within its range; one that is outside of it, as those of mounts may be drawn, gets no farther out.

    Args:
        values: of all parameters.
        ranges: of those that may change.
        scale: of the changes, 0 to 1.
        rng: random numbers.
    """
    names = list(ranges)
    chosen = rng.random(len(names)) < _CHANGED
    chosen[rng.integers(len(names))] = True
    changed = dict(values)

    for name, is_chosen in zip(names, chosen, strict=True):
        before = values[name]
        low, high = ranges[name]
        value = before + rng.normal(0.0, _SPREAD * scale * (high - low))
        if is_chosen:
            changed[name] = float(np.clip(value, min(low, before), max(high, before)))

    return changed


def cross(first: Values, second: Values, rng: Generator) -> dict[str, float]:
    """Take each parameter from one of two designs of a way; the mount's all from the same."""
    takes_mount = rng.random() < 0.5
    crossed = dict(first)
    for name in first:
        takes = takes_mount if name in MOUNT_RANGES else rng.random() < 0.5
        if takes:
            crossed[name] = second[name]

    return crossed


@dataclass(frozen=True, eq=False)
class Stranger:
    """A candidate of other origin, whose numbers may be varied.

    Attributes:
        tool: of the candidate.
        plan: of the candidate.
    """

    tool: Tool
    plan: ActionPlan


def vary_numbers(
    stranger: Stranger,
    brief: Brief,
    scale: float,
    rng: Generator,
    *,
    is_given: bool,
) -> Stranger:
    """Move some numbers of a tool's components and of a plan's waypoints.

    Args:
        stranger: what is varied.
        brief: whose representations know the numbers.
        scale: of the changes, 0 to 1.
        rng: random numbers.
        is_given: whether the tool stays as it is.

    Raises:
        DesignError: there is no such design.
    """
    tool = stranger.tool
    tools = brief.representation
    actions = brief.actions

    if not is_given and rng.random() < _VARIES_TOOL:
        numbers = tools.parameters(tool)
        if len(numbers):
            tool = tools.with_parameters(tool, _move(numbers, scale, rng))

    plan = stranger.plan
    numbers = actions.parameters(plan)
    if len(numbers):
        plan = actions.with_parameters(plan, _move(numbers, scale, rng))

    return Stranger(tool, plan)


def _move(numbers: Numbers, scale: float, rng: Generator) -> Array:
    """Shift one coordinate of neighbouring points of one table, all by as much, and return all values.

    Args:
        numbers: of a tool or a plan: tables of points, a row each, one table after another.
        scale: of the shift, 0 to 1.
        rng: random numbers.
    """
    counts = [points * width for points, width in numbers.shapes]
    ends = np.cumsum(counts)
    table = int(np.searchsorted(ends, rng.integers(ends[-1]), side="right"))
    begin = ends[table] - counts[table]

    points, width = numbers.shapes[table]
    first = int(rng.integers(points))
    last = int(rng.integers(first, points))
    coordinate = rng.integers(width)
    chosen = begin + np.arange(first, last + 1) * width + coordinate

    moved = numbers.values.copy()
    moved[chosen] += rng.normal(0.0, _STEPS * scale) * numbers.steps[chosen]
    return np.clip(moved, numbers.lower, numbers.upper)
