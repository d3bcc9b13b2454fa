"""Errands: goals that one head can't reach together, in the order in which they are reached.

What opens a way comes before what goes there, and what closes it comes after.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from core.geometry import Array, Pose
from plugins.vlms.offline.boxes import UP
from plugins.vlms.offline.guided import needs_guided_head
from plugins.vlms.offline.scene_analysis import SceneAnalysis
from plugins.vlms.offline.subgoals import Subgoal, goal_position
from plugins.vlms.offline.targets import Target

_HELD_M = 0.15  # what is to be held is lifted by about this

Order = list[list[int]]
"""The numbers of the goals of each errand, one errand after another."""


def spread_goals(analysis: SceneAnalysis) -> SceneAnalysis:
    """Return an analysis in which each position of a joint is a goal of its own, where there are other goals, too.

    Args:
        analysis: of a layout.
    """
    groups = []
    for group in analysis.groups:
        goals = [*group]
        if len(group) > 1:
            goals = [replace(goal, later=()) for goal in group]
            for goal in group:
                later = [
                    replace(goal, to=to, later=(), ever=False) for to in goal.later
                ]
                goals += later

        groups.append(goals)

    return analysis.with_groups(groups)


def find_errands(analysis: SceneAnalysis) -> Order:
    """Find the errands of goals that must all be reached; one at most: a head reaches all that is to be reached.

    Goals that follow each other and need no guided head are one errand.

    Args:
        analysis: of a layout, in which goals are spread.
    """
    if len(analysis.groups) > 1 or analysis.model.draws_up:
        return []

    (goals,) = analysis.groups
    errands: Order = []
    was_guided = True

    for number in _sort(goals, analysis):
        is_guided = needs_guided_head(_aim(goals[number], analysis))
        if is_guided or was_guided:
            errands.append([])
        errands[-1].append(number)
        was_guided = is_guided

    return errands


def _sort(goals: Sequence[Target], analysis: SceneAnalysis) -> list[int]:
    """Sort the numbers of goals by when they are to be reached; those between which nothing decides stay as they are.

    Args:
        goals: that must all be reached.
        analysis: of a layout.
    """
    waiting = [*range(len(goals))]
    earlier = {number: _find_earlier(number, goals, analysis) for number in waiting}
    order: list[int] = []

    while waiting:
        ready = [number for number in waiting if not earlier[number] & {*waiting}]
        chosen = (ready or waiting)[0]
        waiting.remove(chosen)
        order.append(chosen)

    return order


def _find_earlier(
    number: int, goals: Sequence[Target], analysis: SceneAnalysis
) -> set[int]:
    """Find the numbers of the goals that are to be reached before one of them.

    Args:
        number: of the goal.
        goals: that must all be reached.
        analysis: of a layout.
    """
    goal = goals[number]
    found = set()
    for other_number, other in enumerate(goals):
        if other_number == number:
            continue

        is_said = goal.after is not None and other.number == goal.after
        same_joint = goal.joint is not None and other.joint == goal.joint
        is_next = same_joint and other_number < number
        opens = _changes_way(other, goal, analysis) < 0
        closes = _changes_way(goal, other, analysis) > 0
        is_last = goal.held and not other.held
        if is_said or is_next or opens or closes or is_last:
            found.add(other_number)

    return found


def _changes_way(mover: Target, goal: Target, analysis: SceneAnalysis) -> int:
    """Find by how many things more a body's way is barred once a joint is moved: fewer than 0, if it is opened.

    Args:
        mover: the goal with the joint; nothing is changed by one without.
        goal: the one with the body; nothing bars that of a joint.
        analysis: of a layout.
    """
    if mover.joint is None or goal.joint is not None or goal.breaks:
        return 0

    later = analysis.with_groups([[goal]]).after([_aim(mover, analysis)])
    (goal_later,) = later.goals
    return _count_bars(_aim(goal_later, later)) - _count_bars(_aim(goal, analysis))


def _count_bars(subgoal: Subgoal) -> int:
    """Count what is in the way of bodies: above them here, above their goal, at their goal, and straight between."""
    there = [solid.moved_by(Pose(subgoal.shift)) for solid in subgoal.solids]
    at_goal = Subgoal(there, np.zeros(3), subgoal.model, subgoal.goal)
    bars = [
        subgoal.is_covered,
        at_goal.is_covered,
        at_goal.is_blocked(np.zeros(3)),
        subgoal.is_blocked(subgoal.shift),
    ]
    return sum(bars)


def _aim(goal: Target, analysis: SceneAnalysis) -> Subgoal:
    """Make the subgoal of a goal as far as nothing of it is drawn.

    Args:
        goal: with its bodies.
        analysis: of a layout.
    """
    solids = [analysis.model.solids[name] for name in goal.bodies]
    return Subgoal(solids, _find_shift(goal, solids[0].position), analysis.model, goal)


def _find_shift(goal: Target, here: Array) -> Array:
    """Find how far (3,) a goal wants bodies moved; zeros: it does not say which way.

    Args:
        goal: of any kind.
        here: where the first body is, (3,).
    """
    if goal.place is not None:
        return goal_position(here, goal) - here
    if goal.held:
        return _HELD_M * UP

    return np.zeros(3)
