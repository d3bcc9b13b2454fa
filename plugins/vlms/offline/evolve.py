"""Breed offspring of elites: mutate and cross tools of any origin, and carry the elites' plans over to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator
from scipy.spatial.transform import Rotation

from core.design import Component, DesignError, Tool
from core.geometry import Array, Box, Pose
from core.interfaces import Anchor, Seen
from core.trial import Evaluation
from plugins.vlms.offline.boxes import Boxes, separations
from plugins.vlms.offline.heads import draw
from plugins.vlms.offline.sampler import SampledPlan, Sampler
from plugins.vlms.offline.scene_analysis import SceneAnalysis, wanted
from plugins.vlms.offline.tools import middle, part_for, recognize

_TRIES = 12
_COLOR = (0.56, 0.35, 0.68, 1.0)  # of added components
_THINNEST_M = 0.001
_OVERLAP_M = 0.0005  # of components that were moved until they touch


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
    """The elites with a gripper tool, or those with a rigid one; their plans as they are in this layout.

    A waypoint that ends by a guard is left out.
    """
    known = {*seen.poses, Anchor().name, Anchor().toward}  # not where a guard ends
    elites = []
    for evaluation in evaluations:
        candidate = evaluation.candidate
        if candidate.tool is None or candidate.tool.gripper != gripper:
            continue
        plan = candidate.plan.resolve(seen)
        anchors = [
            anchor if {anchor.name, anchor.toward} <= known else Anchor()
            for anchor in candidate.plan.anchors or [Anchor()] * len(plan.poses)
        ]
        kept = [i for i in range(len(plan.poses)) if not plan.guards or not plan.guards[i]]
        rows = plan.poses[kept]
        anchors = [anchors[i] for i in kept]
        moved_m = evaluation.shown.moved_m if evaluation.shown is not None else {}
        elites.append(Elite(candidate.id, candidate.tool, rows, anchors, evaluation.reward, moved_m))
    return elites


def breed(elites: Sequence[Elite], count: int, sampler: Sampler) -> tuple[str, str, Tool, list[SampledPlan], list[str]]:
    """One offspring: name, description, tool, ``count`` plans, parents' ids. Better elites are parents more often.

    Where no change keeps the rules, the tool is its parent's.
    """
    rng = sampler.rng
    weights = np.array([max(elite.reward, 0.01) ** 2 for elite in elites])
    for attempt in range(_TRIES):
        first, second = (elites[int(i)] for i in rng.choice(len(elites), 2, p=weights / weights.sum()))
        crossing = second is not first and rng.random() < 0.4
        if crossing:
            tool, done = cross(first.tool, second.tool, rng)
        else:
            tool, done = mutate(first.tool, first.scale / (1 + attempt / 3), rng)
        if tool.components != first.tool.components and sampler.accepts(tool):
            break
    else:
        crossing = False
        tool = first.tool
        done = "other plans"
    parents = [first.id, second.id] if crossing else [first.id]
    name = "crossover" if crossing else "mutation"
    base = first.tool.description.split("; changed: ")[0]
    tool = replace(tool, name=first.tool.name, description=f"{base}; changed: {done}")
    description = f"{name.capitalize()} of {' and '.join(parents)}: {done}."
    return f"{name}: {done}", description, tool, offspring_plans(first, tool, count, sampler), parents


def offspring_plans(elite: Elite, tool: Tool, count: int, sampler: Sampler) -> list[SampledPlan]:
    """Plans for a tool derived from the elite's: its plan fitted to the tool, variations of it, or fresh ones."""
    rng = sampler.rng
    part = part_for(tool, sampler.brief.task)
    apart = middle(part_for(elite.tool, sampler.brief.task)) - middle(part)
    base = elite.plan.copy()  # the foot of the new tool moves as that of the elite's did
    base[:, :3] += Rotation.from_euler("xyz", base[:, 3:6]).apply(apart)
    parent = SampledPlan(base, "the parent's plan", elite.anchors)
    plans: list[SampledPlan] = []
    for i in range(count):
        if 0 < i == count - 1 and rng.random() < elite.scale:
            plans.append(sampler.use(tool, lambda subgoal: recognize(part, subgoal, rng)))
            continue
        plan = parent
        for _ in range(int(rng.integers(1, 3) if i > 0 else rng.integers(0, 2))):
            plan = vary(plan, elite, sampler.analysis, rng)
        try:
            sampler.written(plan.rows, plan.anchors)
        except DesignError:  # it leads too far away
            plan = parent
        plans.append(plan)
    return plans


def _last_straight(rows: Array) -> tuple[int, int]:
    """First and last row of the last straight motion that is long and nearly level."""
    ways = np.diff(rows[:, :3], axis=0)
    lengths = np.linalg.norm(ways, axis=1)
    level = np.flatnonzero(lengths > 2 * np.abs(ways[:, 2]) + 0.01).tolist()
    if not level:
        return max(0, len(rows) - 2), len(rows) - 1
    end = max([i for i in level if lengths[i] > 0.035] or level)
    start = end
    while start - 1 in level and ways[start - 1] @ ways[end] > 0.9 * lengths[start - 1] * lengths[end]:
        start -= 1
    return start, end + 1


def vary(plan: SampledPlan, elite: Elite, analysis: SceneAnalysis, rng: Generator) -> SampledPlan:
    """Change a plan at random, by the elite's scale: a stroke's length, or its place, height or turn."""
    start, end = _last_straight(plan.rows)
    rows = plan.rows.copy()
    match draw({"length": 0.45, "shift": 0.25, "height": 0.15, "yaw": 0.1}, rng):
        case "length":
            more = rng.normal(0.0, 0.08 * elite.scale)
            missing = _missing(elite, analysis)
            if missing and rng.random() < 0.6:
                more = missing * rng.uniform(0.6, 1.2) * rng.choice([1.0, -1.0], p=[0.8, 0.2])
            way = rows[end, :3] - rows[start, :3]
            share = np.clip((np.arange(len(rows)) - start) / max(1, end - start), 0.0, 1.0)
            rows[:, :3] += share[:, None] * more * way / max(float(np.linalg.norm(way)), 1e-6)
            done = f"its stroke {'longer' if more > 0 else 'shorter'} by {abs(more) * 1000:.1f} mm"
        case "shift":
            shift = rng.normal(0.0, 0.02 * elite.scale, 3) * np.array([1.0, 1.0, 0.2])
            rows[:, :3] += shift
            done = f"shifted by {np.linalg.norm(shift) * 1000:.1f} mm"
        case "height":
            rise = rng.normal(0.0, 0.02 * elite.scale)
            rows[rng.integers(0, max(1, start + 1)) :, 2] += rise
            done = f"from some waypoint on {abs(rise) * 1000:.1f} mm {'higher' if rise > 0 else 'lower'}"
        case _:
            turn = rng.normal(0.0, 0.2 * elite.scale)
            rows[:, 5] += turn
            done = f"turned by {np.degrees(turn):.1f} degrees"
    return plan._replace(rows=rows, text=f"{plan.text}, {done}", touching=())


def _missing(elite: Elite, analysis: SceneAnalysis) -> float:
    """Mean distance in metres by which the elite's bodies fell short (negative: went too far); 0 if unknown."""
    options = []
    for goal in analysis.goals:
        places = {name: analysis.solids[name].position for name in goal.bodies if name in elite.moved_m and goal.place}
        missing = [float(np.linalg.norm(wanted(at, goal) - at)) - elite.moved_m[name] for name, at in places.items()]
        if missing:
            options.append(min(missing) if goal.any else float(np.mean(missing)))
    return min(options, key=abs, default=0.0)


def mutate(tool: Tool, scale: float, rng: Generator) -> tuple[Tool, str]:
    """Make one change: to a component's size, position or orientation; or add or remove one."""
    components = list(tool.components)
    kinds = {"size": 4.0, "shift": 2.0, "turn": 2.0, "add": 1.5, "remove": float(len(components) > 2)}
    kind = draw(kinds, rng)
    number = int(rng.integers(len(components)))
    old = components[number]
    axis = int(rng.integers(3))
    if kind == "size":
        return _resized(tool, number, axis, float(np.exp(rng.normal(0.0, 0.35 * max(scale, 0.2)))))
    if kind == "add":
        return _added(tool, old, axis, rng)
    if kind == "remove":
        old = components.pop(int(rng.choice(_leaves(tool))))
        text = f"{old.name} removed"
    elif kind == "shift":
        way = rng.normal(0.0, 0.03 * max(scale, 0.2), 3)
        components[number] = replace(old, pose=Pose(old.pose.position + way, old.pose.quaternion))
        text = f"{old.name} moved by {np.linalg.norm(way) * 1000:.0f} mm"
    else:  # its descendants turn too
        angle = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.08, 0.5) * max(scale, 0.3))
        turn = Pose.from_rotation(np.zeros(3), Rotation.from_rotvec(angle * np.eye(3)[axis]))
        components[number] = replace(old, pose=old.pose @ turn)
        text = f"{old.name} turned by {np.degrees(angle):.0f} degrees about its {'xyz'[axis]}"
    return joined(replace(tool, components=tuple(components))), text


def _resized(tool: Tool, number: int, axis: int, factor: float) -> tuple[Tool, str]:
    """Lengthen or shorten one side of a component, away from its parent; its children move with its faces."""
    old = tool.components[number]
    sides = old.shape.bounds[1].copy()
    before = float(sides[axis])
    sides[axis] = np.clip(before * factor, _THINNEST_M, 1.5)
    stretch = np.ones(3)
    stretch[axis] = sides[axis] / before

    way = old.pose.rotation.as_matrix()[:, axis]
    away = np.sign(float(old.pose.position @ way)) or 1.0
    place = Pose(old.pose.position + away * way * (sides[axis] - before) / 2, old.pose.quaternion)
    x, y, z = sides.tolist()
    new = replace(old, shape=Box((x, y, z)), pose=place)
    components = [
        replace(c, pose=Pose(c.pose.position * stretch, c.pose.quaternion)) if c.parent == old.name else c
        for c in tool.components
    ]
    components[number] = new
    verb = "lengthened" if factor > 1 else "shortened"
    text = f"{old.name} {verb} in {'xyz'[axis]} to {sides[axis]:.3f} m"
    return joined(replace(tool, components=tuple(components))), text


def _added(tool: Tool, parent: Component, axis: int, rng: Generator) -> tuple[Tool, str]:
    """Add a plate on a face of a component."""
    size = parent.shape.bounds[1]
    sides = size * rng.uniform(0.3, 1.0, 3)
    sides[axis] = rng.uniform(0.01, 0.08)
    x, y, z = np.clip(sides, 0.004, 0.3).tolist()
    place = rng.uniform(-0.5, 0.5, 3) * (size - sides)
    place[axis] = rng.choice([-1.0, 1.0]) * (size[axis] + sides[axis]) / 2
    name = _free_name("fin", tool)
    fin = Component(name, parent.name, Pose(place), Box((x, y, z)), color=_COLOR)
    return joined(replace(tool, components=(*tool.components, fin))), f"{name} added on {parent.name}"


def _leaves(tool: Tool) -> list[int]:
    parents = {c.parent for c in tool.components}
    return [i for i, c in enumerate(tool.components) if c.name not in parents]


def _free_name(name: str, tool: Tool) -> str:
    """``name``, with a number if a component has it."""
    taken = {c.name for c in tool.components}
    return next(free for free in (name, *(f"{name}_{i}" for i in range(2, 200))) if free not in taken)


def cross(first: Tool, second: Tool, rng: Generator) -> tuple[Tool, str]:
    """Put a part of the second tool on the nearest component of the first."""
    donor = second.components[int(rng.choice(_leaves(second)))]
    mount, pose = second.placed()[donor.name]
    near = {name: place for name, (carrier, place) in first.placed().items() if carrier == mount}
    if not near:
        return mutate(first, 0.5, rng)
    parent = min(near, key=lambda name: float(np.linalg.norm(near[name].position - pose.position)))
    local = near[parent].inverse() @ pose
    new = replace(donor, name=_free_name(donor.name, first), parent=parent, pose=local, color=_COLOR)
    return joined(replace(first, components=(*first.components, new))), f"{donor.name} of the second put on {parent}"


def joined(tool: Tool) -> Tool:
    """The tool with every component, and its descendants, moved until it touches its parent."""
    components: list[Component] = []
    sizes = {c.name: c.shape.bounds[1] for c in tool.components}
    for component in tool.components:
        for _ in range(4 if component.parent in sizes else 0):
            parent = Boxes.of([(Pose(), sizes[component.parent])])
            gap, axis = separations(parent, Boxes.of([(component.pose, sizes[component.name])]))
            if gap[0] <= 0.0:
                break
            position = component.pose.position - (gap[0] + _OVERLAP_M) * axis[0]
            component = replace(component, pose=Pose(position, component.pose.quaternion))
        components.append(component)
    return replace(tool, components=tuple(components))
