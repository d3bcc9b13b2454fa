"""Describe goals, and the reward that follows from them, in plain words."""

from __future__ import annotations

from collections.abc import Sequence

from core.goals import KEPT_M, STRAYED_M
from core.scene import Goal


def describe_goals(goals: Sequence[Goal], every: bool = False) -> list[str]:
    """Describe goals and the reward that `core.goals.goals_reward` makes of them, in lines."""
    lines = [f"{number}. {goal.name + ': ' if goal.name else ''}{_describe(goal)}" for number, goal in enumerate(goals)]
    if any(goal.moves for goal in goals):
        lines.append(
            "The progress of a goal is max(0, 1 - d / d0). Here d is how far its bodies are from it at the end, beyond "
            "the tolerance, d0 the same at the start; of several bodies it is the mean, and any one is the best."
        )
    count = "the mean of the goals' progress, by weight" if every else "the progress of the best goal"
    lines.append(f"The reward is {count}." if len(goals) > 1 else "The reward is the progress.")
    return lines


def _describe(goal: Goal) -> str:
    bodies = (" or " if goal.any else ", ").join(goal.bodies) or f"joint {goal.joint}"
    frame = f" in the frame of {goal.at}" if goal.at is not None else ""
    within = f" (within {goal.tolerance:g})" if goal.tolerance else ""
    axis, points = (tuple(round(float(n), 3) for n in vector) for vector in (goal.axis or (), goal.points))
    asked = {
        f"must get to {_place(goal.place or ())}{frame}{within}": goal.place is not None and goal.joint is None,
        f"must get to {', '.join(map(_place, goal.places))}{frame}, one each{within}": bool(goal.places),
        f"must get {goal.away or 0:g} m away from where it starts": goal.away is not None,
        f"must get to {goal.to or 0:g} m or rad{within}": goal.joint is not None,
        f"axis {axis} must point along {points}{frame}, within {goal.tolerance_deg:g} degrees": bool(axis),
        "must end at rest": goal.rest,
        "must end held by the robot, touching nothing fixed (half counts if it is only touched)": goal.held,
        f"by {goal.by_s or 0:g} s after the motion begins": goal.by_s is not None,
        "at any time, not at the end": goal.ever,
        f"after goal {goal.after}": goal.after is not None,
        f"weight {goal.weight:g}": goal.weight != 1,
    }
    parts = [f"{bodies} {'; '.join(text for text, meant in asked.items() if meant)}"] if goal.moves else []
    if goal.untouched:
        limit = f"press harder than {goal.max_force_n:g} N on" if goal.max_force_n else "touch"
        parts.append(f"the robot must not {limit} {', '.join(goal.untouched)}, or nothing is earned")
    if goal.keep:
        kept = ", ".join(goal.keep)
        parts.append(f"leave {kept} in place: less is earned beyond {KEPT_M:g} m, nothing from {STRAYED_M:g} m on")
    return "; ".join(parts)


def _place(place: Sequence[float | None]) -> str:
    free = zip("xyz", place, strict=False)
    return "(" + ", ".join(f"any {name}" if wanted is None else f"{wanted:g}" for name, wanted in free) + ")"
