"""Find where a plan that feels or looks goes on otherwise in a dry run than in the search.

A dry run plays the samples of an export. They are smoothed for an arm: they are off by up to 0.6 mrad, and each move
ends some hundredths of a second later. So what is pushed comes to lie a little elsewhere, and a look may see it or not.
"""

from __future__ import annotations

from collections.abc import Hashable
from itertools import zip_longest

from core.design import Candidate
from core.interfaces import Condition, Felt, Looked, Reactions
from core.scene import Scene
from core.simulation.attempt import prepare


def describe_parting(
    condition: Condition, candidate: Candidate, scene: Scene, played: Reactions
) -> str:
    """Say at which guard or look a dry run first differs from the search; empty: at none.

    Args:
        condition: the task, the layout and the engine of both.
        candidate: has the plan.
        scene: of the layout.
        played: what was felt and seen in the dry run.

    Raises:
        DesignError: the plan means nothing in this layout.
    """
    searched = _play_as_searched(condition, candidate, scene)
    pairs = zip_longest(_list_events(searched), _list_events(played))

    for was, now in pairs:
        if was is None:
            return f"differs from the search: {_name(now)}; the search ended before"
        if now is None:
            return f"differs from the search: it ended before {_name(was)}"
        if _outcome_of(was) != _outcome_of(now):
            return f"differs from the search: {_name(now)}; in the search: {_name(was)}"

    return ""


def _play_as_searched(
    condition: Condition, candidate: Candidate, scene: Scene
) -> Reactions:
    """Play a plan as a search does, and return what it felt and saw."""
    _, job = prepare(
        condition.task.shared(),
        candidate,
        condition.layout,
        condition.settings,
        scene=scene,
    )
    condition.sim.shared().rollout(condition.task.shared(), [job])
    assert job.reactions is not None
    return job.reactions


def _list_events(reactions: Reactions) -> list[Felt | Looked]:
    """List how guards ended and what looks saw, as it happened."""
    events: list[Felt | Looked] = [*reactions.felt, *reactions.looked]
    return sorted(events, key=lambda event: event.at_s)


def _name(event: Felt | Looked) -> str:
    """Describe a guard or a look, with the waypoint before it."""
    if isinstance(event, Felt):
        return str(event)

    return f"after waypoint {event.waypoint} {event}"


def _outcome_of(event: Felt | Looked) -> Hashable:
    """Return what decides how a plan goes on: without times and forces, which are never quite the same."""
    if isinstance(event, Felt):
        return event.waypoint, event.fired

    return event.waypoint, event.where, tuple(event.hidden), event.left
