"""Say in one plain sentence what a run found."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from core.goals import Away, Broken, Facing, JointAt, Placed, Reach, Turned, reaches
from core.plugins import installed
from core.support.text import clean, number
from core.trial import NOTHING

if TYPE_CHECKING:
    from core.events import Result, Run
    from plugins.listeners.summary.elsewhere import Elsewhere

LONGEST = 60  # letters of a tool's name
REMARK = 300  # letters of what a plugin says
MANY = 3  # bodies that are named; of more it is said how many


def tell_in_short(
    run: Run, result: Result, elsewhere: Elsewhere | None
) -> Iterator[str]:
    """Say which tool did what, what that earned here and in another engine, and what plugins remark.

    For example: "in short: a J hook of 45 g brings cube to its place: 0.995; in mujoco it earns 0.977; printable in
    pla: yes".

    Args:
        run: whose task has goals.
        result: of the run.
        elsewhere: what came of it in another engine; None: it was tried in none.
    """
    best = result.best
    if best is None or best.candidate.tool is None:
        return

    tool = best.candidate.tool
    name = clean(tool.name or best.candidate.design_name, LONGEST) or "tool"
    mass = f" of {1000 * tool.mass:.0f} g" if tool.components else ""
    does = _say_what_is_done(run, best.reward)
    parts = [f"in short: {name}{mass} {does}: {number(best.reward, 3)}"]
    if elsewhere is not None:
        parts.append(elsewhere.outcome)

    for remark in installed().factories("remark").values():
        said = remark(run, best.candidate)
        if said:
            parts.append(clean(said, REMARK))

    yield "; ".join(parts)


def _say_what_is_done(run: Run, reward: float) -> str:
    """Say by the goals what the task wants, and whether it was done: wholly, in part or not."""
    tasks = run.task.parts
    goals = [goal for task in tasks for goal in reaches(task.goals)]
    wanted = [*dict.fromkeys(map(_say_goal, goals))]
    joint = " and " if run.task.every or len(tasks) > 1 else " or "
    what = joint.join(wanted) or f"do {run.task.name}"

    if reward >= run.task.success_reward:
        return f"does what is wanted, to {what}"
    if reward >= NOTHING:
        return f"does in part what is wanted, to {what}"
    return f"does not do what is wanted, to {what}"


def _say_goal(goal: Reach) -> str:
    """Say what a goal wants, beginning with a verb."""
    bodies = ", ".join(goal.bodies)
    if len(goal.bodies) > MANY:
        bodies = f"{len(goal.bodies)} bodies"

    match goal:
        case Placed(at=str(other)):
            return f"bring {bodies} to its place at {other}"
        case Placed():
            return f"bring {bodies} to its place"
        case Away():
            return f"move {bodies} by {goal.away:.2g} m"
        case Broken():
            return f"break {goal.subject}"
        case JointAt():
            return f"move the joint {goal.joint}"
        case Turned():
            return f"turn {bodies}"
        case Facing():
            return f"turn {bodies} to {goal.facing}"

    return f"hold {bodies}" if goal.held else f"lay down {bodies}"
