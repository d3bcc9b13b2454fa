"""The tables of a report."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from functools import wraps
from statistics import fmean

from core.interfaces import Reply
from core.simulation.measuring import figures
from core.store.rows import StoredDesign, StoredEvaluation
from core.trial import best_first, best_tools
from core.values.messages import Bill
from plugins.results.pages.best_tool import size
from plugins.results.pages.formats import Cell, CellLink, Table
from plugins.results.pages.runs import FinishedRun
from plugins.results.pages.runs import reasons as find_reasons
from plugins.results.report.comparing import comparing_tables
from plugins.results.report.entry_tables import entry_tables
from plugins.results.report.methods import Group
from plugins.results.report.results import Results
from plugins.results.report.statistics import (
    deviation,
    interquartile_mean,
    interval,
    over_known,
)
from plugins.results.report.verify import verification

REASONS = 12
"""Of a run."""

SHOWN = 5
"""Designs of a generation, where the budget does not say how many may become elites."""

Rows = Iterator[tuple[Cell, ...]]


def tables(results: Results) -> list[Table]:
    """All tables that have rows."""
    found = [
        rewards(results),
        methods(results),
        *comparing_tables(results),
        generations(results),
        reasons(results),
        lineage(results),
        tools(results),
        runs(results),
        unseen_failures(results),
        looks_and_guards(results),
        left_out(results),
        models(results),
        costs(results),
        *entry_tables(results.entries),
        verification(results.verified),
    ]
    return [table for table in found if table.rows]


def _table(
    head: str,
) -> Callable[[Callable[[Results], Rows]], Callable[[Results], Table]]:
    """Make a function that yields rows into one that returns a table of its name, with this head (`Table.of`)."""

    def decorate(rows: Callable[[Results], Rows]) -> Callable[[Results], Table]:
        @wraps(rows)
        def make(results: Results) -> Table:
            return Table.of(rows.__name__, head, rows(results))

        return make

    return decorate


@_table(
    "task|method|runs:0|left out:0|best:3|average:3|standard deviation:3|interquartile mean:3"
    "|distance of the best (m):2|candidate|unseen layouts, mean:3|unseen layouts, worst:3"
)
def rewards(results: Results) -> Rows:
    """Best, average and deviation of rewards, by task and method."""
    for g in results.groups:
        best = g.best.best
        figures = [run.figures.unseen for run in g.runs]
        unseen = [layouts for layouts in figures if layouts is not None]
        yield (
            g.task,
            g.method,
            len(g.runs),
            g.left_out,
            best.reward,
            fmean(g.rewards),
            deviation(g.rewards),
            interquartile_mean(g.rewards),
            best.distance_m,
            best.candidate,
            over_known(fmean, [layouts.mean for layouts in unseen]),
            over_known(min, [layouts.worst for layouts in unseen]),
        )


@_table(
    "method|tasks:0|runs:0|mean of the best:3|mean:3|mean, low:3|mean, high:3|interquartile mean:3"
    "|IQM, low:3|IQM, high:3|which tasks"
)
def methods(results: Results) -> Rows:
    """The paper's mean and the interquartile mean of each method, with intervals; none where they say no more."""
    for method in results.methods:
        groups = results.groups_of(method)
        by_task = [g.rewards for g in groups]
        if len(results.tasks) == 1 and max(map(len, by_task)) == 1:
            continue

        rewards = sum(by_task, list[float]())
        low, high = interval(by_task, "mean") or (None, None)
        iqm_low, iqm_high = interval(by_task, "interquartile mean") or (None, None)
        yield (
            method,
            len(groups),
            len(rewards),
            fmean([g.best.best.reward for g in groups]),
            fmean(map(fmean, by_task)),
            low,
            high,
            interquartile_mean(rewards),
            iqm_low,
            iqm_high,
            ", ".join(g.task for g in groups),
        )


@_table(
    "task|method|generation:0|runs:0|best so far:3|standard deviation:3|best of the generation:3"
    "|mean of the generation:3|rejected (%):1|failed (%):1"
)
def generations(results: Results) -> Rows:
    """Rewards by generation."""
    for g in results.groups:
        by_run = [run.figures.generations for run in g.runs]
        for index in range(max(map(len, by_run))):
            so_far = [run.best_so_far(index + 1)[index] for run in g.runs]
            there = [rows[index] for rows in by_run if index < len(rows)]
            candidates = sum(figures.n_candidates for figures in there)
            rejected = sum(figures.n_rejected for figures in there)
            failed = sum(figures.n_failed for figures in there)
            yield (
                g.task,
                g.method,
                index,
                len(there),
                fmean(so_far),
                deviation(so_far),
                over_known(fmean, [figures.best_reward for figures in there]),
                over_known(fmean, [figures.mean_reward for figures in there]),
                _percent(rejected, candidates),
                _percent(failed, candidates),
            )


def _percent(count: int, total: int) -> float | None:
    return 100 * count / total if total else None


@_table("task|method|run|candidates|reason")
def reasons(results: Results) -> Rows:
    """Why candidates earned nothing, or less than their rollout."""
    for g in results.groups:
        for run in g.runs:
            for reason in find_reasons(run.store)[:REASONS]:
                yield g.task, g.method, _link(run), reason.whose, reason.text


def _link(run: FinishedRun) -> CellLink:
    return CellLink(run.folder.name, run.folder)


@_table("generation:0|candidate|reward:3|derives from|in the model's words")
def lineage(results: Results) -> Rows:
    """The best candidates of each generation, what they derive from, and the model's words; of a single run."""
    if len(results.runs) != 1:
        return

    (run,) = results.runs
    designs = run.store.designs()
    tried = [row for row in run.store.evaluations() if row.status == "ok"]
    shown = run.config.get("budget", {}).get("k_top") or SHOWN

    for generation in range(len(run.figures.generations)):
        rows = [row.unread() for row in tried if row.generation == generation]
        # As the run ranked them.
        for row in best_tools(best_first(rows, run.figures.tie))[:shown]:
            found = row.candidate
            design = designs[found.generation, found.agent, found.design]
            parents = ", ".join(sorted(design.parents)) or "–"
            yield generation, found.id, row.reward, parents, _words(design)


def _words(design: StoredDesign) -> str:
    """Return what the model said of a design, each thing once."""
    words = []
    for what in ("tool", "strategy"):
        for name in (f"{what}_name", f"{what}_description"):
            text = str(design.written.get(name) or "").strip(" .")
            if text and text not in words:
                words.append(text)

    return ". ".join(words)


@_table(
    "task|method|model|asked for|replies:0|of them failed:0|prompt tokens:0|completion tokens:0|cost (USD):4"
    "|cached tokens:0|saved by caching (USD):4|candidates:0|could be tried (%):1|best reward:3|mean reward:3"
)
def models(results: Results) -> Rows:
    """What each model was asked, what that cost and earned; where a method has several, or a critic."""
    for g in results.groups:
        asked, earned = _answers_by_model(g)
        if len(asked) == 1:
            continue

        for model, purpose in sorted(asked):
            bill = Bill.of(asked[model, purpose])
            candidates = earned[model] if purpose == "designs" else []
            tried = [row for row in candidates if row.status != "rejected"]
            rewards = [row.reward for row in tried if row.status == "ok"]
            yield (
                g.task,
                g.method,
                model,
                purpose,
                *bill,
                len(candidates),
                _percent(len(tried), len(candidates)),
                over_known(max, rewards),
                over_known(fmean, rewards),
            )


def _answers_by_model(
    g: Group,
) -> tuple[dict[tuple[str, str], list[Reply]], dict[str, list[StoredEvaluation]]]:
    """Return the replies by model and what was asked for, and what came of the designs by model."""
    asked: dict[tuple[str, str], list[Reply]] = defaultdict(list)
    earned: dict[str, list[StoredEvaluation]] = defaultdict(list)
    for run in g.runs:
        # The candidates of an agent are those of its last answer: a checked or repaired one comes second.
        designers: dict[tuple[int, ...], str] = {}
        for request, reply in run.store.answers():
            purpose = "designs" if request.asks_designs else request.purpose
            asked[reply.model, purpose].append(reply)
            if request.asks_designs:
                designers[request.generation, request.agent] = reply.model

        for row in run.store.evaluations():
            model = designers.get(row.design_key[:2])
            if model is not None:
                earned[model].append(row)

    return asked, earned


@_table(
    "task|method|runs:0|rollouts per run:0|wall time per run (s):0|requests per run:1"
    "|failed requests:0|prompt tokens:0|of these cached:0|completion tokens:0|cost (USD):2|saved by caching (USD):2"
)
def costs(results: Results) -> Rows:
    """Time, tokens and dollars that runs took."""
    for g in results.groups:
        requests = [request for run in g.runs for request in run.store.requests()]
        bill = Bill.of([found.reply for found in requests if found.reply is not None])
        seconds = sum(run.figures.wall_time_s for run in g.runs)
        rollouts = sum(run.rollouts for run in g.runs)
        yield (
            g.task,
            g.method,
            len(g.runs),
            rollouts / len(g.runs),
            seconds / len(g.runs),
            len(requests) / len(g.runs),
            bill.errors,
            bill.prompt_tokens,
            bill.cached_tokens,
            bill.completion_tokens,
            bill.cost_usd,
            bill.saved_usd,
        )


def runs(results: Results) -> Table:
    """All runs that are counted, with a column for each figure of a rollout that has one."""
    measured = {name: figure for name, figure in figures().items() if figure.column}
    columns = [f"{figure.column}:{figure.digits}" for figure in measured.values()]
    head = "|".join([_RUNS, *columns, _WHERE])
    return Table.of("runs", head, _run_rows(results, measured))


_RUNS = (
    "task|method|seed:0|best reward:3|unseen layouts, mean:3|chance of failure below:3|perturbed:3"
    "|second engine|reward there:3|least margin:2|torque share:2"
)
_WHERE = "generation:0|candidate|rollouts:0|wall time (s):0|folder|recordings"


def _run_rows(results: Results, measured: Iterable[str]) -> Rows:
    for g in results.groups:
        for run in g.runs:
            best = run.best
            recordings = run.recordings().items()
            yield (
                g.task,
                g.method,
                run.seed,
                best.reward,
                getattr(run.figures.unseen, "mean", None),
                getattr(run.figures.held, "fails_below", None),
                getattr(run.figures.perturbed, "fails_below", None),
                getattr(best.second_engine, "engine", ""),
                getattr(best.second_engine, "reward", None),
                getattr(best.margin, "margin", None),
                getattr(best.torque, "share", None),
                *map(best.measured.get, measured),
                best.generation,
                best.candidate,
                run.rollouts,
                run.figures.wall_time_s,
                _link(run),
                tuple(CellLink(what, file) for what, file in recordings),
            )


@_table("task|method|seed:0|engine|layout:0|reward:3|why|drawn for it|film")
def unseen_failures(results: Results) -> Rows:
    """The unseen layouts in which the best designs fail."""
    for g in results.groups:
        for run in g.runs:
            unseen = run.figures.unseen
            for failed in unseen.failed if unseen is not None else ():
                drawn = ", ".join(f"{name} {x:g}" for name, x in failed.draw.items())
                film = CellLink("film", run.folder / failed.film)
                yield (
                    g.task,
                    g.method,
                    run.seed,
                    failed.engine,
                    failed.layout,
                    failed.reward,
                    failed.cause,
                    drawn,
                    film if failed.film else "",
                )


@_table("task|method|seed:0|candidate|number:0|what was seen or felt|run")
def looks_and_guards(results: Results) -> Rows:
    """What the looks of the best candidates saw, and how their guards ended, as their films say it."""
    for g in results.groups:
        for run in g.runs:
            for number, (task, event) in enumerate(run.events(), start=1):
                candidate = run.best.candidate
                yield task, g.method, run.seed, candidate, number, event, _link(run)


@_table(
    "task|method|tool|reward:3|distance (m):2|size|mass (g):0|material|components:0|description|how it is used|"
    "candidate|run"
)
def tools(results: Results) -> Rows:
    """The best tools, with the model's descriptions."""
    for (task, method), winner in results.tools.best.items():
        yield (
            task,
            method,
            winner.name,
            winner.run.best.reward,
            winner.run.best.distance_m,
            size(winner.tool, winner.robot),
            1000 * winner.tool.mass,
            winner.material.name,
            len(winner.tool.components),
            winner.tool.description,
            winner.use,
            winner.run.best.candidate,
            _link(winner.run),
        )


@_table("folder|task|status|reason")
def left_out(results: Results) -> Rows:
    """The runs that no figure counts."""
    for run in results.left_out:
        folder = CellLink(run.folder.name, run.folder)
        yield folder, run.task, run.status, run.reason
