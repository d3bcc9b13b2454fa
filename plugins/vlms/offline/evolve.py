"""Breed offspring of elites: mutate and cross tools, and carry the elites' plans over to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import Evaluation, Tool
from core.geometry import Array
from core.interfaces import Anchor, Seen
from plugins.vlms.offline.invent import Use, Workshop
from plugins.vlms.offline.mutation import cross, mutate, slimmed
from plugins.vlms.offline.scene_analysis import SceneAnalysis
from plugins.vlms.offline.tools import middle, recognize

_TRIES = 12


@dataclass(frozen=True, eq=False)
class Elite:
    """The parts of an evaluation that breeding needs."""

    id: str
    tool: Tool
    plan: Array
    anchors: Sequence[Anchor]
    reward: float
    moved_m: dict[str, float]

    @property
    def scale(self) -> float:
        """The scale of changes, 0.05 to 1: the better the elite, the smaller."""
        return float(np.clip(1.5 * (1.0 - self.reward), 0.05, 1.0))


def elites_with(evaluations: Sequence[Evaluation], gripper: bool, seen: Seen) -> list[Elite]:
    """The elites with a gripper tool, or those with a rigid one; their plans as they are in this layout."""
    found = []
    for e in evaluations:
        if e.candidate.tool is not None and e.candidate.tool.gripper == gripper:
            rows, anchors = e.candidate.plan.resolve(seen).poses, e.candidate.plan.anchors
            anchors = anchors if len(anchors) == len(rows) else (Anchor(),) * len(rows)
            found.append(Elite(e.candidate.id, e.candidate.tool, rows, anchors, e.reward, e.moved_m))
    return found


def breed(elites: Sequence[Elite], count: int, workshop: Workshop) -> tuple[str, str, Tool, list[Use], list[str]]:
    """One offspring: name, description, tool, ``count`` plans, parents' ids. Better elites are parents more often."""
    rng = workshop.rng
    weights = np.array([max(elite.reward, 0.01) ** 2 for elite in elites])
    weights /= weights.sum()
    for attempt in range(_TRIES):
        first, second = (elites[int(i)] for i in rng.choice(len(elites), 2, p=weights))
        crossing = second is not first and rng.random() < 0.4
        if crossing:
            tool, done = cross(first.tool, second.tool, rng)
        else:
            tool, done = mutate(first.tool, first.scale / (1 + attempt / 3), rng)
        if tool.components != first.tool.components and workshop.accepts(tool):
            break
    else:  # no change keeps the rules
        crossing = False
        tool, done = slimmed(first.tool)
    parents = [first.id, second.id] if crossing else [first.id]
    name = "crossover" if crossing else "mutation"
    base = first.tool.description.split("; changed: ")[0]
    tool = replace(tool, name=first.tool.name, description=f"{base}; changed: {done}")
    description = f"{name.capitalize()} of {' and '.join(parents)}: {done}."
    return f"{name}: {done}", description, tool, offspring_plans(first, tool, count, workshop), parents


def offspring_plans(elite: Elite, tool: Tool, count: int, workshop: Workshop) -> list[Use]:
    """Plans for a tool derived from the elite's: its plan fitted to the tool, variations of it, or fresh ones."""
    rng = workshop.rng
    base = elite.plan.copy()  # the foot of the new tool moves as that of the elite's did
    base[:, :3] += Rotation.from_euler("xyz", base[:, 3:6]).apply(middle(elite.tool) - middle(tool))
    uses: list[Use] = []
    for i in range(count):
        if 0 < i == count - 1 and rng.random() < elite.scale:
            uses.append(workshop.use(tool, lambda errand: recognize(tool, errand, rng)))
            continue
        new, anchors, done = base, elite.anchors, []
        for _ in range(int(rng.integers(1, 3)) if i > 0 else int(rng.integers(0, 2))):
            new, anchors, what = vary(new, anchors, elite, workshop.analysis, rng)
            done.append(what)
        uses.append(Use(new, ", ".join(["the parent's plan", *done]), anchors))
    return uses


def last_stroke(plan: Array) -> tuple[int, int]:
    """First and last row of the last straight stroke that is long and nearly level."""
    ways = np.diff(plan[:, :3], axis=0)
    lengths = np.linalg.norm(ways, axis=1)
    level = [i for i, (way, length) in enumerate(zip(ways, lengths, strict=True)) if length > 2 * abs(way[2]) + 0.01]
    if not level:
        return max(0, len(plan) - 2), len(plan) - 1
    long = [i for i in level if lengths[i] > 0.035]
    end = start = max(long or level)
    while start - 1 in level and ways[start - 1] @ ways[end] > 0.9 * lengths[start - 1] * lengths[end]:
        start -= 1
    return start, end + 1


def vary(
    plan: Array, anchors: Sequence[Anchor], elite: Elite, analysis: SceneAnalysis, rng: np.random.Generator
) -> tuple[Array, Sequence[Anchor], str]:
    """Change a plan at random, by the elite's scale, and keep an anchor for each waypoint."""
    start, end = last_stroke(plan)
    way = plan[end, :3] - plan[start, :3]
    length = float(np.linalg.norm(way))
    missing = _missing(elite, analysis)
    kinds = {"length": 0.2, "shift": 0.25, "height": 0.15, "yaw": 0.1, "slower": 0.05, "faster": 0.05}
    if abs(missing) > 0.001 and length > 0.02:
        kinds["measure"] = 0.25
    weights = np.array(list(kinds.values()))
    new = plan.copy()
    match list(kinds)[int(rng.choice(len(kinds), p=weights / weights.sum()))]:
        case "length" | "measure" as kind:
            if kind == "measure":
                more = missing * rng.uniform(0.6, 1.2) * rng.choice([1.0, -1.0], p=[0.8, 0.2])
            else:
                more = rng.normal(0.0, 0.08 * elite.scale)
            share = np.clip((np.arange(len(plan)) - start) / max(1, end - start), 0.0, 1.0)
            new[:, :3] += share[:, None] * more * way / max(length, 1e-6)
            return new, anchors, f"its stroke {'longer' if more > 0 else 'shorter'} by {abs(more) * 1000:.1f} mm"
        case "shift":
            shift = rng.normal(0.0, 0.02 * elite.scale, 3) * np.array([1.0, 1.0, 0.2])
            new[:, :3] += shift
            return new, anchors, f"shifted by {np.linalg.norm(shift) * 1000:.1f} mm"
        case "height":
            rise = rng.normal(0.0, 0.02 * elite.scale)
            new[rng.integers(0, max(1, start + 1)) :, 2] += rise
            return new, anchors, f"from some waypoint on {abs(rise) * 1000:.1f} mm {'higher' if rise > 0 else 'lower'}"
        case "yaw":
            turn = rng.normal(0.0, 0.2 * elite.scale)
            new[:, 5] += turn
            return new, anchors, f"turned by {np.degrees(turn):.1f} degrees"
        case "slower" if len(plan) < 60:
            halfway = (plan[start:end] + plan[start + 1 : end + 1]) / 2
            more = list(anchors)
            for i in range(end, start, -1):
                before, after = anchors[i - 1 : i + 1]
                is_one = (before.name, before.toward) == (after.name, after.toward)
                more.insert(i, replace(after, share=(before.share + after.share) / 2) if is_one else after)
            new = np.insert(plan, np.arange(start + 1, end + 1), halfway, axis=0)
            return new, more, "its stroke at half the speed"
        case _:
            kept = [i for i in range(len(plan)) if not (start < i < end and (i - start) % 2)]
            return plan[kept], [anchors[i] for i in kept], "its stroke with fewer waypoints"


def _missing(elite: Elite, analysis: SceneAnalysis) -> float:
    """Mean distance in metres by which the elite's bodies fell short (negative: went too far); 0 if unknown."""
    options = []
    for goal in analysis.goals:
        missing = []
        for name in goal.bodies:
            if goal.place is None or name not in elite.moved_m:
                continue
            here = analysis.things[name].position
            wanted = np.array([h if w is None else w for h, w in zip(here, goal.place, strict=True)])
            missing.append(float(np.linalg.norm(wanted - here)) - elite.moved_m[name])
        if missing:
            options.append(min(missing) if goal.any else float(np.mean(missing)))
    return min(options, key=abs, default=0.0)
