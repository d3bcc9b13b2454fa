"""The tables of a benchmark's entries."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import fmean

from core.values.messages import sum_known
from plugins.results.pages.formats import Cell, Table
from plugins.results.report.entries import ListedEntry
from plugins.results.report.statistics import interval


def entry_tables(entries: Sequence[ListedEntry]) -> list[Table]:
    """Make the table of entries, the best of each track first, and that of their tasks."""
    ranked = sorted(entries, key=lambda item: (item.entry.track, -item.entry.score))
    engines: dict[str, None] = {}
    by_task = []
    for entry, _ in ranked:
        engines |= dict.fromkeys(entry.rules.engines)
        for task, scores in entry.scores.items():
            row = (entry.track, task, entry.name, fmean(scores), len(scores))
            by_task.append(row)

    columns = "".join(f"|{engine}:3" for engine in engines)
    head = f"track|entry|told|score:3|low:3|high:3{columns}|seeds"
    head += "|rollouts per run:0|calls of the model per run:1|cost (USD):2|protocol|vlmgineer|verified"
    rows = [_row(listed, list(engines)) for listed in ranked]

    return [
        Table.of("entries", head, rows),
        Table.of("entries_by_task", "track|task|entry|score:3|runs:0", sorted(by_task)),
    ]


def _row(listed: ListedEntry, engines: Sequence[str]) -> tuple[Cell, ...]:
    """Return the row of an entry.

    Args:
        listed: the entry, and how it was verified.
        engines: of all entries, each of which has a column.
    """
    entry = listed.entry
    tasks = list(entry.tasks.values())
    low, high = interval(list(entry.scores.values()), "mean") or (None, None)
    tried = {
        engine: fmean([task.reward(engine) for task in tasks])
        for engine in entry.rules.engines
    }

    rules = f"{entry.protocol} {entry.version}"
    if len(entry.rules.engines) == 1:
        rules += ", one engine"

    return (
        entry.track,
        entry.name,
        entry.settings.get("prompt.context", "source"),
        entry.score,
        low,
        high,
        *map(tried.get, engines),
        ", ".join(str(run.seed) for run in tasks[0].runs),
        fmean([run.rollouts for run in entry.runs]),
        fmean([run.requests for run in entry.runs]),
        sum_known(run.cost_usd for run in entry.runs),
        rules,
        entry.versions.get("vlmgineer"),
        listed.verified,
    )
