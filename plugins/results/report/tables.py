"""The tables of a report."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator
from functools import wraps
from statistics import fmean

from core.store.reader import Key, StoredEvaluation, StoredRequest
from core.trial import ranked
from plugins.results.pages.formats import Cell, CellLink, Table
from plugins.results.pages.runs import reasons as why
from plugins.results.pages.tools import size
from plugins.results.report.leaderboard import entry_tables
from plugins.results.report.results import Results
from plugins.results.report.statistics import (
    RunCost,
    deviation,
    interquartile_mean,
    interval,
    over_known,
)
from plugins.results.report.verify import verification

REASONS = 12  # of a run
SHOWN = 5  # designs of a generation, where the budget does not say how many may become elites


def tables(results: Results) -> list[Table]:
    """All tables that have rows."""
    makers = (
        rewards,
        methods,
        generations,
        reasons,
        lineage,
        tools,
        runs,
        left_out,
        models,
    )
    every = [
        *(make(results) for make in (*makers, costs)),
        *entry_tables(results.entries),
        verification(results.verified),
    ]
    return [table for table in every if table.rows]


def _table(
    head: str,
) -> Callable[
    [Callable[[Results], Iterator[tuple[Cell, ...]]]], Callable[[Results], Table]
]:
    """Make a function that yields rows into one that returns a table of its name, with this head (`Table.of`)."""
    return lambda rows: wraps(rows)(
        lambda results: Table.of(rows.__name__, head, rows(results))
    )


@_table(
    "task|method|runs:0|left out:0|best:3|average:3|standard deviation:3|interquartile mean:3"
    "|distance of the best (m):2|candidate|unseen layouts, mean:3|unseen layouts, worst:3"
)
def rewards(results: Results) -> Iterator[tuple[Cell, ...]]:
    """Best, average and deviation of rewards, by task and method."""
    for g in results.groups:
        yield (
            *(g.task, g.method, len(g.runs), g.left_out, g.best.best.reward),
            *(fmean(g.rewards), deviation(g.rewards), interquartile_mean(g.rewards)),
            *(g.best.best.distance_m, g.best.best.candidate),
            over_known(
                fmean, [getattr(run.figures.unseen, "mean", None) for run in g.runs]
            ),
            over_known(
                min, [getattr(run.figures.unseen, "worst", None) for run in g.runs]
            ),
        )


@_table(
    "method|tasks:0|runs:0|mean of the best:3|mean:3|mean, low:3|mean, high:3|interquartile mean:3"
    "|IQM, low:3|IQM, high:3|which tasks"
)
def methods(results: Results) -> Iterator[tuple[Cell, ...]]:
    """The paper's mean and the interquartile mean of each method, with intervals."""
    for method in results.methods:
        groups = results.of(method)
        by_task = [g.rewards for g in groups]
        means = fmean([fmean(rewards) for rewards in by_task])
        every = [reward for task in by_task for reward in task]
        yield (
            *(
                method,
                len(groups),
                len(every),
                fmean([g.best.best.reward for g in groups]),
                means,
            ),
            *(interval(by_task, "mean") or (None, None)),
            interquartile_mean(every),
            *(interval(by_task, "interquartile mean") or (None, None)),
            ", ".join(g.task for g in groups),
        )


@_table(
    "task|method|generation:0|runs:0|best so far:3|standard deviation:3|best of the generation:3"
    "|mean of the generation:3|rejected (%):1|failed (%):1"
)
def generations(results: Results) -> Iterator[tuple[Cell, ...]]:
    """Rewards by generation."""
    for g in results.groups:
        for index in range(max(len(run.figures.generations) for run in g.runs)):
            so_far = [run.best_so_far(index + 1)[index] for run in g.runs]
            there = [
                run.figures.generations[index]
                for run in g.runs
                if index < len(run.figures.generations)
            ]
            candidates = sum(f.n_candidates for f in there)
            lost = (sum(f.n_rejected for f in there), sum(f.n_failed for f in there))
            yield (
                *(
                    g.task,
                    g.method,
                    index,
                    len(there),
                    fmean(so_far),
                    deviation(so_far),
                ),
                over_known(fmean, [f.best_reward for f in there]),
                over_known(fmean, [f.mean_reward for f in there]),
                *(100 * count / candidates if candidates else None for count in lost),
            )


@_table("task|method|run|candidates|reason")
def reasons(results: Results) -> Iterator[tuple[Cell, ...]]:
    """Why candidates earned nothing, or less than their rollout."""
    for g in results.groups:
        for run in g.runs:
            for line in why(run.store)[:REASONS]:
                yield (
                    g.task,
                    g.method,
                    CellLink(run.folder.name, run.folder),
                    *line.split(": ", 1),
                )


@_table("generation:0|candidate|reward:3|derives from|in the model's words")
def lineage(results: Results) -> Iterator[tuple[Cell, ...]]:
    """The best candidates of each generation, what they derive from, and the model's words; of a single run."""
    for run in results.runs if len(results.runs) == 1 else ():
        designs = run.store.designs()
        evaluations = run.store.evaluations()
        for generation in range(len(run.figures.generations)):
            tried = [
                e for e in evaluations if e.design[0] == generation and e.status == "ok"
            ]
            best: dict[Key, StoredEvaluation] = {}
            for e in ranked(tried, lambda e: (e.reward, e.distance_m), run.figures.tie):
                best.setdefault(e.design, e)
            for e in [*best.values()][
                : run.config.get("budget", {}).get("k_top") or SHOWN
            ]:
                names = (
                    "tool_name",
                    "tool_description",
                    "strategy_name",
                    "strategy_description",
                )
                said = (
                    str(designs[e.design].written.get(name) or "").strip(" .")
                    for name in names
                )
                words = ". ".join(dict.fromkeys(filter(None, said)))
                parents = ", ".join(sorted(designs[e.design].parents)) or "–"
                yield (generation, e.candidate, e.reward, parents, words)


@_table(
    "task|method|model|asked for|replies:0|of them failed:0|prompt tokens:0|completion tokens:0|cost (USD):4"
    "|candidates:0|could be tried (%):1|best reward:3|mean reward:3"
)
def models(results: Results) -> Iterator[tuple[Cell, ...]]:
    """What each model was asked, what that cost and earned; where a method has several, or a critic."""
    for g in results.groups:
        asked: defaultdict[tuple[str, str], list[StoredRequest]] = defaultdict(list)
        earned: defaultdict[tuple[str, str], list[StoredEvaluation]] = defaultdict(list)
        for run in g.runs:
            answers = run.store.answers()
            for request, reply in answers:
                asked[
                    reply.model, "critiques" if request.critique else "designs"
                ].append(request)
            # The candidates of an agent are those of its last answer: a checked or repaired one comes second.
            designers = {
                (r.generation, r.agent): reply.model
                for r, reply in answers
                if not r.critique
            }
            for evaluation in run.store.evaluations():
                if (name := designers.get(evaluation.design[:2])) is not None:
                    earned[name, "designs"].append(evaluation)
        for model in sorted(asked) if len(asked) > 1 else ():
            tried = [e for e in earned[model] if e.status != "rejected"]
            rewards = [e.reward for e in tried if e.status == "ok"]
            yield (
                *(
                    g.task,
                    g.method,
                    *model,
                    *RunCost.of(asked[model])[1:],
                    len(earned[model]),
                ),
                100 * len(tried) / len(earned[model]) if earned[model] else None,
                *(over_known(function, rewards) for function in (max, fmean)),
            )


@_table(
    "task|method|runs:0|rollouts per run:0|wall time per run (s):0|rollouts per second:1|requests per run:1"
    "|failed requests:0|prompt tokens:0|completion tokens:0|cost (USD):2"
)
def costs(results: Results) -> Iterator[tuple[Cell, ...]]:
    """Time, tokens and dollars that runs took."""
    for g in results.groups:
        spent = [RunCost.of(run.store.requests()) for run in g.runs]
        seconds = sum(run.figures.wall_time_s for run in g.runs)
        tried = sum(run.rollouts for run in g.runs)
        yield (
            *(
                g.task,
                g.method,
                len(g.runs),
                tried / len(g.runs),
                seconds / len(g.runs),
            ),
            tried / seconds if seconds > 0 else None,
            fmean([s.requests for s in spent]),
            sum(s.errors for s in spent),
            *(
                over_known(sum, (getattr(s, name) for s in spent))
                for name in RunCost._fields[3:]
            ),
        )


@_table(
    "task|method|seed:0|best reward:3|unseen layouts, mean:3|least margin:2|distance (m):2"
    "|generation:0|candidate|rollouts:0|wall time (s):0|folder|recordings"
)
def runs(results: Results) -> Iterator[tuple[Cell, ...]]:
    """All runs that are counted."""
    for g in results.groups:
        for run in g.runs:
            yield (
                *(
                    g.task,
                    g.method,
                    run.seed,
                    run.best.reward,
                    getattr(run.figures.unseen, "mean", None),
                ),
                *(
                    getattr(run.best.margin, "margin", None),
                    run.best.distance_m,
                    run.best.generation,
                ),
                *(run.best.candidate, run.rollouts, run.figures.wall_time_s),
                *(
                    CellLink(run.folder.name, run.folder),
                    tuple(
                        CellLink(what, file) for what, file in run.recordings().items()
                    ),
                ),
            )


@_table(
    "task|method|tool|reward:3|distance (m):2|size|mass (g):0|material|components:0|description|how it is used|"
    "candidate|run"
)
def tools(results: Results) -> Iterator[tuple[Cell, ...]]:
    """The best tools, with the model's descriptions."""
    for (task, method), winner in results.tools.best.items():
        yield (
            *(
                task,
                method,
                winner.name,
                winner.reward,
                winner.distance_m,
                size(winner.tool, winner.robot),
            ),
            *(
                1000 * winner.tool.mass,
                winner.material.name,
                len(winner.tool.components),
            ),
            *(winner.tool.description, winner.use, winner.candidate),
            CellLink(winner.run.folder.name, winner.run.folder),
        )


@_table("folder|task|status|reason")
def left_out(results: Results) -> Iterator[tuple[Cell, ...]]:
    """The runs that no figure counts."""
    for run in results.left_out:
        yield CellLink(run.folder.name, run.folder), run.task, run.status, run.reason
