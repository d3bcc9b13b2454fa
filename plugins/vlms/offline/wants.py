"""Say what a tool may do for a task: the alternatives that its goals leave, and limits that no tool heeds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import chain, groupby

from core.goals import Want, find_wants, limits
from core.interfaces import Task
from core.scene import Scene

_AWAY_M = 0.1  # that a body is moved where a task has no goals


def list_alternatives(task: Task, scene: Scene) -> list[tuple[Want, ...]]:
    """List the alternatives that a task leaves, each of wants that are fulfilled one after another.

    Where one goal, or one body of it, is enough, each is an alternative. For a task without goals the first free body
    is moved anywhere.

    Args:
        task: whose goals are read.
        scene: the layout.
    """
    wants = find_wants(task.goals, scene)
    if not task.goals:
        wants = [Want((body.name,), away=_AWAY_M) for body in scene.free[:1]]

    goals = groupby(wants, lambda want: want.number)
    options = [_split(list(goal)) for _, goal in goals]
    alternatives = [*chain.from_iterable(options)]
    if not (task.every and len(options) > 1):
        return alternatives

    # Of what a goal leaves open, the first will do; and where no way does all goals, one is better than none.
    together = tuple(chain.from_iterable(option[0] for option in options))
    return [together, *alternatives]


def _split(wants: Sequence[Want]) -> list[tuple[Want, ...]]:
    """Split the wants of a goal into alternatives: one for each body, where one is enough."""
    if not wants[0].any:
        return [tuple(wants)]

    alternatives: list[tuple[Want, ...]] = []
    for want in wants:
        for body in want.bodies:
            alternatives.append((replace(want, bodies=(body,)),))

    return alternatives


def list_unheeded(task: Task, scene: Scene) -> list[str]:
    """List the limits of a task to which no way of using a tool pays regard, in words.

    A tool stays away from all that it doesn't move, so that only limits are left that are about what it moves, or that
    hold something all the time.

    Args:
        task: whose limits are read.
        scene: the layout.
    """
    wants = find_wants(task.goals, scene)
    moved = {*chain.from_iterable(want.bodies for want in wants)}
    unheeded = []

    for limit in limits(task.goals):
        named = {name for _, name in limit.list_named()}
        if not limit.holds_untouched or not moved.isdisjoint(named):
            unheeded.append(limit.describe())

    return unheeded
