"""The ``summary`` listener: prints the outcome of a run, and the commands to look further."""

from __future__ import annotations

import os
import shlex
import statistics
import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from omegaconf import OmegaConf

from core.errors import UserError
from core.hooks import hookimpl
from core.plugins import TASK
from core.support.cli import print_table, say
from core.support.text import by_reason, clean, hydra_word, number
from core.trial import best_tools

if TYPE_CHECKING:
    from core.events import Result, Run
    from core.interfaces import Reply

_LONGEST = 60  # letters of a name
_REASONS = 5  # why candidates earned nothing or less
_CHOSEN = (
    "task",
    "robot",
    "sim",
    "tool",
    "material",
    "fitness",
)  # with their settings, what a reward depends on


@hookimpl
def listeners() -> Mapping[str, Callable[..., Any]]:
    return {"summary": SummaryListener}


class SummaryListener:
    """Prints a table of the ``top`` best tools, what spoke against candidates, and the commands to type next.

    All goes to standard error, so that standard output stays free for results.
    """

    def __init__(self, top: int = 3) -> None:
        self.top = top
        self._replies: list[Reply] = []

    @hookimpl
    def reply_received(self, reply: Reply) -> None:
        self._replies.append(reply)

    @hookimpl(trylast=True)
    def run_finished(self, run: Run, result: Result) -> None:
        if result.best is not None:
            _print_tools(result, self.top)
        said = (
            remark
            for of in (_reasons, _tied, _tasks, _goals, _margin, _unseen)
            for remark in of(result)
        )
        say(*said, _spent(self._replies), *_commands(run, result), file=sys.stderr)


def _print_tools(result: Result, top: int) -> None:
    numbers = ("reward", "distance m", "components", "mass g")
    rows = []
    for evaluation in best_tools(result.ranking)[:top]:
        candidate, tool = evaluation.candidate, evaluation.candidate.tool
        assert tool is not None
        figures = (number(evaluation.reward, 3), number(evaluation.distance_m, 2))
        counts = (str(len(tool.components)), f"{1000 * tool.mass:.0f}")
        name = clean(tool.name or candidate.strategy_name, _LONGEST)
        rows.append((*figures, *counts, candidate.id, name))
    print_table((*numbers, "candidate", "tool"), rows, numbers, sys.stderr)


def _reasons(result: Result) -> Iterable[str]:
    """Say why candidates were rejected, failed, or earned less than their rollout did."""
    every = [
        evaluation
        for generation in result.generations
        for evaluation in generation.evaluations
    ]
    lines = by_reason(
        (evaluation.candidate.id, evaluation.reason) for evaluation in every
    )
    yield from lines[:_REASONS]
    if len(lines) > _REASONS:
        yield f"and {len(lines) - _REASONS} more reasons: vlmgineer report has them"


def _tied(result: Result) -> Iterable[str]:
    """Say what decided between candidates that earned alike, or why the best has not the highest reward."""
    if result.finals and result.best is not None:
        yield f"{len(result.finals)} candidates earned alike; {result.best.candidate.id} held best in more layouts"
        return
    highest = max(
        result.ranking, key=lambda evaluation: evaluation.reward, default=None
    )
    if (
        highest is not None
        and result.best is not None
        and number(highest.reward, 3) != number(result.best.reward, 3)
    ):
        earned = f"{highest.candidate.id} earned {number(highest.reward, 3)}"
        yield f"{earned}; rewards within evolution.tie of it count as equal, and the shortest distance goes first"


def _tasks(result: Result) -> Iterable[str]:
    """Say what the best candidate earned in each of several tasks, and the most that any candidate did."""
    names = result.best.tasks if result.best is not None else ()
    if result.best is not None and len(names) > 1:
        most = {
            name: max(e.figures.get(name, 0.0) for e in result.ranking)
            for name in names
        }
        own = (
            f"{name} {number(result.best.figures[name], 3)} ({number(most[name], 3)})"
            for name in names
        )
        yield f"tasks, by the best candidate (and the most by any): {', '.join(own)}"


def _goals(result: Result) -> Iterable[str]:
    """Say how far the best candidate fulfilled each of several goals, and the highest that any candidate reached."""
    every = [
        trial.goals for evaluation in result.ranking for trial in evaluation.trials
    ]
    if result.best is None or len(result.best.tasks) > 1:
        return
    best = [dict(trial.goals) for trial in result.best.trials if trial.goals]
    if best:
        most = {
            name: max(dict(goals).get(name, 0.0) for goals in every) for name in best[0]
        }
        means = {
            name: statistics.fmean(goals.get(name, 0.0) for goals in best)
            for name in most
        }
        shares = (
            f"{name} {number(means[name], 3)} ({number(most[name], 3)})"
            for name in most
        )
        yield f"goals, by the best candidate (and the most by any): {', '.join(shares)}"


def _margin(result: Result) -> Iterable[str]:
    """Say how near to a limit the best candidate came, if the task has limits beside its reward."""
    if (
        result.best is not None
        and (least := result.best.least_margin) is not None
        and least.name != "reward"
    ):
        yield f"least margin of the best {number(least.margin, 2)}: {least}"


def _unseen(result: Result) -> Iterable[str]:
    """Say what the best candidate earned in unseen layouts, if it was tried in any."""
    for engine, rewards in result.unseen.items():
        yield (
            f"in {len(rewards)} unseen layouts the best earned {number(statistics.fmean(rewards), 3)} on the mean, "
            f"{number(min(rewards), 3)} in the worst ({engine})"
        )


def _spent(replies: list[Reply]) -> str:
    """The replies of the model, its tokens and their cost, in a line."""
    line = f"{len(replies)} repl{'y' if len(replies) == 1 else 'ies'}"
    failed = sum(reply.error is not None for reply in replies)
    tokens = [
        n
        for reply in replies
        for n in (reply.prompt_tokens, reply.completion_tokens)
        if n is not None
    ]
    costs = [reply.cost_usd for reply in replies if reply.cost_usd is not None]
    line += f", {failed} of them failed" if failed else ""
    line += f", {sum(tokens)} tokens" if tokens else ""
    return line + (f", {sum(costs):.2f} USD" if costs else "")


def _commands(run: Run, result: Result) -> Iterable[str]:
    """Commands to look further."""
    folder = shlex.quote(_short(run.folder))
    if "rerun" in run.config.get("listener", {}):
        yield f"vlmgineer view {folder}"
    if result.best is None:
        return
    yield f"vlmgineer report {folder}"
    design = f"designs={hydra_word(_short(run.folder / 'best' / 'design.json'))}"
    yield shlex.join(["python", "-m", "core.evaluate", *_settings(run), design])


def _settings(run: Run) -> Iterable[str]:
    """Return the words by which ``core.evaluate`` tries a design as this run did."""
    from core.config.compose import load

    config = {key: run.config.get(key) or {} for key in (*_CHOSEN, "rollout")}
    config["task"] = {
        key: value for key, value in config["task"].items() if key not in TASK.defaults
    }
    words = [
        f"{kind}={config[kind]['name']}" for kind in _CHOSEN if "name" in config[kind]
    ]
    try:
        usual = load("evaluate", words)
    except (
        UserError
    ):  # the user's own file, which that command does not find: all that it says is set
        words.remove(f"material={config['material']['name']}")
        usual = load("evaluate", words)
    resolved: Any = OmegaConf.to_container(usual, resolve=True)
    return [*words, *_different(config, resolved), f"seed={run.seed}"]


def _different(
    config: Mapping[Any, Any], usual: Mapping[Any, Any], path: str = ""
) -> Iterable[str]:
    """Yield the words that set what differs from ``usual``."""
    for key, value in config.items():
        if isinstance(value, Mapping) and isinstance(usual.get(key), Mapping):
            yield from _different(value, usual[key], f"{path}{key}.")
        elif key not in usual or usual[key] != value:
            yield f"{'' if key in usual else '+'}{path}{key}={hydra_word(value)}"


def _short(path: Path) -> str:
    """``path``, or the way to it from the working directory where that is shorter."""
    return min(str(path), os.path.relpath(path), key=len)
