"""Say more of the winner of a run, and what to type next; then what failed, and why."""

from __future__ import annotations

import os
import shlex
import shutil
import sys
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING

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

    All goes to standard error, so that standard output stays free for results.

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
        from plugins.listeners.summary.in_short import tell_in_short
        from plugins.listeners.summary.second_engine import explain_second_engine

        best = result.best
        lines = [_spent(self._replies)]

        if best is None:
            first = next((e.reason for e in result.evaluations), "no candidate came")
            lines.append(f"no candidate could be tried: {first}")
        else:
            lines = [
                *_causes(run, best),
                *_untried(run, result, best),
                _explain_id(best.candidate),
                *lines,
            ]
            lines += _remarks(run, result, best)
            if result.second_engine is not None:
                lines.append(explain_second_engine(result.second_engine))

        say(*lines, *_next_steps(run, result), file=sys.stderr)
        if best is not None:
            say("", "the best tools:", file=sys.stderr)
            _print_tools(result, self.top)

        say(*_unseen_failures(run, result), *_failures(result), file=sys.stderr)
        say(*tell_in_short(run, result), file=sys.stderr)


def _causes(run: Run, best: Evaluation) -> Iterator[str]:
    """Say why the best candidate earned nothing, or less than success, where that is known."""
    known = best.observation is not None or best.reason
    if not known or best.solved:
        return

    level = installed().factory("level", PromptSettings.context)()
    observed = level.report(best, run.task).get("observed", best.reason)
    head = "why not more" if best.reward >= NOTHING else "why nothing was earned"
    yield f"{head}: {clean(observed, _LINE)}"


def _untried(run: Run, result: Result, best: Evaluation) -> Iterator[str]:
    """Say of a run that earned little that tools for the gripper were not tried, where the arm has one."""
    tools = [evaluation.candidate.tool for evaluation in result.evaluations]
    gripping = any(tool.gripper for tool in tools if tool is not None)

    if best.reward < _LITTLE and not gripping and run.task.robot.gripper is not None:
        yield "tools for the gripper were not asked for: task.tool_kinds=[rigid,gripper]"


def _explain_id(candidate: Candidate) -> str:
    """Say what the id of the best candidate means, and what its tool is called."""
    where = f"generation {candidate.generation}, agent {candidate.agent}, design {candidate.design}"
    line = f"{candidate.id}: {where}, plan {candidate.action}"
    name = clean(_name(candidate), _LONGEST)

    return f"{line}; its designer calls the tool {name}" if name else line


def _name(candidate: Candidate) -> str:
    """Return the name of a candidate's tool, or of its design; or empty."""
    tool = candidate.tool
    return (tool and tool.name) or candidate.design_name


def _next_steps(run: Run, result: Result) -> Iterator[str]:
    """Yield where the film of the best is, and commands to look further.

    They can be pasted into a shell in the working directory: the recording, the report, the best design tried again.
    """
    film = run.folder / "best" / "rollout.gif"
    if result.best is not None and film.exists():
        yield f"film: {_shorten(film)}"

    yield "what to type next:"
    activate = Path(sys.prefix) / "bin" / "activate"
    if shutil.which("vlmgineer") is None and activate.is_file():
        yield f"  source {shlex.quote(_shorten(activate))}"

    folder = shlex.quote(_shorten(run.folder))
    if "rerun" in run.config.get("listener", {}):
        yield f"  vlmgineer view {folder}"

    if result.best is None:
        return

    yield f"  vlmgineer report {folder}"
    designs = f"designs={hydra_word(_shorten(run.folder))}"
    yield f"  vlmgineer evaluate {shlex.quote(designs)}"


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
            clean(_name(candidate), _LONGEST),
        )
        rows.append(row)

    print_table((*numbers, "candidate", "tool"), rows, numbers, sys.stderr)


def _failures(result: Result) -> Iterator[str]:
    """Say under a heading why candidates were rejected, failed, or earned nothing or less than their rollout did.

    The most common reasons come first, each with the first candidate that it spoke against.
    """
    reasons = [
        (evaluation.candidate.id, evaluation.reason or evaluation.why_nothing)
        for evaluation in result.evaluations
    ]
    lines = by_reason(reasons)
    if not lines:
        return

    failed = sum(bool(reason) for _, reason in reasons)
    yield ""
    yield f"what failed, and why ({failed} of {len(reasons)} candidates):"
    for line in lines[:_REASONS]:
        yield f"  {line}"

    if len(lines) > _REASONS:
        yield f"  and {len(lines) - _REASONS} more reasons: vlmgineer report has them"


def _remarks(run: Run, result: Result, best: Evaluation) -> Iterator[str]:
    """Say what is to be said of the best candidate.

    That is what decided for it, how far it fulfilled what the task wants, how close it was to a limit, and what it
    earned in layouts that the search never saw.
    """
    yield from _tied(result, best)

    if len(best.tasks) > 1:
        every = [evaluation.figures for evaluation in result.ranking]
        yield _compare("tasks", best.tasks, [best.figures], every)
    else:
        yield from _goals(result, best)

    least = best.least_margin
    if least is not None and least.name != "reward":
        yield f"least margin of the best {number(least.margin, 2)}: {least}"

    if best.hardest is not None:
        engines = dict.fromkeys(trial.engine for trial in best.trials)
        counted = f"as {', '.join(engines)} counts it (engines differ in this)"
        yield f"most torque of the best: {best.hardest}, {counted}"

    yield from _count_benches(run, result, best)

    if result.held.layouts:
        yield f"the best {result.held.words()}"

    perturbed = result.perturbed.count_held()
    if perturbed.layouts:
        yield f"the best {perturbed.words(PERTURBED)}"

    for engine, rewards in result.unseen.items():
        mean = number(fmean(rewards), 3)
        worst = number(min(rewards), 3)
        earned = f"the best earned {mean} on average, {worst} in the worst ({engine})"
        yield f"in {len(rewards)} unseen layouts {earned}"


def _count_benches(run: Run, result: Result, best: Evaluation) -> Iterator[str]:
    """Say in how many of the benches that fit photographs the best candidate held, where layouts are such benches."""
    count = run.task.draw(run.seed).count
    if not count:
        return

    solved = defaultdict[int, list[bool]](list)
    for trial in (*best.trials, *best.finals.in_order(), *result.unseen_trials):
        solved[trial.layout % count].append(trial.solved)

    held = sum(map(all, solved.values()))
    line = f"the best holds in {held} of {len(solved)} benches as yours may be"
    yield line if len(solved) == count else f"{line}, of {count} that there are"


def _unseen_failures(run: Run, result: Result) -> Iterator[str]:
    """Say under a heading in which unseen layouts the best failed: why, what was drawn there, and where a film is."""
    failed = list(failed_layouts(run, result))
    if not failed:
        return

    yield ""
    yield f"unseen layouts in which the best fails ({len(failed)} of {len(result.unseen_trials)}), and why:"
    for layout in failed[:_REASONS]:
        where = f"layout {layout.layout}, {layout.engine}"
        why = clean(layout.cause, _LINE) or "it earns less than success"
        drawn = ", ".join(f"{name} {value:g}" for name, value in layout.draw.items())
        yield f"  {where}: reward {number(layout.reward, 3)}, {why}"
        yield f"    drawn: {clean(drawn, _LINE)}"
        if layout.film:
            yield f"    film: {_shorten(run.folder / layout.film)}"

    if len(failed) > _REASONS:
        yield f"  and {len(failed) - _REASONS} more: result.json has them"


def _tied(result: Result, best: Evaluation) -> Iterator[str]:
    """Say what decided between candidates that earned alike, or why the best has not the highest reward.

    A reward within ``evolution.tie`` of the highest one counts as equal to it (`core.trial.best_first`).
    """
    finals = best.finals.in_order()
    changed = [trial for trial in finals if trial.where.change is not None]
    if changed:
        yield _describe_changes(best, changed)
    elif len(result.finals) > 1:
        tried = f"{len(result.finals)} candidates were tried in more layouts"
        yield f"{tried}; {best.candidate.id} held best{_count_held(best)}"
        return
    elif finals:
        yield f"{best.candidate.id} held best in more layouts{_count_held(best)}"
        return

    highest = max(result.ranking, key=lambda tried: tried.reward, default=best)
    reward = number(highest.reward, 3)
    if reward != number(best.reward, 3):
        earned = f"{highest.candidate.id} earned {reward}"
        decides = "room to the limits and then the shorter way decide"
        if best.score.cost is not None:
            decides = "the figure of fitness.tie_by decides"
        if changed:
            decides = f"among those that hold, {decides}"

        yield f"{earned}; rewards within evolution.tie of it count as equal: {decides}"


def _describe_changes(best: Evaluation, changed: Sequence[Trial]) -> str:
    """Say what the best earned with small changes of the scene."""
    rewards = [trial.reward for trial in changed]
    where = f"in {count_words(len(changed), 'small change')} of the scene"
    mean = number(fmean(rewards), 3)
    least = number(min(rewards), 3)
    return f"{where} {best.candidate.id} earned {mean} on average, {least} at least"


def _count_held(best: Evaluation) -> str:
    """Say in how many layouts of the choice the best held."""
    counted = best.finals.count_held()
    return f": {counted.held} of {counted.layouts}"


def _goals(result: Result, best: Evaluation) -> Iterator[str]:
    """Say how far the best candidate fulfilled each of several goals, and the highest that any candidate reached.

    Of a task where one goal is enough nothing is said.
    """
    goals = [dict(trial.goals) for trial in best.trials if trial.goals]
    if not goals:
        return

    every = []
    for evaluation in result.ranking:
        every += [dict(trial.goals) for trial in evaluation.trials]

    yield _compare("goals", list(goals[0]), goals, every)


def _compare(
    what: str,
    names: Sequence[str],
    best: Sequence[Mapping[str, float]],
    every: Sequence[Mapping[str, float]],
) -> str:
    """Say for each name the mean of the best candidate's figures, and the highest of all.

    Args:
        what: the names are of, in the plural.
        names: in the order in which they are shown.
        best: figures of the best candidate, by name.
        every: figures of all candidates, by name.
    """
    shares = []

    for name in names:
        mean = fmean(figures.get(name, 0.0) for figures in best)
        most = max(figures.get(name, 0.0) for figures in every)
        shares.append(f"{name} {number(mean, 3)} ({number(most, 3)})")

    return f"{what}, by the best candidate (and the most by any): {', '.join(shares)}"


def _spent(replies: Sequence[Reply]) -> str:
    """Say in a line how many replies there were, their tokens and their cost.

    Tokens and dollars are those that replies report; where none does, they are left out.
    """
    bill = Bill.of(replies)
    line = f"the model was asked {len(replies)} time{'' if len(replies) == 1 else 's'}"
    if bill.errors:
        line += f", {bill.errors} without an answer"

    tokens = sum_known([bill.prompt_tokens, bill.completion_tokens])
    if tokens is not None:
        line += f", {tokens} tokens"
    if bill.cost_usd is not None:
        line += f", {bill.cost_usd:.2f} USD"
    if bill.saved_usd is not None:
        line += f" (the provider's cache saved {bill.saved_usd:.2f})"

    return line


def _shorten(path: Path) -> str:
    """Return a path, or the way to it from the working directory where that is shorter."""
    return min(str(path), os.path.relpath(path), key=len)
