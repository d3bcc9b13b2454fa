"""The parents of offspring: what breeding needs of evaluations."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from core.design import DesignError, Tool
from core.geometry import Array
from core.interfaces import ActionPlan, Anchor, Seen, Sighted, Waypoints
from core.trial import Evaluation

_SCALE = 1.5  # of changes, for the whole reward that is missing
_LEAST_SCALE = 0.05
_LATER_ROUND = re.compile(r"round ([2-9]|\d\d)")  # where a look stands in a plan


@dataclass(frozen=True, eq=False)
class Parent:
    """An elite that offspring are bred from.

    Attributes:
        id: of the candidate.
        tool: of the candidate.
        rows: the waypoints of its plan in this layout, (N, 6) or (N, 7).
        anchors: what each waypoint stands by.
        reward: what it earned, 0..1.
        moved_m: how far it moved bodies, by name.
    """

    id: str
    tool: Tool
    rows: Array
    anchors: Sequence[Anchor]
    reward: float
    moved_m: dict[str, float]

    @property
    def scale(self) -> float:
        """The scale of changes, `_LEAST_SCALE` to 1: the better the parent, the smaller."""
        return float(np.clip(_SCALE * (1.0 - self.reward), _LEAST_SCALE, 1.0))


def find_parents(
    evaluations: Sequence[Evaluation],
    gripper: bool,
    seen: Seen,
) -> list[Parent]:
    """Return the elites with a gripper tool, or those with a rigid one; their plans as they are in this layout.

    A waypoint that ends by a guard is left out, and so is the way back from it. Of a loop the first round counts.

    Args:
        evaluations: of elites, the best first.
        gripper: which kind of tool is asked for.
        seen: the layout.
    """
    known = {*seen.poses, Anchor().name, Anchor().toward}
    parents = []
    for evaluation in evaluations:
        candidate = evaluation.candidate
        tool = candidate.tool
        if tool is None or tool.gripper != gripper:
            continue

        known_then, end = _see_first_round(candidate.plan, seen)
        plan = candidate.plan.resolve(known_then)
        kept = [i for i in _find_unguarded(plan) if i < end]
        given = candidate.plan.find_anchors(known_then)
        if len(given) != len(plan.poses):
            given = (Anchor(),) * len(plan.poses)

        # The world stands for what is not seen, such as where a guard ended.
        anchors = []
        for i in kept:
            is_known = {given[i].name, given[i].toward} <= known
            anchors.append(given[i] if is_known else Anchor())

        shown = evaluation.shown
        moved_m = shown.moved_m if shown is not None else {}
        parents.append(
            Parent(
                candidate.id,
                tool,
                plan.poses[kept],
                anchors,
                evaluation.reward,
                moved_m,
            )
        )

    return parents


def _see_first_round(plan: ActionPlan, seen: Seen) -> tuple[Seen, int]:
    """See a layout as a plan does in the first round of its loops, if nothing moves.

    Args:
        plan: that may look.
        seen: the layout before the motion.

    Returns:
        The layout with what those looks see, and how many waypoints there are before the next round.
    """
    known = seen
    waypoints = plan.resolve(seen)
    taken = 0

    while len(waypoints.looks) > taken:
        if _LATER_ROUND.search(waypoints.looks[taken].where):
            last = max(taken - 1, 0)
            return known, waypoints.looks[last].after

        taken += 1
        looking = replace(seen, looks=(Sighted(seen.poses),) * taken)
        try:
            waypoints = plan.resolve(looking)
        except DesignError:
            return known, len(plan.resolve(known))
        known = looking

    return known, len(waypoints)


def _find_unguarded(plan: Waypoints) -> list[int]:
    """Find the waypoints that neither end by a guard nor lead back from one that does."""
    rows = plan.poses.tolist()
    if not plan.guards:
        return list(range(len(rows)))

    kept = []
    for i, guard in enumerate(plan.guards):
        leads_back = i > 1 and plan.guards[i - 1] and rows[i] == rows[i - 2]
        if not guard and not leads_back:
            kept.append(i)

    return kept
