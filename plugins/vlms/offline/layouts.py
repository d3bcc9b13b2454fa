"""Layouts of a task: the one that a plan is made for, and others that it must do in too."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from copy import copy
from dataclasses import replace

import numpy as np

from core.design import DesignError, Fixture, Tool
from core.designs.planning import look
from core.designs.rules import check_tool
from core.designs.start import SpawnRules
from core.designs.statics import check_weight
from core.geometry import Pose
from core.interfaces import ActionRepresentation, Brief, Perception, Seen
from plugins.vlms.offline.anchoring import find_turn
from plugins.vlms.offline.funnels import make_funnels
from plugins.vlms.offline.scene_analysis import SceneAnalysis

_OTHERS = 4  # layouts beside the first one
_DRAWN = 32  # layouts, of which the most unlike are chosen


class Layout:
    """A layout of a brief's task.

    Attributes:
        seen: the poses of bodies that a plan sees, and what judges them.
        analysis: its bodies and goals.
        spawn: the rules for where a tool may be at the start.
        fixture: what designs add to the scene.
    """

    def __init__(
        self,
        brief: Brief,
        turn: Pose | None = None,
        fixture: Fixture | None = None,
    ) -> None:
        """Read a brief. With a ``turn`` everything but the robot is moved by it. Designs add the ``fixture``.

        Raises:
            NothingToMove: see `SceneAnalysis`.
        """
        self.seen = _see(brief)
        if turn is not None:
            poses = {name: turn @ pose for name, pose in self.seen.poses.items()}
            self.seen = replace(self.seen, poses=poses)

        self.fixture = fixture
        self.analysis = SceneAnalysis(brief, turn, fixture)
        self.spawn = SpawnRules(brief.task, brief.scene_seed)

    def with_analysis(self, analysis: SceneAnalysis) -> Layout:
        """Return the same with other bodies or goals, as they are at a later time; plans see what it was at first."""
        later = copy(self)
        later.analysis = analysis
        return later


def make_layouts(brief: Brief) -> list[Layout]:
    """Make the layout that plans are made for, and if the brief's layouts vary, others in which they are checked.

    Raises:
        NothingToMove: see `SceneAnalysis`.
    """
    layout = Layout(brief)
    can_anchor = type(brief.actions).anchor is not ActionRepresentation.anchor
    if not (brief.task.ranges and can_anchor):
        return [_furnish(brief, layout)]

    turn = find_turn(layout.analysis, layout.seen)
    if turn is not None:
        layout = Layout(brief, turn)
    return [layout, *(Layout(other) for other in _choose_unlike(brief))]


def _furnish(brief: Brief, layout: Layout) -> Layout:
    """Return the layout with a funnel, where the task has a place for one, and the same where not."""
    region = brief.task.fixture
    if region is None or brief.task.ranges:
        return layout

    for funnel in make_funnels(region, layout.analysis):
        with suppress(DesignError):  # it is in something
            layout.spawn.check_start(Tool(fixture=funnel))
            return Layout(brief, fixture=funnel)

    return layout


def _choose_unlike(brief: Brief) -> list[Brief]:
    """Choose briefs of layouts that are as unlike this one and each other as can be, with the same bodies."""
    alike = []
    places = []
    names = list(_see(brief).poses)

    for i in range(_DRAWN):
        other = replace(brief, scene_seed=brief.scene_seed + i)
        poses = _see(other).poses
        if list(poses) == names:
            alike.append(other)
            places.append(np.ravel([pose.matrix[:3] for pose in poses.values()]))

    points = np.array(places)
    chosen = [0]
    while len(chosen) < min(1 + _OTHERS, len(alike)):
        distances = np.linalg.norm(points[:, None] - points[chosen], axis=-1)
        chosen.append(int(distances.min(axis=1).argmax()))

    return [alike[number] for number in chosen[1:]]


def _see(brief: Brief) -> Seen:
    """Return what a plan sees in a brief's layout, without noise."""
    return look(brief.task, brief.scene_seed, Perception())


def is_too_heavy(tool: Tool, brief: Brief) -> bool:
    """Report whether a tool weighs more than its material's budget or the arm allow.

    Args:
        tool: of any origin.
        brief: which has the material and the arm.
    """
    material = brief.representation.material

    try:
        check_weight(material.made(tool), brief.task.robot, material)
    except DesignError:
        return True

    return False


def keeps_rules(tool: Tool, brief: Brief, layouts: Sequence[Layout]) -> bool:
    """Report whether a tool keeps the rules in all layouts.

    Args:
        tool: of any origin.
        brief: which has the material.
        layouts: in which it must be clear of everything at the start.
    """
    material = brief.representation.material

    try:
        check_tool(material.made(tool), brief.task.robot, material)
        for layout in layouts:
            layout.spawn.check_start(tool)
    except DesignError:
        return False

    return True
