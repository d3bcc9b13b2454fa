"""Say in one plain sentence what a run found."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from core.goals import reaches
from core.support.text import clean, number
from core.trial import NOTHING
from plugins.listeners.summary.second_engine import describe_second_engine

if TYPE_CHECKING:
    from core.events import Result, Run
    from core.interfaces import Evaluation

LONGEST = 60  # letters of a tool's name
REMARK = 2000  # letters of whether it can be made


def tell_in_short(run: Run, result: Result) -> Iterator[str]:
    """Say which tool did what, what that earned here and in another engine, and whether it can be made.

    For example: "in short: J hook of 273 g solves the task, to bring cube to its place: reward 0.995; in mujoco it
    earns 0.977; printable: yes, in 3 pieces, about 13 hours, 273 g of pla".

    Args:
        run: whose task has goals.
        result: of the run.
    """
    best = result.best
    if best is None or best.candidate.tool is None:
        return

    tool = best.candidate.tool
    name = clean(tool.name or best.candidate.design_name, LONGEST) or "tool"
    mass = f" of {1000 * tool.mass:.0f} g" if tool.components else ""
    does = _say_what_is_done(run, best)
    parts = [f"in short: {name}{mass} {does}: reward {number(best.reward, 3)}"]
    if result.second_engine is not None:
        parts.append(describe_second_engine(result.second_engine))

    if result.making is not None:
        parts.append(clean(result.making.words, REMARK))

    yield "; ".join(parts)


def _say_what_is_done(run: Run, best: Evaluation) -> str:
    """Say by the goals what the task wants, and whether it was done: wholly, in part or not.

    What was done but for a limit that was missed is done in part: the limit is named.
    """
    tasks = run.task.parts
    goals = [goal for task in tasks for goal in reaches(task.goals)]
    wanted = [*dict.fromkeys(goal.in_short() for goal in goals)]
    joint = " and " if run.task.every or len(tasks) > 1 else " or "
    what = joint.join(wanted) or f"do {run.task.name}"

    if best.solved:
        return f"solves the task, to {what}"
    if best.reward >= NOTHING:
        least = best.least_margin
        missed = f" ({least})" if least is not None and least.margin < 0 else ""
        return f"solves the task in part, to {what}{missed}"
    return f"does not solve the task, to {what}"
