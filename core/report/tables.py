"""The tables of a report. Cells are values; how they are printed is the format's: in CSV in full, elsewhere rounded."""

from __future__ import annotations

import csv
import io
import itertools
import math
import os
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from core.report.results import Results
from core.report.runs import FinishedRun, Spending, spending
from core.report.statistics import (
    LEAST_DIVISOR,
    deviation,
    improvement,
    interquartile_mean,
    interval,
    mean,
    mean_of_tasks,
)
from core.report.tools import Tools, size
from core.text import clean

BUDGET = ("n_agent", "n_tool", "n_action", "n_iteration", "k_top", "reward_save", "stop_reward")


@dataclass(frozen=True)
class Link:
    """A cell that leads to a file."""

    text: str
    target: Path


Cell = str | int | float | None | Link | tuple[Link, ...]


@dataclass(frozen=True)
class Column:
    """Its name, with the unit; ``digits`` after the point make it a column of numbers."""

    name: str
    digits: int | None = None


@dataclass(frozen=True)
class Table:
    """``name`` is its file's, ``note`` says how its numbers are made."""

    name: str
    title: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    note: str = ""

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.columns):
                raise ValueError(f"table {self.name}: a row of {len(row)} cells under {len(self.columns)} columns")


def tables(results: Results, shown: Tools) -> list[Table]:
    """All that there is something to say in."""
    made = [
        rewards(results),
        methods(results),
        improvements(results),
        generations(results),
        tools(results, shown),
        runs(results),
        left_out(results),
        parameters(results),
        costs(results),
        versions(results),
    ]
    return [table for table in made if table.rows]


def rewards(results: Results) -> Table:
    """Best, average and spread, by task and method."""
    columns = (
        *(Column("task"), Column("method"), Column("runs", 0), Column("left out", 0), Column("best", 3)),
        *(Column("average", 3), Column("standard deviation", 3), Column("interquartile mean", 3)),
        *(Column("distance of the best (m)", 2), Column("candidate")),
    )
    rows = [
        (
            *(g.task, g.method, len(g.runs), g.left_out, g.best.best.reward),
            *(mean(g.rewards), deviation(g.rewards), interquartile_mean(g.rewards)),
            *(g.best.best.distance_m, g.best.best.candidate),
        )
        for g in results.groups
    ]
    note = (
        "Of each run's best reward: the best and the average over runs, the sample standard deviation (n - 1), and the "
        "interquartile mean, which below four runs is the average. Distance: metres that the end-effector's origin "
        "travelled in the best run's best plan. Left out: runs that failed or are unfinished; they are in no figure."
    )
    return Table("rewards", "Rewards by task and method", columns, tuple(rows), note)


def methods(results: Results) -> Table:
    """One line per method: the paper's mean, and the interquartile mean, with intervals."""
    confidence = f"{100 * results.how.confidence:g} %"
    columns = (
        *(Column("method"), Column("tasks", 0), Column("runs", 0), Column("mean of the best", 3), Column("mean", 3)),
        *(Column("mean, low", 3), Column("mean, high", 3), Column("interquartile mean", 3)),
        *(Column("IQM, low", 3), Column("IQM, high", 3), Column("which tasks")),
    )
    rows = []
    for method in results.methods:
        groups = results.of(method)
        by_task = [g.rewards for g in groups]
        every = [reward for task in by_task for reward in task]
        rows.append(
            (
                *(method, len(groups), len(every), mean([g.best.best.reward for g in groups]), mean_of_tasks(by_task)),
                *(interval(by_task, "mean", results.how) or (None, None)),
                interquartile_mean(every),
                *(interval(by_task, "interquartile mean", results.how) or (None, None)),
                ", ".join(g.task for g in groups),
            )
        )
    note = (
        "Mean: over tasks, of each task's average over runs, as the paper has it; mean of the best: over tasks, of "
        "each task's best run. Interquartile mean (IQM): of all runs of all tasks the middle half (Agarwal et al. "
        "2021). "
        f"Low and high: {confidence} percentiles of {results.how.resamples} bootstrap samples, drawn within each task; "
        "none where a task has one run only. Methods with different tasks can't be compared by these."
    )
    return Table("methods", "Methods over all their tasks", columns, tuple(rows), note)


def improvements(results: Results) -> Table:
    """Each method against those that are worse on the tasks that both have."""
    columns = (
        *(Column("method A"), Column("over method B"), Column("tasks", 0), Column("mean of A", 3)),
        *(Column("mean of B", 3), Column("of B's shortfall (%)", 1), Column("tasks with a shortfall", 0)),
        *(Column("of B's value (%)", 1), Column("tasks with a value", 0)),
    )
    rows: list[tuple[Cell, ...]] = []
    for a, b in itertools.permutations(results.methods, 2):
        tasks = results.shared(a, b)
        scores = [[mean(g.rewards) for g in results.of(method, tasks)] for method in (a, b)]
        if not tasks or mean(scores[0]) < mean(scores[1]):
            continue
        gain = improvement(*scores)
        rows.append(
            (
                *(a, b, gain.tasks, mean(scores[0]), mean(scores[1]), _percent(gain.of_shortfall)),
                *(gain.shortfall_tasks, _percent(gain.of_value), gain.value_tasks),
            )
        )
    note = (
        "Average normalised improvement of A over B, from the averages over runs: the mean over tasks of (A - B) / "
        "(1 - B), the share of B's shortfall that A makes up, and of (A - B) / B. Tasks where the divisor is below "
        f"{LEAST_DIVISOR} can't be counted; how many are counted stands beside it."
    )
    return Table("improvements", "Improvement of one method over another", columns, tuple(rows), note)


def _percent(share: float | None) -> float | None:
    return None if share is None else 100 * share


def generations(results: Results) -> Table:
    """How rewards grow."""
    columns = (
        *(Column("task"), Column("method"), Column("generation", 0), Column("runs", 0)),
        *(Column("best so far", 3), Column("standard deviation", 3), Column("best of the generation", 3)),
        *(Column("mean of the generation", 3), Column("rejected (%)", 1), Column("failed (%)", 1)),
    )
    rows: list[tuple[Cell, ...]] = []
    for g in results.groups:
        for index in range(max(len(run.figures.generations) for run in g.runs)):
            so_far = [course(run, index + 1)[index] for run in g.runs]
            there = [run.figures.generations[index] for run in g.runs if index < len(run.figures.generations)]
            candidates = sum(f.n_candidates for f in there)
            rows.append(
                (
                    *(g.task, g.method, index, len(there), mean(so_far), deviation(so_far)),
                    _mean_of_some([f.best_reward for f in there]),
                    _mean_of_some([f.mean_reward for f in there]),
                    100 * sum(f.n_rejected for f in there) / candidates if candidates else None,
                    100 * sum(f.n_failed for f in there) / candidates if candidates else None,
                )
            )
    note = (
        "Means over runs. Best so far: up to and with the generation; a run that stopped early keeps its last. Runs: "
        "those that came as far. Mean of the generation: over the candidates that were tried."
    )
    return Table("generations", "Rewards by generation", columns, tuple(rows), note)


def course(run: FinishedRun, length: int) -> list[float]:
    """`FinishedRun.best_so_far` made ``length`` long: a run that stopped early keeps its last."""
    so_far = run.best_so_far or [0.0]
    return (so_far + so_far[-1:] * length)[:length]


def _mean_of_some(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return mean(known) if known else None


def parameters(results: Results) -> Table:
    """What was spent on what."""
    columns = (
        *(Column("task"), Column("method")),
        *(Column(name, 2 if "reward" in name else 0) for name in BUDGET),
        *(Column("candidates per generation"), Column("workers"), Column("seeds"), Column("model")),
    )
    rows = []
    for g in results.groups:
        budgets = [run.config.get("budget", {}) for run in g.runs]
        population = sorted({f.n_candidates for run in g.runs for f in run.figures.generations})
        workers = {str(run.config.get("executor", {}).get("workers", "")) for run in g.runs}
        models = {str(run.config.get("vlm", {}).get("model") or run.figures.vlm) for run in g.runs}
        rows.append(
            (
                *(g.task, g.method, *(_same([budget.get(name) for budget in budgets]) for name in BUDGET)),
                " to ".join(str(n) for n in dict.fromkeys([population[0], population[-1]])) if population else "",
                ", ".join(sorted("one per core" if name == "None" else name for name in workers)),
                _counted(run.seed for run in g.runs),
                ", ".join(sorted(models)),
            )
        )
    note = (
        "As configured; candidates per generation as counted: with a given tool n_tool is 1. Workers are the rollouts "
        "that run at the same time (the paper's k_sim)."
    )
    return Table("parameters", "Parameters", columns, tuple(rows), note)


def _same(values: Sequence[Any]) -> Cell:
    """What all agree on; several as a text."""
    found = list(dict.fromkeys(values))
    if len(found) == 1 and (found[0] is None or isinstance(found[0], int | float)):
        return found[0]
    return ", ".join(str(value) for value in found)


def _counted(seeds: Any) -> str:
    """Seeds in order; one that was run several times says so."""
    counts = Counter(seeds)
    return ", ".join(f"{seed}" + (f" ({n} times)" if n > 1 else "") for seed, n in sorted(counts.items()))


def costs(results: Results) -> Table:
    """What runs took: time, tokens, dollars."""
    columns = (
        *(Column("task"), Column("method"), Column("runs", 0), Column("rollouts per run", 0)),
        *(Column("wall time per run (s)", 0), Column("rollouts per second", 1), Column("requests per run", 1)),
        *(Column("failed requests", 0), Column("prompt tokens", 0), Column("completion tokens", 0)),
        Column("cost (USD)", 2),
    )
    rows = []
    for g in results.groups:
        spent = [s for s in map(spending, g.runs) if s is not None]
        seconds = sum(run.figures.wall_time_s for run in g.runs)
        tried = sum(run.figures.n_evaluations for run in g.runs)
        rows.append(
            (
                *(g.task, g.method, len(g.runs), tried / len(g.runs), seconds / len(g.runs)),
                tried / seconds if seconds > 0 else None,
                sum(s.requests for s in spent) / len(spent) if spent else None,
                sum(s.errors for s in spent),
                *(_sum_of_some(spent, name) for name in ("prompt_tokens", "completion_tokens", "cost_usd")),
            )
        )
    note = "Tokens and dollars are sums over the runs, of the replies that told them; empty where none did."
    return Table("costs", "Time and money", columns, tuple(rows), note)


def _sum_of_some(spent: Sequence[Spending], name: str) -> float | None:
    known = [value for value in (getattr(s, name) for s in spent) if value is not None]
    return sum(known) if known else None


def runs(results: Results) -> Table:
    """Every run that is counted."""
    columns = (
        *(Column("task"), Column("method"), Column("seed", 0), Column("best reward", 3), Column("distance (m)", 2)),
        *(Column("generation", 0), Column("candidate"), Column("rollouts", 0), Column("wall time (s)", 0)),
        *(Column("folder"), Column("recordings")),
    )
    rows = [
        (
            *(g.task, g.method, run.seed, run.best.reward, run.best.distance_m, run.best.generation),
            *(run.best.candidate, run.figures.n_evaluations, run.figures.wall_time_s),
            Link(run.folder.name, run.folder),
            tuple(Link(what, file) for what, file in run.recordings().items()),
        )
        for g in results.groups
        for run in g.runs
    ]
    return Table("runs", "Runs", columns, tuple(rows), _repeats(results))


def _repeats(results: Results) -> str:
    """A warning where runs are not independent."""
    again = defaultdict(list)
    for g in results.groups:
        for seed, n in Counter(run.seed for run in g.runs).items():
            if n > 1:
                again[g.task, g.method].append(f"seed {seed} {n} times")
    if not again:
        return ""
    told = "; ".join(f"{task}, {method}: {', '.join(seeds)}" for (task, method), seeds in again.items())
    return f"Seeds that were run more than once are counted as often as they were run ({told})."


def tools(results: Results, shown: Tools) -> Table:
    """The best tools, and what the model says of them."""
    columns = (
        *(Column("task"), Column("method"), Column("tool"), Column("reward", 3), Column("distance (m)", 2)),
        *(Column("size"), Column("mass (g)", 0), Column("parts", 0), Column("what it is"), Column("how it is used")),
        *(Column("candidate"), Column("run")),
    )
    rows = [
        (
            *(task, method, winner.name, winner.reward, winner.distance_m, size(winner.tool)),
            *(1000 * winner.tool.mass, len(winner.tool.components)),
            *(winner.tool.description, winner.strategy_description or winner.strategy_name, winner.candidate),
            Link(winner.run.folder.name, winner.run.folder),
        )
        for (task, method), winner in shown.best.items()
    ]
    note = " ".join(f"Not shown: {problem}." for problem in shown.problems)
    return Table("tools", "The best tools", columns, tuple(rows), note)


def versions(results: Results) -> Table:
    """What the runs were made with."""
    found: dict[str, Counter[str]] = defaultdict(Counter)
    for run in results.runs:
        for name, version in run.figures.versions.items():
            found[name][version] += 1
    rows = [
        (name, ", ".join(f"{v} ({n} runs)" if len(counts) > 1 else v for v, n in sorted(counts.items())))
        for name, counts in sorted(found.items())
    ]
    differ = [name for name, counts in sorted(found.items()) if len(counts) > 1]
    note = f"Runs differ in {', '.join(differ)}: rewards need not be comparable." if differ else ""
    return Table("versions", "Versions", (Column("package"), Column("version")), tuple(rows), note)


def left_out(results: Results) -> Table:
    """The runs that no figure counts."""
    columns = (Column("folder"), Column("task"), Column("status"), Column("reason"))
    rows = [(Link(run.folder.name, run.folder), run.task, run.status, run.reason) for run in results.left_out]
    return Table("left_out", "Runs that failed or are unfinished", columns, tuple(rows), "None of them is averaged in.")


# --- formats ----------------------------------------------------------------------------------------------------


def printed(cell: Cell, column: Column) -> str:
    """A cell for people; nothing is rounded up to 1."""
    match cell:
        case None:
            return "–"
        case Link(text, _):
            return clean(text, 300)
        case tuple():
            return ", ".join(clean(link.text, 300) for link in cell)
        case str():
            return clean(cell, 1000)
        case int() | float() if column.digits is None:
            return str(cell)
        case _:
            return number(cell, column.digits or 0)


def number(value: float | None, digits: int) -> str:
    """``value`` with ``digits`` after the point; a value just below 1 stays below it."""
    if value is None or not math.isfinite(value):
        return "–"
    text = f"{value:.{digits}f}"
    if digits and value < 1 and float(text) >= 1:
        return f"{math.floor(value * 10**digits) / 10**digits:.{digits}f}"
    return text


def to_csv(table: Table, folder: Path) -> str:
    """In full precision; links as paths from ``folder``, where the table will lie."""

    def plain(cell: Cell) -> Any:
        match cell:
            case Link(_, target):
                return _no_formula(relative(target, folder))
            case tuple():
                return _no_formula(" ".join(relative(link.target, folder) for link in cell))
            case str():
                return _no_formula(clean(cell, 10_000))
            case _:
                return "" if cell is None else cell

    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([column.name for column in table.columns])
    writer.writerows([plain(cell) for cell in row] for row in table.rows)
    return text.getvalue()


def relative(target: Path, folder: Path) -> str:
    """The way from ``folder`` to ``target``, with forward slashes."""
    return Path(os.path.relpath(target.resolve(), folder.resolve())).as_posix()


def _no_formula(text: str) -> str:
    """A spreadsheet must not take a text for a formula, nor a terminal for an order."""
    text = "".join(character for character in text if character.isprintable())
    return f"'{text}" if text[:1] in ("=", "+", "-", "@") else text


def to_markdown(table: Table) -> str:
    """With its title and note."""
    lines = [
        "| " + " | ".join(_markdown(column.name) for column in table.columns) + " |",
        "|" + "|".join("---" if column.digits is None else "---:" for column in table.columns) + "|",
    ]
    for row in table.rows:
        cells = (_markdown(printed(cell, column)) for cell, column in zip(row, table.columns, strict=True))
        lines.append("| " + " | ".join(cells) + " |")
    note = f"\n{_markdown(table.note)}\n" if table.note else ""
    return f"## {table.title}\n\n" + "\n".join(lines) + f"\n{note}"


def _markdown(text: str) -> str:
    """What a model or a folder is called must not be read as markup."""
    for mark in "\\`*_[]<>|#":
        text = text.replace(mark, f"\\{mark}")
    return text
