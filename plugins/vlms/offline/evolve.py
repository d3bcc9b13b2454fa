"""Breed offspring of elites: mutate and cross tools of any origin, and carry the elites' plans over to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator
from scipy.spatial.transform import Rotation

from core.design import Component, DesignError, Tool
from core.geometry import Array, Box, Pose, resized
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


def elites_with(
    evaluations: Sequence[Evaluation], gripper: bool, seen: Seen
) -> list[Elite]:
    """The elites with a gripper tool, or those with a rigid one; their plans as they are in this layout.

    A waypoint that ends by a guard is left out, and so is the way back from it.
    """
    known = {*seen.poses, Anchor().name, Anchor().toward}  # not where a guard ends
    elites = []
    for evaluation in evaluations:
        candidate = evaluation.candidate
        if candidate.tool is None or candidate.tool.gripper != gripper:
            continue
        plan = candidate.plan.resolve(seen)
        rows = plan.poses
        given = candidate.plan.anchors
        kept = []
        for i, guard in enumerate(plan.guards or [None] * len(rows)):
            back = (
                i > 1
                and bool(plan.guards)
                and plan.guards[i - 1]
                and rows[i].tolist() == rows[i - 2].tolist()
            )
            if not guard and not back:
                kept.append(i)
        anchors = []
        for i in kept:
            anchor = given[i] if len(given) == len(rows) else Anchor()
            anchors.append(
                anchor if {anchor.name, anchor.toward} <= known else Anchor()
            )
        moved_m = evaluation.shown.moved_m if evaluation.shown is not None else {}
        elites.append(
            Elite(
                candidate.id,
                candidate.tool,
                rows[kept],
                anchors,
                evaluation.reward,
                moved_m,
            )
        )
    return elites


def breed(
    elites: Sequence[Elite], count: int, sampler: Sampler
) -> tuple[str, str, Tool, list[SampledPlan], list[str]]:
    """One offspring: name, description, tool, ``count`` plans, parents' ids. Better elites are parents more often.

    Where no change keeps the rules, the tool is its parent's.
    """
    rng = sampler.rng
    weights = np.array([max(elite.reward, 0.01) ** 2 for elite in elites])
    for attempt in range(_TRIES):
        first, second = (
            elites[int(i)]
            for i in rng.choice(len(elites), 2, p=weights / weights.sum())
        )
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
    return (
        f"{name}: {done}",
        description,
        tool,
        offspring_plans(first, tool, count, sampler),
        parents,
    )


def offspring_plans(
    elite: Elite, tool: Tool, count: int, sampler: Sampler
) -> list[SampledPlan]:
    """Plans for a tool derived from the elite's: its plan fitted to the tool, variations of it, or fresh ones."""
    rng = sampler.rng
    part = part_for(tool, sampler.brief.task)
    apart = middle(part_for(elite.tool, sampler.brief.task)) - middle(part)
    base = (
        elite.plan.copy()
    )  # the foot of the new tool moves as that of the elite's did
    base[:, :3] += Rotation.from_euler("xyz", base[:, 3:6]).apply(apart)
    plans: list[SampledPlan] = []
    for i in range(count):
        if 0 < i == count - 1 and rng.random() < elite.scale:
            plans.append(
                sampler.use(tool, lambda subgoal: recognize(part, subgoal, rng))
            )
            continue
        parent = SampledPlan(base, "the parent's plan", elite.anchors)
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
    while (
        start - 1 in level
        and ways[start - 1] @ ways[end] > 0.9 * lengths[start - 1] * lengths[end]
    ):
        start -= 1
    return start, end + 1


def vary(
    plan: SampledPlan, elite: Elite, analysis: SceneAnalysis, rng: Generator
) -> SampledPlan:
    """Change a plan at random, by the elite's scale, and keep an anchor for each waypoint."""
    start, end = _last_straight(plan.rows)
    way = plan.rows[end, :3] - plan.rows[start, :3]
    length = float(np.linalg.norm(way))
    missing = _missing(elite, analysis)
    kinds = {
        "length": 0.2,
        "shift": 0.25,
        "height": 0.15,
        "yaw": 0.1,
        "slower": 0.05,
        "faster": 0.05,
    }
    if abs(missing) > 0.001 and length > 0.02:
        kinds["measure"] = 0.25
    kind = draw(kinds, rng)
    rows = plan.rows.copy()
    anchors = list(plan.anchors)
    if kind in ("length", "measure"):
        if kind == "measure":
            more = (
                missing * rng.uniform(0.6, 1.2) * rng.choice([1.0, -1.0], p=[0.8, 0.2])
            )
        else:
            more = rng.normal(0.0, 0.08 * elite.scale)
        share = np.clip((np.arange(len(rows)) - start) / max(1, end - start), 0.0, 1.0)
        rows[:, :3] += share[:, None] * more * way / max(length, 1e-6)
        done = f"its stroke {'longer' if more > 0 else 'shorter'} by {abs(more) * 1000:.1f} mm"
    elif kind == "shift":
        shift = rng.normal(0.0, 0.02 * elite.scale, 3) * np.array([1.0, 1.0, 0.2])
        rows[:, :3] += shift
        done = f"shifted by {np.linalg.norm(shift) * 1000:.1f} mm"
    elif kind == "height":
        rise = rng.normal(0.0, 0.02 * elite.scale)
        rows[rng.integers(0, max(1, start + 1)) :, 2] += rise
        done = f"from some waypoint on {abs(rise) * 1000:.1f} mm {'higher' if rise > 0 else 'lower'}"
    elif kind == "yaw":
        turn = rng.normal(0.0, 0.2 * elite.scale)
        rows[:, 5] += turn
        done = f"turned by {np.degrees(turn):.1f} degrees"
    elif kind == "slower" and len(rows) < 60:
        halfway = (rows[start:end] + rows[start + 1 : end + 1]) / 2
        rows = np.insert(rows, np.arange(start + 1, end + 1), halfway, axis=0)
        for i in range(end, start, -1):
            before, after = anchors[i - 1 : i + 1]
            alike = (before.name, before.toward) == (after.name, after.toward)
            anchors.insert(
                i,
                replace(after, share=(before.share + after.share) / 2)
                if alike
                else after,
            )
        done = "its stroke at half the speed"
    else:
        kept = [
            i for i in range(len(rows)) if not start < i < end or (i - start) % 2 == 0
        ]
        rows = rows[kept]
        anchors = [anchors[i] for i in kept]
        done = "its stroke with fewer waypoints"
    return SampledPlan(rows, f"{plan.text}, {done}", anchors)


def _missing(elite: Elite, analysis: SceneAnalysis) -> float:
    """Mean distance in metres by which the elite's bodies fell short (negative: went too far); 0 if unknown."""
    options = []
    for goal in analysis.goals:
        places = {
            name: analysis.solids[name].position
            for name in goal.bodies
            if name in elite.moved_m and goal.place
        }
        missing = [
            float(np.linalg.norm(wanted(at, goal) - at)) - elite.moved_m[name]
            for name, at in places.items()
        ]
        if missing:
            options.append(min(missing) if goal.any else float(np.mean(missing)))
    return min(options, key=abs, default=0.0)


def mutate(tool: Tool, scale: float, rng: Generator) -> tuple[Tool, str]:
    """Make one change: to a component's size, position or orientation; or add, remove or replace one."""
    count = len(tool.components)
    kinds = {
        "size": 4.0,
        "shift": 2.0,
        "turn": 2.0,
        "add": 1.5,
        "remove": float(count > 2),
        "replace": float(count > 1),
    }
    kind = draw(kinds, rng)
    if kind == "size":
        return _resized(tool, scale, rng)
    if kind == "add":
        return _added(tool, rng)
    number = int(
        rng.choice(_leaves(tool))
        if kind in ("remove", "replace")
        else rng.integers(count)
    )
    old = tool.components[number]
    if kind == "remove":
        changed = []
        text = f"{old.name} removed"
    elif kind == "shift":
        way = rng.normal(0.0, 0.03 * max(scale, 0.2), 3)
        changed = [
            replace(old, pose=Pose(old.pose.position + way, old.pose.quaternion))
        ]
        text = f"{old.name} moved by {np.linalg.norm(way) * 1000:.0f} mm"
    elif kind == "turn":  # its descendants too
        axis = int(rng.integers(3))
        angle = float(
            rng.choice([-1.0, 1.0]) * rng.uniform(0.08, 0.5) * max(scale, 0.3)
        )
        turn = Pose.from_rotation(
            np.zeros(3), Rotation.from_rotvec(angle * np.eye(3)[axis])
        )
        changed = [replace(old, pose=old.pose @ turn)]
        text = f"{old.name} turned by {np.degrees(angle):.0f} degrees about its {'xyz'[axis]}"
    else:
        x, y, z = np.clip(
            old.shape.bounds[1] * np.exp(rng.normal(0.0, 0.5, 3)), _THINNEST_M, 0.6
        ).tolist()
        changed = [
            Component(
                _free_name("part", tool),
                old.parent,
                old.pose,
                Box((x, y, z)),
                color=_COLOR,
            )
        ]
        text = f"{old.name} replaced by a box of {x:.3f} x {y:.3f} x {z:.3f} m"
    return joined(
        replace(
            tool,
            components=(
                *tool.components[:number],
                *changed,
                *tool.components[number + 1 :],
            ),
        )
    ), text


def _resized(tool: Tool, scale: float, rng: Generator) -> tuple[Tool, str]:
    """Lengthen or shorten one side; children of the component move with its faces."""
    number = int(rng.integers(len(tool.components)))
    axis = int(rng.integers(3))
    factor = float(
        np.exp(rng.choice([-1.0, 1.0]) * rng.uniform(0.1, 0.6) * max(scale, 0.2))
    )
    old = tool.components[number]
    before = old.shape.bounds[1]
    sides = before.tolist()
    sides[axis] = float(np.clip(sides[axis] * factor, _THINNEST_M, 1.5))
    stretch = np.ones(3)
    stretch[axis] = sides[axis] / before[axis]
    components = []
    for c in tool.components:
        if c.parent == old.name:
            c = replace(c, pose=Pose(c.pose.position * stretch, c.pose.quaternion))
        components.append(c)
    # The end that meets the parent stays where it is.
    way = old.pose.rotation.as_matrix()[:, axis]
    toward = np.sign(float(old.pose.position @ way)) or 1.0
    pose = Pose(
        old.pose.position + toward * (way * (sides[axis] - before[axis]) / 2),
        old.pose.quaternion,
    )
    x, y, z = sides
    components[number] = replace(old, shape=Box((x, y, z)), pose=pose)
    verb = "lengthened" if factor > 1 else "shortened"
    text = f"{old.name} {verb} in {'xyz'[axis]} to {sides[axis]:.3f} m"
    return joined(replace(tool, components=tuple(components))), text


def _added(tool: Tool, rng: Generator) -> tuple[Tool, str]:
    """Add a plate on a face of a component."""
    parent = tool.components[
        int(rng.integers(len(tool.components) // 2, len(tool.components)))
    ]
    axis = int(rng.integers(3))
    side = float(rng.choice([-1.0, 1.0]))
    size = parent.shape.bounds[1]
    sides = size * rng.uniform(0.3, 1.0, 3)
    sides[axis] = rng.uniform(0.01, 0.08)
    sides = np.clip(sides, 0.004, 0.3)
    place = np.zeros(3)
    place[axis] = side * ((size[axis] + sides[axis]) / 2 - 0.0005)
    along = (axis + int(rng.integers(1, 3))) % 3
    place[along] = rng.choice([-1.0, 0.0, 1.0]) * (size[along] - sides[along]) / 2
    name = _free_name("fin", tool)
    fin = Component(
        name,
        parent.name,
        Pose(place),
        Box((sides[0], sides[1], sides[2])),
        color=_COLOR,
    )
    return joined(
        replace(tool, components=(*tool.components, fin))
    ), f"{name} added on {parent.name}"


def _leaves(tool: Tool) -> list[int]:
    parents = {c.parent for c in tool.components}
    return [i for i, c in enumerate(tool.components) if c.name not in parents]


def _free_name(name: str, tool: Tool) -> str:
    """``name``, with a number if a component has it."""
    taken = {c.name for c in tool.components}
    return next(
        free
        for free in (name, *(f"{name}_{i}" for i in range(2, 200)))
        if free not in taken
    )


def cross(first: Tool, second: Tool, rng: Generator) -> tuple[Tool, str]:
    """Cross two tools: interpolate between tools of equal structure, or put a part of the second on the first."""
    alike = [(c.name, c.parent) for c in first.components] == [
        (c.name, c.parent) for c in second.components
    ]
    if alike and rng.random() < 0.7:
        return _blended(first, second, float(rng.uniform(0.2, 0.8)))
    donor = second.components[int(rng.choice(_leaves(second)))]
    mount, pose = second.placed()[donor.name]
    mine = first.placed()
    near = [c for c in first.components if mine[c.name][0] == mount]
    if not near:
        return mutate(first, 0.5, rng)
    graft = Boxes.of([(pose, donor.shape.bounds[1])] * len(near))
    gaps, _ = separations(
        graft, Boxes.of((mine[c.name][1], c.shape.bounds[1]) for c in near)
    )
    parent = near[int(np.argmin(gaps))].name
    local = mine[parent][1].inverse() @ pose
    new = replace(
        donor,
        name=_free_name(donor.name, first),
        parent=parent,
        pose=local,
        color=_COLOR,
    )
    return joined(
        replace(first, components=(*first.components, new))
    ), f"{donor.name} of the second put on {parent}"


def _blended(first: Tool, second: Tool, share: float) -> tuple[Tool, str]:
    components = []
    for a, b in zip(first.components, second.components, strict=True):
        sides = (1 - share) * a.shape.bounds[1] + share * b.shape.bounds[1]
        middle = (1 - share) * a.pose.position + share * b.pose.position
        turn = (a.pose.rotation.inv() * b.pose.rotation).as_rotvec()
        pose = Pose.from_rotation(
            middle, a.pose.rotation * Rotation.from_rotvec(share * turn)
        )
        components.append(replace(a, shape=resized(a.shape, sides), pose=pose))
    return joined(
        replace(first, components=tuple(components))
    ), f"all measures {share:.0%} of the way to the second's"


def joined(tool: Tool) -> Tool:
    """The tool with every component, and its descendants, moved until it touches its parent."""
    components: list[Component] = []
    sizes = {c.name: c.shape.bounds[1] for c in tool.components}
    for component in tool.components:
        for _ in range(4 if component.parent in sizes else 0):
            parent = Boxes.of([(Pose(), sizes[component.parent])])
            gap, axis = separations(
                parent, Boxes.of([(component.pose, sizes[component.name])])
            )
            if gap[0] <= 0.0:
                break
            position = component.pose.position - (gap[0] + _OVERLAP_M) * axis[0]
            component = replace(
                component, pose=Pose(position, component.pose.quaternion)
            )
        components.append(component)
    return replace(tool, components=tuple(components))
