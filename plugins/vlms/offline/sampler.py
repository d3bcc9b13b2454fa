"""Invent a fresh tool and plans for a scene: sample several, and keep the one with the fewest faults.

A sample comes about in these steps, each with random numbers:

1. `SceneAnalysis.draw_subgoals`: what is moved, and which way;
2. `DesignDrawer.draw_head`: a head that suits the subgoal with the most bodies;
3. a motion primitive for each subgoal, or the head's own motion: the head's path through the world;
4. `choose_anchors`: what each waypoint of the path stands by;
5. `HeadPlacer.place`: where the head is at the tool mount;
6. `DesignDrawer.build`: the shaft between them;
7. `FaultCounter.count`: what is wrong with it.

For a tool that is known, steps 2, 5 and 6 fall away.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from core.design import Tool
from core.geometry import Pose
from core.interfaces import Anchor, Brief
from plugins.vlms.offline.anchoring import choose_anchors
from plugins.vlms.offline.design_drawing import DesignDrawer
from plugins.vlms.offline.faults import BREAKS_RULES, FaultCounter
from plugins.vlms.offline.heads import Head
from plugins.vlms.offline.layouts import Layout, is_too_heavy, keeps_rules
from plugins.vlms.offline.mounting import (
    HeadDirection,
    HeadPlacer,
    HeadRoom,
    works_above_home,
)
from plugins.vlms.offline.paths import HeadPath, SampledPlan
from plugins.vlms.offline.plan_writing import PlanWriter
from plugins.vlms.offline.primitives import PRIMITIVES
from plugins.vlms.offline.scene_model import SceneModel
from plugins.vlms.offline.subgoals import Subgoal
from plugins.vlms.offline.tool_parts import PlacedHead, guess_head

_ANCHORING = 1  # keeps its random numbers apart from others of the same seed
_TOOL_TRIES = 12
_PLAN_TRIES = 5
_MOST_TRIES = 60
_FARTHER_M = 0.1  # than the least distance from the base, where an arm rises with less ease, and farther out
_REST_S = 2.0  # what was thrown or rolls comes to rest meanwhile, if it does at all
_ALONE = 0.8  # how often scattered bodies are moved one by one where a plan must do in several layouts

A = TypeVar("A")
FindHead = Callable[[Subgoal], PlacedHead]


@dataclass(frozen=True, eq=False)
class FreshDesign:
    """A fresh tool, its head, and a first plan.

    Attributes:
        tool: with a head that was drawn for a subgoal.
        placed: the head, where it is at the tool mount.
        plan: with the fewest faults.
        subgoals: that the plan is for.
        is_whole: whether the plan does something for each of them, and not for one alone.
        parts: of a tool with a head for each of several errands, in order.
    """

    tool: Tool
    placed: PlacedHead
    plan: SampledPlan
    subgoals: Sequence[Subgoal] = ()
    is_whole: bool = True
    parts: Sequence[Part] = ()


class Sampler:
    """Samples tools and plans for a brief, and keeps those with the fewest faults.

        sampler = Sampler(brief, make_layouts(brief))
        design = sampler.invent()
        another_plan = sampler.use_any(design.tool)

    Its random numbers are those of the brief's seed: the same calls in the same order give the same designs.

    Attributes:
        looks_near: whether plans that look do so before the tool comes down, too.
        faults: counts those of plans.

    Args:
        brief: what is asked for.
        layouts: the one that plans are made for, and others in which they must do.
        direction: where heads must be; None: anywhere.
        room: where there is room beside another head of the tool; None: there is no other one.
    """

    def __init__(
        self,
        brief: Brief,
        layouts: Sequence[Layout],
        direction: HeadDirection | None = None,
        room: HeadRoom | None = None,
    ) -> None:
        self.brief = brief
        self.layout = layouts[0]
        self.analysis = self.layout.analysis
        self.model = self.analysis.world
        self.rng = np.random.default_rng(brief.seed)
        self.writer = PlanWriter(brief, self.layout)
        self.looks_near = False
        self._layouts = layouts
        self.faults = FaultCounter(brief, layouts, self.writer)
        self._placer = HeadPlacer(
            self.model, self.faults, brief.gripper, direction, room, self.rng
        )
        self._anchoring = np.random.default_rng([brief.seed, _ANCHORING])

    def accepts(self, tool: Tool) -> bool:
        """Report whether the tool keeps the rules."""
        return keeps_rules(tool, self.brief, self._layouts)

    def invent(self) -> FreshDesign:
        """Invent a tool and a first plan.

        It is the best of a random number of samples: doubtful ones are not always the worst.
        """
        tries = int(self.rng.integers(2, _TOOL_TRIES + 1))
        drawer = DesignDrawer(self.brief, self.rng)
        return find_least_faulty(lambda least: self._invent_once(drawer, least), tries)

    def use(self, tool: Tool, find_head: FindHead) -> SampledPlan:
        """Sample a plan for a tool; ``find_head`` returns its head for a subgoal.

        Args:
            tool: for which a plan is sampled.
            find_head: is asked once for each sample.
        """
        return find_least_faulty(
            lambda least: self._use_once(tool, find_head, least), _PLAN_TRIES
        )

    def use_any(self, tool: Tool) -> SampledPlan:
        """Sample a plan for a tool of any origin, whose lowest boxes are taken for its head."""
        return self.use(tool, lambda subgoal: guess_head(tool, subgoal, self.rng))

    def least_fault(self, tool: Tool) -> float:
        """Return the least fault of some plans for a tool of any origin; 0: one has none."""
        least = np.inf
        for _ in range(_PLAN_TRIES):
            _, fault = self._use_once(
                tool, lambda subgoal: guess_head(tool, subgoal, self.rng), least
            )
            least = min(least, fault)
            if least == 0.0:
                break

        return least

    def _use_once(
        self, tool: Tool, find_head: FindHead, enough: float
    ) -> tuple[SampledPlan, float]:
        """Sample a plan for a tool, and count its faults, up to ``enough``."""
        subgoals = self._draw_subgoals()
        placed = find_head(subgoals[0])
        path = self._make_path(subgoals, placed.head)
        return self._make_plan(tool, placed.pose, path, subgoals, enough)

    def _invent_once(
        self, drawer: DesignDrawer, enough: float
    ) -> tuple[FreshDesign, float]:
        """Sample a tool and a plan, and count their faults, up to ``enough``."""
        subgoals = self._draw_subgoals()
        head, path, pose, tool = self._draw_tool(drawer, subgoals)
        while is_too_heavy(tool, self.brief) and drawer.make_lighter():
            head, path, pose, tool = self._draw_tool(drawer, subgoals)

        plan, fault = self._make_plan(tool, pose, path, subgoals, enough)
        if fault < enough and not self.accepts(tool):
            fault += BREAKS_RULES
        is_whole = len(path.stages) >= len(subgoals)
        placed = PlacedHead(head, pose)
        return FreshDesign(tool, placed, plan, subgoals, is_whole), fault

    def _draw_tool(
        self, drawer: DesignDrawer, subgoals: Sequence[Subgoal]
    ) -> tuple[Head, HeadPath, Pose, Tool]:
        """Draw a head, its path, its pose in the frame of the tool mount, and the tool that has it."""
        largest = max(subgoals, key=lambda subgoal: len(subgoal.solids))
        head = drawer.draw_head_for_all(subgoals)
        path = self._make_path(subgoals, head)
        pose = head.mount_pose

        if pose is None:
            pose = self._placer.place(path, head, largest)

        return head, path, pose, drawer.build(head, pose, path, largest)

    def _draw_subgoals(self) -> list[Subgoal]:
        """Draw what a plan is to do.

        Where it must do in several layouts, scattered bodies are moved one by one most often.
        """
        alone = self.faults.several and self.rng.random() < _ALONE
        return self.analysis.draw_subgoals(self.rng, alone)

    def _make_path(self, subgoals: Sequence[Subgoal], head: Head) -> HeadPath:
        """Lead the head through all subgoals; a head with its own motion has one for all of them.

        Args:
            subgoals: in the order in which they are reached.
            head: which goes along the path.
        """
        path = HeadPath()
        if head.motion is not None:
            path.texts.append(head.motion(path, self.rng))
            path.end_stage()
        else:
            move = PRIMITIVES[head.primitive]
            for subgoal in subgoals:
                path.texts.append(move(path, subgoal, head, self.rng))
                path.end_stage()

        path.anchors = choose_anchors(path, subgoals, self._anchoring)
        if any(subgoal.must_rest for subgoal in subgoals):
            path.wait(_REST_S)

        if self.analysis.model.upright is not None:
            path.turn_over(self.analysis.model.upright)
        return path

    def _make_plan(
        self,
        tool: Tool,
        pose: Pose,
        path: HeadPath,
        subgoals: Sequence[Subgoal],
        enough: float,
    ) -> tuple[SampledPlan, float]:
        """Make the plan that moves the head along the path, and count its faults; for a high path it may rise before.

        Args:
            tool: which has the head.
            pose: of the head in the frame of the tool mount.
            path: of the head.
            subgoals: what the path is for.
            enough: see `FaultCounter.count`.
        """
        text = "; then ".join(dict.fromkeys(path.texts))
        rows = path.to_rows(pose, tool.gripper)
        plan = SampledPlan(rows, text, path.anchors, path.touching)
        fault = self.faults.count(tool, plan, subgoals, enough)
        does_here = fault <= self.faults.several  # in the first layout

        if does_here or not works_above_home(path, self.model):
            return plan, fault

        best = plan

        for longer in self._rise_before(plan, path):
            other = self.faults.count(tool, longer, subgoals, min(fault, enough))
            if other < fault:
                best = longer
                fault = other

        return best, fault

    def _rise_before(self, plan: SampledPlan, path: HeadPath) -> list[SampledPlan]:
        """Make plans that go to three distances from the base first, at the height of home, and then up.

        Args:
            plan: that begins near the bodies.
            path: of the head in it.
        """
        workspace = self.model.workspace
        home = self.model.home.position
        outward = workspace.from_axis(plan.rows[0])
        length = max(np.hypot(*outward), 1e-6)
        radii = (
            np.hypot(*workspace.from_axis(home)),
            round(workspace.inner + _FARTHER_M, 2),
            workspace.inner,
        )

        plans = []
        for radius in radii:
            ahead = np.repeat(plan.rows[:1], 2, axis=0)
            ahead[:, :2] = workspace.base[:2] + outward * (radius / length)
            ahead[0, 2] = home[2]
            longer = replace(
                plan,
                rows=np.vstack([ahead, plan.rows]),
                anchors=[Anchor(), Anchor(), *path.anchors],
                touching=[False, False, *path.touching],
            )
            plans.append(longer)

        return plans


@dataclass(frozen=True, eq=False)
class Part:
    """What does one of several errands.

    Attributes:
        maker: of its head and of its plans, in the layout as the errands before leave it.
        design: a tool with that head alone.
    """

    maker: Sampler
    design: FreshDesign

    @property
    def model(self) -> SceneModel:
        """The layout as the errands before leave it."""
        return self.maker.model

    @property
    def kind(self) -> str:
        """The kind of its head."""
        return self.design.placed.head.kind

    def make_plan(self) -> SampledPlan:
        """Sample another plan for the errand."""
        return self.maker.use(self.design.tool, lambda _: self.design.placed)


def find_least_faulty(make: Callable[[float], tuple[A, float]], tries: int) -> A:
    """Return the first result without fault, or the least faulty of ``tries``; more while none keeps the rules.

    Args:
        make: makes a sample, and says how faulty it is. It gets the least fault so far: a sample that has as many
            loses, so its other faults need no count.
        tries: samples, at most, unless all of them break rules.
    """
    best, least = make(np.inf)
    for count in range(1, _MOST_TRIES):
        if least == 0.0 or (count >= tries and least < BREAKS_RULES):
            break
        other, fault = make(least)
        if fault < least:
            best = other
            least = fault

    return best
