"""Chain errands: one tool that has a head for each of them on its mount, and one plan that does them in order.

Each head is drawn for its errand alone, in the layout as those before leave it, and where there is room for it beside
the others. Between two errands the tool is drawn out as it came in, lifted over everything, and turned about, so that
the next head is where it works.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
from numpy.random import Generator
from scipy.spatial.transform import Rotation

from core.design import Tool
from core.geometry import Array, Pose
from core.interfaces import Anchor
from plugins.vlms.offline.boxes import Boxes
from plugins.vlms.offline.chance import Range
from plugins.vlms.offline.errands import find_errands, spread_goals
from plugins.vlms.offline.faults import (
    BREAKS_RULES,
    count_collisions,
    count_on_way,
    names_moved,
)
from plugins.vlms.offline.layouts import Layout
from plugins.vlms.offline.mounting import HeadRoom
from plugins.vlms.offline.paths import SampledPlan
from plugins.vlms.offline.reaching_in import ROD
from plugins.vlms.offline.sampler import (
    FreshDesign,
    Part,
    Sampler,
    find_least_faulty,
)
from plugins.vlms.offline.scene_analysis import SceneAnalysis
from plugins.vlms.offline.scene_model import SceneModel
from plugins.vlms.offline.targets import Target
from plugins.vlms.offline.tool_parts import rename_components, tool_boxes

_ONE_HEAD = 0.25  # how often one head does all errands, where it can
_TRIES = 3  # of a tool with a head for each errand: each draws many heads
_REDRAWS = 8  # of one of its heads, at each try,
_OF_KIND = 4  # and at first only by one of the same kind
_PLAN_TRIES = 4
_APART_M = Range(0.06, 0.16)  # of a head from the mount's axis
# Which way the next head is from there, by how the first one is: most often the opposite way.
_TURNS_RAD = (np.pi, np.pi, 0.75 * np.pi, -0.75 * np.pi, np.pi / 2, -np.pi / 2)
_ROOM_M = Range(0.2, 0.32)  # below the mount, for other heads, as the first one works
_CLEAR_M = 0.006  # of a head that does not work, over the ground
_OVER_M = 0.03  # everything, on the way from one errand to the next
_FINE_M = 0.006  # between places that are checked as a head is drawn out: it is close to what it moved
_STEP_RAD = 1.1  # of a turn on that way, at most
_HIGHEST_M = 0.15  # over home, on that way
_LEAST_RAD = 0.3  # of a turn that may be made the long way round, too
_UPRIGHT_RAD = 0.3  # a tool that is tipped by less hangs down
_WIDE_M = 0.5  # of what things stand on, both ways


def invent(sampler: Sampler) -> FreshDesign:
    """Invent a tool and a first plan, with a head for each errand where there are several.

    Args:
        sampler: for the task.
    """
    analysis = spread_goals(sampler.analysis)
    errands = [] if sampler.brief.gripper else find_errands(analysis)
    if len(errands) < 2:
        return sampler.invent()

    by_rod = all(goal.joint or goal.breaks for goal in sampler.analysis.goals)
    if by_rod or sampler.rng.random() < _ONE_HEAD:
        design = sampler.invent()
        is_rod = design.placed.head.kind == ROD
        if design.is_whole and (is_rod or not by_rod):  # it does them all
            return design

    layout = sampler.layout.with_analysis(analysis)
    maker = _Chain(sampler, layout, errands)
    return find_least_faulty(maker.invent, _TRIES)


def use_again(design: FreshDesign, tool: Tool, sampler: Sampler) -> SampledPlan:
    """Sample another plan with the heads of a design.

    Args:
        design: with one head, or several.
        tool: the design's own, or one that has it as a part.
        sampler: for the task.
    """
    if not design.parts:
        return sampler.use(tool, lambda _: design.placed)

    maker = _Chain(sampler, sampler.layout, ())
    return find_least_faulty(
        lambda enough: maker.use(design.parts, tool, enough), _PLAN_TRIES
    )


@dataclass(frozen=True, eq=False)
class _Chain:
    """Makes tools and plans that do several errands.

    Attributes:
        sampler: for the task.
        layout: in which goals are spread.
        errands: see `find_errands`.
    """

    sampler: Sampler
    layout: Layout
    errands: Sequence[Sequence[int]]

    def invent(self, enough: float) -> tuple[FreshDesign, float]:
        """Sample a tool and a plan, and count their faults, up to ``enough``.

        As long as there are some, one of the heads is drawn again where there is room beside the others; at first it
        must be of the same kind.
        """
        parts: list[Part] = []
        layout = self.layout
        for number in range(len(self.errands)):
            part = self._draw_part(number, layout, parts)
            parts.append(part)
            analysis = layout.analysis.after(part.design.subgoals)
            layout = layout.with_analysis(analysis)

        design, fault = self._make_design(parts, enough)
        for count in range(_REDRAWS):
            if fault == 0.0:
                break

            number = int(self.sampler.rng.integers(len(parts)))
            others = [*parts[:number], *parts[number + 1 :]]
            part = self._draw_part(number, parts[number].maker.layout, others)
            # What fits with ease is not the better for it.
            if part.kind != parts[number].kind and count < _OF_KIND:
                continue

            changed = [*parts[:number], part, *parts[number + 1 :]]
            other, other_fault = self._make_design(changed, min(fault, enough))
            if other_fault < fault:
                design = other
                fault = other_fault
                parts = changed

        return design, fault

    def _draw_part(self, number: int, layout: Layout, others: Sequence[Part]) -> Part:
        """Draw the head for an errand, with a plan.

        Args:
            number: of the errand.
            layout: as the errands before leave it.
            others: for other errands, beside which there must be room.
        """
        rng = self.sampler.rng
        analysis = layout.analysis
        goals = self._find_goals(number, analysis)
        errand = layout.with_analysis(analysis.with_groups([goals]))
        room = _find_room(others, analysis.world, rng)
        brief = replace(self.sampler.brief, seed=int(rng.integers(2**31)))
        maker = Sampler(brief, [errand], room=room)

        return Part(maker, maker.invent())

    def _find_goals(self, number: int, analysis: SceneAnalysis) -> list[Target]:
        """Find the goals of an errand; those of a layout that was made for it alone are all of them."""
        (goals,) = analysis.groups
        numbers = self.errands[number]
        if len(goals) == len(numbers):
            return goals

        return [goals[i] for i in numbers]

    def _make_design(
        self, parts: Sequence[Part], enough: float
    ) -> tuple[FreshDesign, float]:
        """Join the heads and the plans of all errands, and count their faults, up to ``enough``."""
        tool = _join_tools([part.design.tool for part in parts])
        plans = [part.design.plan for part in parts]
        plan, fault = self._join(parts, plans, tool, enough)
        if fault < enough and not self.sampler.accepts(tool):
            fault += BREAKS_RULES

        first = parts[0].design
        return FreshDesign(tool, first.placed, plan, parts=parts), fault

    def use(
        self, parts: Sequence[Part], tool: Tool, enough: float
    ) -> tuple[SampledPlan, float]:
        """Sample a plan for a tool, and count its faults, up to ``enough``.

        Args:
            parts: of the tool.
            tool: which has a head for each errand.
            enough: where counting ends.
        """
        plans = [part.make_plan() for part in parts]

        return self._join(parts, plans, tool, enough)

    def _join(
        self,
        parts: Sequence[Part],
        plans: Sequence[SampledPlan],
        tool: Tool,
        enough: float,
    ) -> tuple[SampledPlan, float]:
        """Join the plans of all errands, and count the faults of the whole.

        Args:
            parts: of the tool.
            plans: one for each part.
            tool: which has a head for each errand.
            enough: where counting ends.
        """
        best, fault = self._join_turning(parts, plans, tool, False, enough)
        if fault == 0.0:
            return best, fault

        other, more = self._join_turning(parts, plans, tool, True, min(fault, enough))
        if more < fault:
            return other, more

        return best, fault

    def _join_turning(
        self,
        parts: Sequence[Part],
        plans: Sequence[SampledPlan],
        tool: Tool,
        is_long: bool,
        enough: float,
    ) -> tuple[SampledPlan, float]:
        """Join plans; for ``is_long`` the tool turns the long way round between them. Arguments as of `_join`."""
        boxes = tool_boxes(tool)
        home = self.layout.analysis.world.home
        end = np.concatenate([home.position, home.rpy])
        legs: list[_Leg] = []
        hits = 0

        for number, part in enumerate(parts):
            leg = _Leg.from_plan(plans[number])
            if number > 0:
                leg = leg.after(end, boxes, part.model, is_long)
            if number < len(parts) - 1:
                leg = leg.draw_out(part, parts[number + 1].model)

            way = np.vstack([end, leg.rows[:, :6]])
            hits += self._count_hits(parts, number, way, leg.touching)
            hits += leg.hits
            legs.append(leg)
            end = leg.rows[-1, :6]

        rows = np.vstack([leg.rows for leg in legs])
        texts = [plan.text for plan in plans]
        anchors = [*chain.from_iterable(leg.anchors for leg in legs)]
        touching = [*chain.from_iterable(leg.touching for leg in legs)]
        plan = SampledPlan(rows, "; then ".join(texts), anchors, touching)
        if hits and hits >= enough:
            return plan, hits

        return plan, self.sampler.faults.count_arm(tool, rows, hits, enough)

    def _count_hits(
        self,
        parts: Sequence[Part],
        number: int,
        way: Array,
        touching: Sequence[bool],
    ) -> int:
        """Count the collisions of all heads as one of them does its errand.

        Args:
            parts: of the tool.
            number: of the one that works.
            way: of the tool mount, (N + 1, 6).
            touching: whether that head may touch what it moves on the way to each waypoint, N.
        """
        hits = 0
        for other, part in enumerate(parts):
            moved = set[str]()
            if other == number:
                moved = names_moved(part.design.subgoals)

            boxes = tool_boxes(part.design.tool)
            model = parts[number].model
            hits += count_collisions(model, boxes, way, touching, moved)

        return hits


@dataclass(frozen=True, eq=False)
class _Leg:
    """The part of a plan that does one errand.

    Attributes:
        rows: waypoints, (N, 6).
        anchors: what each stands by.
        touching: whether the head may touch what it moves on the way to each.
        hits: collisions as it is drawn out.
    """

    rows: Array
    anchors: Sequence[Anchor]
    touching: Sequence[bool]
    hits: int = 0

    @classmethod
    def from_plan(cls, plan: SampledPlan) -> _Leg:
        """Take the plan of an errand."""
        return cls(plan.rows, plan.anchors, plan.touching)

    def draw_out(self, part: Part, later: SceneModel) -> _Leg:
        """Return the leg with waypoints that draw the head out as far as it came in, or less, and raise it.

        Args:
            part: that does the errand.
            later: the layout as the errand leaves it.
        """
        boxes = tool_boxes(part.design.tool)
        moved = names_moved(part.design.subgoals)
        bodies = Boxes.concatenate(part.model.solids[name].boxes for name in moved)
        end = _to_pose(self.rows[-1])
        touched = [*self.touching, True].index(True)
        contact = max(0, min(touched, len(self.rows)) - 1)
        # Beside what it moved, the head is about where it was as it began to move it.
        move = end @ _to_pose(self.rows[contact]).inverse()
        back = [_to_row(move @ _to_pose(row)) for row in self.rows[:contact][::-1]]
        height = max(_find_clear_height(boxes, later), end.position[2])

        best = self
        least = np.inf
        for count in range(len(back) + 1):
            rows = [self.rows[-1, :6], *back[:count]]
            top = rows[-1].copy()
            top[2] = max(top[2], height)
            way = np.array([*rows, top])
            beside = np.array([_to_row(move.inverse() @ _to_pose(row)) for row in way])
            may_touch = [True] * len(way[1:])
            hits = count_collisions(later, boxes, way, may_touch, moved)
            hits += count_on_way(boxes, beside, bodies, step=_FINE_M)
            if hits < least:
                least = hits
                best = self._add(way[1:], hits)

        return best

    def _add(self, rows: Array, hits: int) -> _Leg:
        """Return the leg with more waypoints, on the way to which the head may touch what it moved."""
        count = len(rows)
        return _Leg(
            np.vstack([self.rows, rows]),
            [*self.anchors, *[self.anchors[-1]] * count],
            [*self.touching, *[True] * count],
            hits,
        )

    def after(self, end: Array, boxes: Boxes, model: SceneModel, is_long: bool) -> _Leg:
        """Return the leg with waypoints before it, from where another one ends, above everything.

        Args:
            end: of the other one, (6,).
            boxes: of the whole tool.
            model: the layout as the other one leaves it.
            is_long: whether the tool turns the long way round.
        """
        begin = _to_pose(end)
        there = _to_pose(self.rows[0])
        turn = (there.rotation * begin.rotation.inv()).as_rotvec()
        angle = float(np.linalg.norm(turn))
        if is_long and angle > _LEAST_RAD:
            turn *= 1.0 - 2 * np.pi / angle

        clear = _find_clear_height(boxes, model)
        clear = min(clear, model.home.position[2] + _HIGHEST_M)
        height = max(clear, begin.position[2], there.position[2])
        steps = 1 + int(np.ceil(np.linalg.norm(turn) / _STEP_RAD))

        rows = []
        for share in np.linspace(0.0, 1.0, steps + 1):
            position = begin.position + share * (there.position - begin.position)
            position[2] = height
            rotation = Rotation.from_rotvec(share * turn) * begin.rotation
            rows.append(_to_row(Pose.from_rotation(position, rotation)))

        count = len(rows)
        return _Leg(
            np.vstack([*rows, self.rows]),
            [*[Anchor()] * count, *self.anchors],
            [*[False] * count, *self.touching],
        )


def _to_pose(row: Array) -> Pose:
    """Return the pose of a waypoint, (6,) or more."""
    return Pose.xyz_rpy(row[:3], row[3:6])


def _to_row(pose: Pose) -> Array:
    """Return the waypoint of a pose, (6,)."""
    return np.concatenate([pose.position, pose.rpy])


def _find_clear_height(boxes: Boxes, model: SceneModel) -> float:
    """Find the height of the tool mount at which a tool is above everything that is not above home itself, metres.

    Args:
        boxes: of the tool, in the frame of the tool mount.
        model: which has the bodies.
    """
    tops = model.boxes.bounds[1][:, 2]
    home = float(model.home.position[2])
    highest = tops[tops < home].max(initial=-np.inf)
    return float(highest + _OVER_M - boxes.bounds[0][:, 2].min())


def _find_room(parts: Sequence[Part], model: SceneModel, rng: Generator) -> HeadRoom:
    """Find where there is room for a head beside others.

    Args:
        parts: with the other heads.
        model: the layout as the errand finds it.
        rng: random numbers.
    """
    apart = _APART_M.draw(rng)
    ground = _find_ground(model)
    if not parts:
        return HeadRoom(apart, lowest=ground + _ROOM_M.draw(rng))

    first = parts[0].design.placed.pose.position
    turn = _TURNS_RAD[int(rng.integers(len(_TURNS_RAD)))]
    azimuth = float(np.arctan2(first[1], first[0])) + turn

    lowest = 0.0
    longest = np.inf
    for part in parts:
        below = -tool_boxes(part.design.tool).bounds[0][:, 2].min()
        lowest = max(lowest, below + _CLEAR_M)
        rows = part.design.plan.rows
        is_upright = np.abs(rows[:, 3:5]).max(axis=1) < _UPRIGHT_RAD
        low = rows[is_upright, 2].min(initial=np.inf) - ground
        longest = min(longest, low - _CLEAR_M)

    return HeadRoom(apart, azimuth, lowest + ground, longest)


def _find_ground(model: SceneModel) -> float:
    """Find the height of the ground that things stand on: of the highest wide surface below home, metres.

    Args:
        model: of the layout.
    """
    lower, upper = model.boxes.bounds
    wide = ((upper - lower)[:, :2] > _WIDE_M).all(axis=1)
    wide &= upper[:, 2] < model.home.position[2]
    return float(upper[wide, 2].max(initial=-1.0))


def _join_tools(tools: Sequence[Tool]) -> Tool:
    """Join tools into one that has the parts of each; the names of the second and later ones get its number.

    Args:
        tools: that hang from the same mount.
    """
    components = [*tools[0].components]
    for number, tool in enumerate(tools[1:], start=2):
        components += rename_components(tool, str(number))

    return replace(
        tools[0],
        components=tuple(components),
        name="_and_".join(tool.name for tool in tools),
        description="; and ".join(tool.description for tool in tools),
    )
