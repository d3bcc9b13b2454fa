"""Run the designs in a results file again, in the layouts that it says they were tried in."""

from __future__ import annotations

import contextlib
import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

from omegaconf import DictConfig, OmegaConf

from core.config.compose import load
from core.design import DesignError
from core.errors import UserError
from core.interfaces import Evaluation
from core.plugins.outside import outside_part
from core.search.finalists import try_unseen
from core.search.saved_designs import build_fitness, open_trials, read_candidates
from plugins.results.pages.formats import Table
from plugins.results.pages.runs import short
from plugins.results.report.entries import Entry, RunResult

TOLERANCE = 0.01
"""Of a score: other processors round otherwise."""


class VerifiedRun(NamedTuple):
    """A run of an entry, and what its design earned again.

    Attributes:
        entry: the content of the results file.
        task: the run's.
        seed: the run's.
        claimed: the score by the file.
        score: what the design earned here; None: it was not tried.
        why: it was not tried.
    """

    entry: Entry
    task: str
    seed: int
    claimed: float
    score: float | None
    why: str = ""

    @property
    def same(self) -> bool:
        return self.score is not None and abs(self.score - self.claimed) <= TOLERANCE


def verify(entry: Entry) -> Iterator[VerifiedRun]:
    """Yield each run of an entry with what its design earns here. A run that claims nothing is not tried."""
    for task, result in entry.tasks.items():
        for run in result.runs:
            claimed = run.score(entry.rules, task)
            score = None
            why = ""

            if claimed == 0:
                score = 0.0
            elif run.design is None:
                why = "the file has no design of it"
            else:
                try:
                    again = try_again(entry, task, run)
                    score = again.score(entry.rules, task)
                except (UserError, DesignError) as error:
                    why = short(str(error))

            yield VerifiedRun(entry, task, run.seed, claimed, score, why)


def try_again(entry: Entry, task: str, run: RunResult) -> RunResult:
    """Try a run's design as the protocol says; return the run with what it earned and spent.

    Raises:
        UserError: a part is not installed here, or a setting can't be used.
        DesignError: the design can't be read.
    """
    cfg = _configure(entry, task)
    cfg.seed = run.seed
    document = {"strategies": [run.design]}
    candidate, *_ = read_candidates(cfg, document, most=(1, 1))
    if candidate.problem is not None:
        raise DesignError(candidate.problem)

    fitness = build_fitness(cfg)
    with open_trials(cfg) as trials:
        tried = try_unseen(candidate, fitness, trials)

    effort = Evaluation(candidate, tried).effort
    return replace(run, rewards=fitness.rewards(tried), effort=effort)


def _configure(entry: Entry, task: str) -> DictConfig:
    """Compose the protocol's configuration, with the entry's own engine and way to write tools."""
    settings = {}
    for key, value in entry.settings.items():
        if key.startswith("tool."):
            settings[key] = value

    name = settings.pop("tool.name", "urdf")
    interpolated = any("$" in value for value in settings.values())
    if interpolated or not re.fullmatch(r"\w{1,50}", name):
        raise UserError(
            f"tool={short(name)} with such settings is no tool representation"
        )

    words = [f"protocol={entry.protocol}", f"task={task}", f"tool={name}"]
    words.append(f"sim={entry.settings['sim.name']}")  # the default may not be there
    cfg = load("config", words)
    for key, text in settings.items():
        if OmegaConf.select(cfg, key) is None:
            raise UserError(f"tool={name} has no setting {short(key)}")

        value = text
        with contextlib.suppress(ValueError):  # else it is a text
            value = json.loads(text)

        cfg.tool[key.removeprefix("tool.")] = value

    for found in outside_part("tool", OmegaConf.to_container(cfg.tool), "tool"):
        raise UserError(
            f"{short(found.path)} names a {found.what}, and a results file may name none"
        )

    return cfg


def verification(runs: Sequence[VerifiedRun]) -> Table:
    """Make the table of runs that were verified."""
    head = "entry|task|seed|claimed:3|earned again:3|verified"
    rows = []
    for run in runs:
        verified = "yes" if run.same else f"no {run.why}".strip()
        row = (run.entry.name, run.task, run.seed, run.claimed, run.score, verified)
        rows.append(row)

    return Table.of("verification", head, rows)
