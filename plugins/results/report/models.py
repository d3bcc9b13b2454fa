"""The tables of a report about models: what each was asked, what that cost and earned, and what critics wrote."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterator
from sqlite3 import Row
from typing import NamedTuple

from core.store.database import reading
from plugins.results.pages.formats import Cell, Link, Table, columns
from plugins.results.pages.runs import STORE, FinishedRun
from plugins.results.report.results import Results

_CRITIC = "'%-critic%'"  # the ids of requests for critiques
_ASKED = f"""
    SELECT model, id LIKE {_CRITIC} AS critic, count(*) AS replies, count(error) AS errors,
        sum(prompt_tokens) AS prompt, sum(completion_tokens) AS completion, sum(cost_usd) AS cost
    FROM requests JOIN replies ON request_id = id GROUP BY model, critic"""  # noqa: S608
# The candidates of an agent are those of its last answer: an answer that was checked or repaired comes second.
_EARNED = f"""
    WITH agents AS (
        SELECT generation, agent, model, max(replies.rowid) FROM requests JOIN replies ON request_id = id
        WHERE id NOT LIKE {_CRITIC} GROUP BY generation, agent
    )
    SELECT model, count(*) AS candidates, sum(status != 'rejected') AS tried, sum(status = 'ok') AS ok,
        max(CASE status WHEN 'ok' THEN reward END) AS best, total(reward) AS earned
    FROM evaluations JOIN agents USING (generation, agent) GROUP BY model"""  # noqa: S608
_CRITIQUES = f"""
    SELECT elites, text, model, cost_usd FROM requests JOIN replies ON request_id = id
    WHERE id LIKE {_CRITIC} AND error IS NULL ORDER BY requests.generation, requests.agent"""  # noqa: S608
_COUNTS = ("replies", "errors", "prompt", "completion", "cost")
_FIGURES = ("candidates", "tried", "ok", "earned")


class _Model(NamedTuple):
    """A model, and whether it was asked for critiques; of designs it has figures of its own."""

    name: str
    critic: bool


def models(results: Results) -> Table:
    """What each model was asked, what that cost and earned; where a method has several, or a critic."""
    head = columns(
        "task|method|model|asked for|replies:0|of them failed:0|prompt tokens:0|completion tokens:0|cost (USD):4"
        "|candidates:0|could be tried (%):1|best reward:3|mean reward:3"
    )
    rows: list[tuple[Cell, ...]] = []
    for g in results.groups:
        asked: defaultdict[_Model, dict[str, float]] = defaultdict(dict)
        for run in g.runs:
            for row in _rows(run, _ASKED):
                _add(asked[_Model(row["model"], bool(row["critic"]))], row, _COUNTS)
            for row in _rows(run, _EARNED):
                of = asked[_Model(row["model"], False)]
                _add(of, row, _FIGURES)
                of["best"] = max(of.get("best", 0.0), row["best"] or 0.0)
        for model, of in sorted(asked.items()) if len(asked) > 1 else ():
            candidates, ok = of.get("candidates", 0), of.get("ok", 0)
            rows.append(
                (
                    *(g.task, g.method, model.name, "critiques" if model.critic else "designs"),
                    *(of.get(name) for name in _COUNTS),
                    *(of.get("candidates"), 100 * of["tried"] / candidates if candidates else None),
                    *((of["best"], of["earned"] / ok) if ok else (None, None)),
                )
            )
    note = (
        "Sums over the runs; tokens and dollars are of the replies that report them. The rewards are those of all "
        "candidates in a model's answers that were tried. Which model is asked depends on what its answers earned, so "
        "that their means need not be comparable."
    )
    return Table("models", "Models", head, tuple(rows), note)


def critiques(results: Results) -> Table:
    """What critics wrote."""
    head = columns("task|method|candidate|reward:3|critique|model|cost (USD):4|run")
    rows: list[tuple[Cell, ...]] = []
    for g in results.groups:
        for run in g.runs:
            written = list(_rows(run, _CRITIQUES))
            rewards = dict(map(tuple, _rows(run, "SELECT candidate, reward FROM evaluations"))) if written else {}
            for row in written:
                candidate = str(next(iter(json.loads(row["elites"])), ""))
                said = (candidate, rewards.get(candidate), row["text"], row["model"], row["cost_usd"])
                rows.append((g.task, g.method, *said, Link(run.folder.name, run.folder)))
    note = "Opinions of models on pictures and figures of rollouts (`prompt.critic`), cut to 1000 characters."
    return Table("critiques", "Critiques", head, tuple(rows), note)


def _rows(run: FinishedRun, query: str) -> Iterator[Row]:
    if (run.folder / STORE).exists():
        with reading(run.folder) as database:
            yield from database.execute(query)


def _add(figures: dict[str, float], row: Row, names: tuple[str, ...]) -> None:
    """Add what is known."""
    for name in names:
        if row[name] is not None:
            figures[name] = figures.get(name, 0) + row[name]
