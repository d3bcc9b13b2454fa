"""Say more of the winner of a run, and what to type next; then what failed, and why."""

from __future__ import annotations

import os
import shlex
import shutil
import sys
from collections import defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING, Any

from core.config.schemas import PromptSettings
from core.design import Candidate
from core.hooks import hookimpl
from core.plugins import installed
from core.store.run_figures import failed_layouts
from core.support.cli import print_table, say
from core.support.text import by_reason, clean, count_words, hydra_word, number
from core.trial import NOTHING, Evaluation, Trial, best_tools
from core.values.efforts import PERTURBED
from core.values.messages import Bill, sum_known

if TYPE_CHECKING:
    from core.events import Result, Run
    from core.interfaces import Reply

_LONGEST = 60  # letters of a name
_LITTLE = 0.1  # a run whose best earns less says what was not tried
_LINE = 400  # letters of what was observed
_REASONS = 5  # why candidates earned nothing or less


class SummaryListener:
    """Prints what is to be said of the winner, its film, and what to type next; then what failed, and why::

        python -m core.run task=BringCube listener.summary.top=5

    The words are in ``templates/``. All goes to standard error, so that standard output stays free for results.

    Args:
        top: how many tools are listed.
    """

    def __init__(self, top: int = 3) -> None:
        self.top = top
        self._replies: list[Reply] = []

    @hookimpl
    def reply_received(self, reply: Reply) -> None:
        """Keep a reply for the sum of what it cost."""
        self._replies.append(reply)

    @hookimpl(trylast=True)
    def run_finished(self, run: Run, result: Result) -> None:
        """Print it after other listeners, whose files it names."""
        bill = Bill.of(self._replies)
        values = {
            "result": result,
            "best": result.best,
            "replies": len(self._replies),
            "bill": bill,
            "tokens": sum_known([bill.prompt_tokens, bill.completion_tokens]),
            "untried": clean(_find_first_reason(result), _LINE),
            "commands": list(_next_steps(run, result)),
            "clean": clean,
            "count_words": count_words,
            "mean": fmean,
            "named": _name,
            "nothing": NOTHING,
            "perturbed": PERTURBED,
            "second": _describe_second_engine(result.second_engine),
        }
        if result.best is not None:
            values |= _judge_winner(run, result, result.best)

        self._say("winner", values)
        if result.best is not None:
            say("", "the best tools:", file=sys.stderr)
            _print_tools(result, self.top)

        self._say("failures", values | _list_failures(run, result))
        self._say("in_short", values)

    def _say(self, template: str, values: Mapping[str, Any]) -> None:
        # Imported here, since each command's start asks for this class's settings.
        from core.support.templates import fill

        text = fill("plugins.listeners.summary", template, **values)
        say(*text.splitlines(), file=sys.stderr)


def _find_first_reason(result: Result) -> str:
    """Say why the first candidate could not be tried."""
    return next((e.reason for e in result.evaluations), "no candidate came")


def _judge_winner(run: Run, result: Result, best: Evaluation) -> dict[str, Any]:
    """Return what is known of the best candidate, by the names in the templates."""
    tools = [evaluation.candidate.tool for evaluation in result.evaluations]
    gripping = any(tool.gripper for tool in tools if tool is not None)
    finals = best.finals.in_order()
    film = run.folder / "best" / "rollout.gif"

    return {
        "why": _find_cause(run, best),
        "only_rigid": best.reward < _LITTLE
        and not gripping
        and run.task.robot.gripper is not None,
        "changes": [t.reward for t in finals if t.where.change is not None],
        "highest": max(result.ranking, key=lambda tried: tried.reward, default=best),
        "shares": _share_out(result, best),
        "bench_count": run.task.draw(run.seed).count,
        "benches": _try_benches(run, result, best),
        "film": _shorten(film) if film.exists() else "",
        "tool": best.candidate.tool,
        "wanted": _say_what_is_wanted(run),
    }


def _find_cause(run: Run, best: Evaluation) -> str:
    """Say why the best candidate earned nothing, or less than success; empty: that is not known."""
    known = best.observation is not None or best.reason
    if not known or best.solved:
        return ""

    level = installed().factory("level", PromptSettings.context)()
    observed = level.report(best, run.task).get("observed", best.reason)
    return clean(observed, _LINE)


def _name(candidate: Candidate) -> str:
    """Return the name of a candidate's tool, or of its design; or empty."""
    tool = candidate.tool
    return clean((tool and tool.name) or candidate.design_name, _LONGEST)


def _describe_second_engine(trial: Trial | None) -> str:
    """Say what the winner earned in a second engine, or that it could not be tried there; empty: it was not."""
    if trial is None:
        return ""
    if trial.status == "failed" and not trial.measured:
        return f"the best could not be tried in {trial.engine}"

    return f"in {trial.engine} it earns {number(trial.reward, 3)}"


def _say_what_is_wanted(run: Run) -> str:
    """Say by the goals what the task wants."""
    from core.goals import reaches

    tasks = run.task.parts
    goals = [goal for task in tasks for goal in reaches(task.goals)]
    wanted = [*dict.fromkeys(goal.in_short() for goal in goals)]
    joint = " and " if run.task.every or len(tasks) > 1 else " or "
    return joint.join(wanted) or f"do {run.task.name}"


def _next_steps(run: Run, result: Result) -> Iterator[str]:
    """Yield commands to look further, which can be pasted into a shell in the working directory."""
    activate = Path(sys.prefix) / "bin" / "activate"
    if shutil.which("vlmgineer") is None and activate.is_file():
        yield f"source {shlex.quote(_shorten(activate))}"

    folder = shlex.quote(_shorten(run.folder))
    if "rerun" in run.config.get("listener", {}):
        yield f"vlmgineer view {folder}"

    if result.best is not None:
        designs = f"designs={hydra_word(_shorten(run.folder))}"
        yield f"vlmgineer report {folder}"
        yield f"vlmgineer evaluate {shlex.quote(designs)}"


def _print_tools(result: Result, top: int) -> None:
    """Print a table of the best tools, each with its best plan.

    Args:
        result: of the run, which has a best candidate.
        top: how many tools.
    """
    numbers = ("reward", "distance m", "components", "mass g")
    rows = []

    assert result.best is not None
    for evaluation in best_tools([result.best, *result.ranking])[:top]:
        candidate = evaluation.candidate
        tool = candidate.tool
        assert tool is not None

        row = (
            number(evaluation.reward, 3),
            number(evaluation.distance_m, 2),
            str(len(tool.components)),
            f"{1000 * tool.mass:.0f}",
            candidate.id,
            _name(candidate),
        )
        rows.append(row)

    print_table((*numbers, "candidate", "tool"), rows, numbers, sys.stderr)


def _list_failures(run: Run, result: Result) -> dict[str, Any]:
    """Return in which unseen layouts the best failed, and why candidates earned nothing or less than they might."""
    reasons = [
        (evaluation.candidate.id, evaluation.reason or evaluation.why_nothing)
        for evaluation in result.evaluations
    ]
    return {
        "unseen": list(failed_layouts(run, result)),
        "reasons": by_reason(reasons),
        "failed": sum(bool(reason) for _, reason in reasons),
        "most": _REASONS,
        "shorten": lambda film: _shorten(run.folder / film),
    }


def _try_benches(run: Run, result: Result, best: Evaluation) -> dict[int, bool]:
    """Say of each bench that fits photographs whether the best candidate held; empty: layouts are no such benches."""
    count = run.task.draw(run.seed).count
    held = defaultdict[int, bool](lambda: True)
    if count:
        for trial in (*best.trials, *best.finals.in_order(), *result.unseen_trials):
            held[trial.layout % count] &= trial.solved

    return held


def _share_out(result: Result, best: Evaluation) -> dict[str, tuple[float, float]]:
    """Return for each of several tasks or goals the mean that the best candidate earned, and the most by any."""
    own = [best.figures]
    every = [evaluation.figures for evaluation in result.ranking]
    names = list(best.tasks)
    if len(names) < 2:
        own = [dict(trial.goals) for trial in best.trials if trial.goals]
        every = [dict(t.goals) for tried in result.ranking for t in tried.trials]
        names = list(own[0]) if own else []

    return {
        name: (
            fmean(figures.get(name, 0.0) for figures in own),
            max(figures.get(name, 0.0) for figures in every),
        )
        for name in names
    }


def _shorten(path: Path) -> str:
    """Return a path, or the way to it from the working directory where that is shorter."""
    return min(str(path), os.path.relpath(path), key=len)
