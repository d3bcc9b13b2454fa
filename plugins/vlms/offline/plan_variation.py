"""Carry the plan of a parent over to its offspring, and vary it.

A plan's stroke is its last long straight motion on the level, with which it does its work. A variation makes the stroke
longer or shorter, slower or faster, or shifts, raises or turns waypoints. Where it is known how far bodies were moved,
the stroke may be made longer by what was missing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator
from scipy.spatial.transform import Rotation

from core.design import DesignError, Tool
from core.geometry import Array
from plugins.vlms.offline.chance import Range, draw
from plugins.vlms.offline.parents import Parent
from plugins.vlms.offline.paths import SampledPlan
from plugins.vlms.offline.sampler import Sampler
from plugins.vlms.offline.scene_analysis import SceneAnalysis
from plugins.vlms.offline.subgoals import goal_position
from plugins.vlms.offline.tool_parts import guess_head, lowest_middle, working_part

_LONG_M = 0.035  # a straight motion that is longer is a stroke
_LEVEL_M = 0.01  # a stroke rises by less than half its length, and this
_STRAIGHT = 0.9  # the cosine of the largest turn within a stroke
_KINDS = {
    "length": 0.2,
    "shift": 0.25,
    "height": 0.15,
    "yaw": 0.1,
    "slower": 0.05,
    "faster": 0.05,
}
"""How often a plan is varied in each way, in relation to the others."""

_MEASURED = 0.25  # and by what was measured, where something was
_MISSED_M = 0.001  # what bodies lacked at their goal, at least, that is worth it
_LONG_ENOUGH_M = 0.02  # a shorter stroke says nothing of how far bodies go with it
_MISSING = Range(0.6, 1.2)  # of what was missing: bodies slide on, or yield
# How often it is added, or taken away: bodies may have come from the other side.
_AHEAD = [0.8, 0.2]
# The standard deviations of variations of the scale 1.
_LENGTHS_M = 0.08
_SHIFTS_M = 0.02
_SHIFTS = np.array([1.0, 1.0, 0.2])  # less in height: heads are as low as they can be
_HEIGHTS_M = 0.02
_TURNS_RAD = 0.2
_YAW = 5  # its column in a waypoint
_MOST_ROWS = 60  # of a plan that gets waypoints added


def make_offspring_plans(
    parent: Parent,
    tool: Tool,
    count: int,
    sampler: Sampler,
) -> list[SampledPlan]:
    """Make plans for a tool that was derived from its parent's.

    They are the parent's plan fitted to the tool, variations of it, and a fresh one at times.

    Args:
        parent: whose plan is varied.
        tool: of the offspring, or the parent's own.
        count: of plans.
        sampler: of fresh plans.
    """
    rng = sampler.rng
    part = working_part(tool, sampler.brief.task)
    fitted = _fit(parent, part, sampler)

    plans: list[SampledPlan] = []

    for number in range(count):
        is_last = 0 < number == count - 1
        if is_last and rng.random() < parent.scale:
            plans.append(
                sampler.use(tool, lambda subgoal: guess_head(part, subgoal, rng))
            )
            continue

        changes = rng.integers(1, 3) if number > 0 else rng.integers(0, 2)
        plan = fitted

        for _ in range(int(changes)):
            plan = vary(plan, parent, sampler.analysis, rng)

        plans.append(plan if _can_be_written(plan, sampler) else fitted)

    return plans


def _fit(
    parent: Parent,
    part: Tool,
    sampler: Sampler,
) -> SampledPlan:
    """Fit the parent's plan to a part of a tool, whose lowest boxes move as those of the parent's did.

    Args:
        parent: whose plan it is.
        part: of the new tool, the one that does the task.
        sampler: which knows the task.
    """
    before = lowest_middle(working_part(parent.tool, sampler.brief.task))
    offset = before - lowest_middle(part)

    rows = parent.rows.copy()
    rows[:, :3] += Rotation.from_euler("xyz", rows[:, 3:6]).apply(offset)

    return SampledPlan(rows, "the parent's plan", parent.anchors)


def _can_be_written(plan: SampledPlan, sampler: Sampler) -> bool:
    """Report whether a plan can be written: one that leads too far away can't."""
    try:
        sampler.writer.write(plan.rows, plan.anchors)
    except DesignError:
        return False

    return True


@dataclass(frozen=True, eq=False)
class _Stroke:
    """The last straight motion of a plan that is long and nearly level.

    Attributes:
        start: the number of its first waypoint.
        end: the number of its last waypoint.
        way: from the first to the last, (3,).
        length: of the way, metres.
    """

    start: int
    end: int
    way: Array
    length: float


def _find_stroke(rows: Array) -> _Stroke:
    """Find the last straight motion of a plan, (N, 6) or (N, 7); a plan without one has its last segment."""
    ways = np.diff(rows[:, :3], axis=0)
    lengths = np.linalg.norm(ways, axis=1)
    level = np.flatnonzero(lengths > 2 * np.abs(ways[:, 2]) + _LEVEL_M).tolist()

    start = max(0, len(rows) - 2)
    end = len(rows) - 1

    if level:
        last = max([i for i in level if lengths[i] > _LONG_M] or level)
        start = last

        while start - 1 in level:
            along = ways[start - 1] @ ways[last]
            if along <= _STRAIGHT * lengths[start - 1] * lengths[last]:
                break

            start -= 1

        end = last + 1

    way = rows[end, :3] - rows[start, :3]

    return _Stroke(start, end, way, float(np.linalg.norm(way)))


def vary(
    plan: SampledPlan,
    parent: Parent,
    analysis: SceneAnalysis,
    rng: Generator,
) -> SampledPlan:
    """Change a plan at random, by the parent's scale, and keep an anchor for each waypoint.

    A change that is measured makes up for what the parent's bodies fell short by.

    Args:
        plan: of the parent, or a variation of it.
        parent: the better it was, the smaller the change.
        analysis: of the layout that the plan is in.
        rng: random numbers.
    """
    stroke = _find_stroke(plan.rows)
    missing = _measure_missing(parent, analysis)
    kinds = dict(_KINDS)

    if abs(missing) > _MISSED_M and stroke.length > _LONG_ENOUGH_M:
        kinds["measure"] = _MEASURED

    scale = parent.scale
    rows = plan.rows.copy()

    match draw(kinds, rng):
        case "length":
            change = _lengthen(rows, stroke, rng.normal(0.0, _LENGTHS_M * scale))

        case "measure":
            share = _MISSING.draw(rng) * rng.choice([1.0, -1.0], p=_AHEAD)
            change = _lengthen(rows, stroke, missing * share)

        case "shift":
            shift = rng.normal(0.0, _SHIFTS_M * scale, 3) * _SHIFTS
            rows[:, :3] += shift
            change = f"shifted by {np.linalg.norm(shift) * 1000:.1f} mm"

        case "height":
            rise = rng.normal(0.0, _HEIGHTS_M * scale)
            rows[rng.integers(0, max(1, stroke.start + 1)) :, 2] += rise
            higher = "higher" if rise > 0 else "lower"
            change = f"from some waypoint on {abs(rise) * 1000:.1f} mm {higher}"

        case "yaw":
            turn = rng.normal(0.0, _TURNS_RAD * scale)
            rows[:, _YAW] += turn
            change = f"turned by {np.degrees(turn):.1f} degrees"

        case "slower" if len(rows) < _MOST_ROWS:
            return _slow_down(plan, stroke)

        case _:
            return _speed_up(plan, stroke)

    return SampledPlan(rows, f"{plan.text}, {change}", plan.anchors)


def _lengthen(
    rows: Array,
    stroke: _Stroke,
    more: float,
) -> str:
    """Lengthen the stroke in the rows by ``more`` metres, and say so; what comes after it goes along.

    Args:
        rows: waypoints, which are changed.
        stroke: of the plan.
        more: negative to shorten it.
    """
    steps = np.arange(len(rows)) - stroke.start
    shares = np.clip(steps / max(1, stroke.end - stroke.start), 0.0, 1.0)
    rows[:, :3] += shares[:, None] * more * stroke.way / max(stroke.length, 1e-6)
    longer = "longer" if more > 0 else "shorter"

    return f"its stroke {longer} by {abs(more) * 1000:.1f} mm"


def _slow_down(plan: SampledPlan, stroke: _Stroke) -> SampledPlan:
    """Add a waypoint halfway between each two of the stroke."""
    whole = [(i, i) for i in range(len(plan.rows))]
    halves = [(i, i + 1) for i in range(stroke.start, stroke.end)]
    text = f"{plan.text}, its stroke at half the speed"

    return _resample(plan, sorted(whole + halves), text)


def _speed_up(plan: SampledPlan, stroke: _Stroke) -> SampledPlan:
    """Leave out every second waypoint within the stroke."""
    left_out = range(stroke.start + 1, stroke.end, 2)
    kept = [(i, i) for i in range(len(plan.rows)) if i not in left_out]

    return _resample(plan, kept, f"{plan.text}, its stroke with fewer waypoints")


def _resample(
    plan: SampledPlan,
    pairs: Sequence[tuple[int, int]],
    text: str,
) -> SampledPlan:
    """Make a plan of the waypoints halfway between two of a plan each.

    Args:
        plan: of any length.
        pairs: numbers of waypoints, in the order of the new plan; equal ones keep a waypoint.
        text: of the new plan.
    """
    anchors = []
    for i, j in pairs:
        before = plan.anchors[i]
        anchor = plan.anchors[j]

        if (before.name, before.toward) == (anchor.name, anchor.toward):
            anchor = replace(anchor, share=(before.share + anchor.share) / 2)

        anchors.append(anchor)

    first, second = np.transpose(pairs)
    rows = (plan.rows[first] + plan.rows[second]) / 2

    return SampledPlan(rows, text, anchors)


def _measure_missing(parent: Parent, analysis: SceneAnalysis) -> float:
    """Measure by how much the parent's bodies fell short on average, metres (negative: went too far); 0 if unknown.

    Args:
        parent: which moved bodies.
        analysis: which says how far they should go; of several goals that with the least miss counts.
    """
    options = []
    for goal in analysis.goals:
        if not goal.place:
            continue

        missing = []
        for name in goal.bodies:
            if name in parent.moved_m:
                here = analysis.model.solids[name].position
                way = goal_position(here, goal) - here
                missing.append(float(np.linalg.norm(way)) - parent.moved_m[name])

        if missing:
            options.append(min(missing) if goal.any else float(np.mean(missing)))

    return min(options, key=abs, default=0.0)
