"""The tables of a report about models: what each was asked, what that cost and earned, and what critics wrote."""

from __future__ import annotations

import math
from collections import defaultdict
from typing import NamedTuple

from core.store.reader import RunCost, StoredEvaluation, StoredRequest
from plugins.results.pages.formats import Cell, CellLink, Table, columns
from plugins.results.report.results import Results


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
        asked: defaultdict[_Model, list[StoredRequest]] = defaultdict(list)
        earned: defaultdict[_Model, list[StoredEvaluation]] = defaultdict(list)
        for run in g.runs:
            answers = run.store.answers() if run.store.exists else []
            for request, reply in answers:
                asked[_Model(reply.model, request.critique)].append(request)
            # The candidates of an agent are those of its last answer: a checked or repaired one comes second.
            designers = {(r.generation, r.agent): reply.model for r, reply in answers if not r.critique}
            for evaluation in run.store.evaluations() if answers else ():
                if (name := designers.get(evaluation.design[:2])) is not None:
                    earned[_Model(name, False)].append(evaluation)
        for model in sorted(asked) if len(asked) > 1 else ():
            tried = [e for e in earned[model] if e.status != "rejected"]
            rewards = [e.reward for e in tried if e.status == "ok"]
            rows.append(
                (
                    *(g.task, g.method, model.name, "critiques" if model.critic else "designs"),
                    *RunCost.of(asked[model])[1:],
                    *((len(earned[model]), 100 * len(tried) / len(earned[model])) if earned[model] else (None, None)),
                    *((max(rewards), math.fsum(rewards) / len(rewards)) if rewards else (None, None)),
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
        for run in (run for run in g.runs if run.store.exists):
            written = [(request, reply) for request, reply in run.store.answers() if request.critique]
            rewards = {e.candidate: e.reward for e in run.store.evaluations()} if written else {}
            for request, reply in sorted(written, key=lambda pair: (pair[0].generation, pair[0].agent)):
                if reply.error is None:
                    candidate = next(iter(request.elites), "")
                    said = (candidate, rewards.get(candidate), reply.text, reply.model, reply.cost_usd)
                    rows.append((g.task, g.method, *said, CellLink(run.folder.name, run.folder)))
    note = "Opinions of models on pictures and figures of rollouts (`prompt.critic`), cut to 1000 characters."
    return Table("critiques", "Critiques", head, tuple(rows), note)
