"""Vary designs: mutate and cross the values of those that were made here, and the numbers of all others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.random import Generator

from core.design import Candidate
from core.geometry import Array
from core.interfaces import Brief, Numbers
from plugins.vlms.offline.recipe import SHAFTS, Mount, Recipe, Values
from plugins.vlms.offline.ways.way import Ranges

_SPREAD = 0.15  # the deviation of a change, in widths of its parameter's range
_CHANGED = 0.3  # of the parameters, in a mutation
_SHIFT_M = 0.15  # the deviation of a mount's shift,
_TURN_RAD = 0.9  # and of its turn
_RESHAFT = 0.1  # how often a mount gets another shaft, for a scale of 1
_VARIES_TOOL = 0.5  # how often the tool of a stranger is varied, beside the plan
_STEPS = 4.0  # the deviation of a shift, in steps of its number


def mutate(
    values: Values, ranges: Ranges, scale: float, rng: Generator
) -> dict[str, float]:
    """Change some of the parameters by a little.

    A value stays within its range.

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
            changed[name] = float(np.clip(value, low, high))

    return changed


def mutate_mount(mount: Mount, scale: float, rng: Generator) -> Mount:
    """Shift or turn a mount by a little, and at times have another kind of shaft carry the head."""
    deviations = np.array([_SHIFT_M, _SHIFT_M, _SHIFT_M, _TURN_RAD])
    chosen = rng.random(4) < _CHANGED
    x, y, z, yaw = (rng.normal(0.0, scale * deviations) * chosen).tolist()
    shaft = mount.shaft
    if rng.random() < _RESHAFT * scale:
        shaft = SHAFTS[int(rng.integers(len(SHAFTS)))]

    return Mount(mount.x + x, mount.y + y, mount.z + z, mount.yaw + yaw, shaft)


def mutate_recipe(
    recipe: Recipe, ranges: Ranges, scale: float, rng: Generator
) -> Recipe:
    """Change some of the parameters of a design, and where its head is; see `mutate`."""
    mount = recipe.mount
    if mount is not None:
        mount = mutate_mount(mount, scale, rng)
    return Recipe(mutate(recipe.values, ranges, scale, rng), mount)


def cross(first: Recipe, second: Recipe, rng: Generator) -> Recipe:
    """Take each parameter from one of two designs of a way, and the mount from one of them."""
    crossed = dict(first.values)
    for name, value in second.values.items():
        if rng.random() < 0.5:
            crossed[name] = value

    mount = first.mount if rng.random() < 0.5 else second.mount
    return Recipe(crossed, mount)


def vary_numbers(
    stranger: Candidate, brief: Brief, scale: float, rng: Generator, *, is_given: bool
) -> Candidate:
    """Move some numbers of a tool's components and of a plan's waypoints.

    Args:
        stranger: a candidate of other origin.
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

    if tool is not None and not is_given and rng.random() < _VARIES_TOOL:
        numbers = tools.parameters(tool)
        if len(numbers):
            tool = tools.with_parameters(tool, _move(numbers, scale, rng))

    plan = stranger.plan
    numbers = actions.parameters(plan)
    if len(numbers):
        plan = actions.with_parameters(plan, _move(numbers, scale, rng))

    return replace(stranger, tool=tool, plan=plan)


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
