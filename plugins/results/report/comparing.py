"""Tables that compare: methods seed by seed, engines design by design, and one's own figures with published ones."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import combinations
from statistics import fmean

import numpy as np
import scipy.stats

from plugins.results.pages.formats import Cell, Table
from plugins.results.report.methods import Group
from plugins.results.report.results import Results
from plugins.results.report.statistics import interquartile_mean, interval
from plugins.results.study.study_files import Published

GOOD = 0.6  # in one engine ...
KEPT = 0.4  # ... and still good in another

Rows = Iterator[tuple[Cell, ...]]


def comparing_tables(results: Results) -> list[Table]:
    """Make all of them; one that has nothing to compare has no rows."""
    return [
        Table.of(
            "gains",
            "method|against|tasks:0|pairs of runs:0|gain:3|low:3|high:3|solved:0|of runs:0",
            _gains(results),
        ),
        Table.of(
            "published",
            "what|published:3|here:3|tasks here:0|runs here:0",
            _published(results),
        ),
        Table.of(
            "agreement",
            "task|engine|other engine|designs:0|rank correlation:2|mean difference:3"
            "|good and kept (%):0",
            _agreement(results),
        ),
    ]


def _gains(results: Results) -> Rows:
    """Compare each method with the first one, in the same task with the same seed."""
    first, *others = results.methods or [""]
    for method in others:
        by_task = []
        for mine in results.groups_of(method):
            for other in results.groups_of(first):
                pairs = _differences(mine, other) if mine.task == other.task else []
                by_task += [pairs] if pairs else []

        if not by_task:
            continue

        low, high = interval(by_task, "interquartile mean") or (None, None)
        every = sum(by_task, list[float]())
        runs = [run for group in results.groups_of(method) for run in group.runs]
        solved = sum(run.best.solved for run in runs)
        counts = (len(by_task), len(every))
        gain = interquartile_mean(every)
        yield method, first, *counts, gain, low, high, solved, len(runs)


def _differences(mine: Group, other: Group) -> list[float]:
    """Subtract the best rewards of the runs that have the same seed."""
    there = {run.seed: run.best.reward for run in other.runs}
    return [run.best.reward - there[run.seed] for run in mine.runs if run.seed in there]


def _published(results: Results) -> Rows:
    """Put a study's published figures beside the same of these runs, as far as they are there."""
    for entry in results.study.published if results.study is not None else ():
        groups = _shared(results, entry)
        tasks = {group.task for group in groups}
        runs = sum(len(group.runs) for group in groups)
        here = None
        if groups:
            here = _mean(groups, entry.methods)
            base = _mean(groups, entry.against) if entry.against else None
            if base is not None:
                here = 100 * (here - base) / base if base > 0 else None

        yield entry.what, entry.value, here, len(tasks), runs


def _shared(results: Results, entry: Published) -> list[Group]:
    """Return the groups of the methods that an entry names, on the tasks that all of them have."""
    named = [*entry.methods, *entry.against]
    groups = [group for group in results.groups if group.method in named]
    shared = []
    for task in entry.tasks or results.tasks:
        found = [group for group in groups if group.task == task]
        if len(found) == len(named):
            shared += found

    return shared


def _mean(groups: Sequence[Group], methods: Sequence[str]) -> float:
    """Return the mean over tasks of each task's average over runs."""
    return fmean([fmean(group.rewards) for group in groups if group.method in methods])


def _agreement(results: Results) -> Rows:
    """Compare what designs earn in each two engines in which all of a task's candidates were tried."""
    for task in results.tasks:
        rewards = _rewards_by_engine(results, task)
        for engine, other in combinations(rewards, 2):
            both = sorted(rewards[engine].keys() & rewards[other].keys())
            if len(both) < 2:
                continue

            mine = np.round([rewards[engine][design] for design in both], 2)
            theirs = np.round([rewards[other][design] for design in both], 2)
            ranks = None
            if np.ptp(mine) > 0 and np.ptp(theirs) > 0:
                ranks = float(scipy.stats.spearmanr(mine, theirs).statistic)

            kept = theirs[mine > GOOD] > KEPT
            yield (
                task,
                engine,
                other,
                len(both),
                ranks,
                float(np.mean(np.abs(mine - theirs))),
                100 * float(np.mean(kept)) if len(kept) else None,
            )


def _rewards_by_engine(
    results: Results, task: str
) -> dict[str, dict[tuple[str, str], float]]:
    """Return the mean reward of each candidate in each engine, without those that were rejected."""
    found: dict[str, dict[tuple[str, str], float]] = defaultdict(dict)
    for run in results.runs:
        if run.task != task:
            continue

        for row in run.store.evaluations():
            by_engine = defaultdict(list)
            for trial in row.trials:
                by_engine[trial.where.engine].append(trial.reward)

            for engine, earned in by_engine.items():
                found[engine][str(run.folder), row.candidate] = fmean(earned)

    return found
