"""Run the designs in a results file again, in the layouts that it says they were tried in."""

from __future__ import annotations

import contextlib
import json
import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from omegaconf import DictConfig, OmegaConf

from core.config.compose import load, node, part, task_part, tool_part
from core.design import DesignError
from core.designs.reading import read_designs
from core.errors import UserError
from core.interfaces import RolloutSettings
from core.plugins import EXECUTOR, FITNESS, SIMULATOR
from core.search.finalists import try_unseen
from core.search.trials import Trials
from core.trial import Condition, Evaluation
from plugins.results.pages.formats import Table
from plugins.results.pages.runs import short
from plugins.results.report.leaderboard import Entry, RunResult, protocol

TOLERANCE = 0.01  # of a score: other processors round otherwise


class VerifiedRun(NamedTuple):
    """A run of an entry: the score that it claims, and what its design earned again; None: it was not tried."""

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
            claimed = run.score(protocol(entry.protocol), task)
            score, why = (
                (0.0, "") if claimed == 0 else (None, "the file has no design of it")
            )
            if run.design is not None and claimed > 0:
                try:
                    score, why = earned(entry, task, run), ""
                except (UserError, DesignError) as error:
                    why = short(str(error))
            yield VerifiedRun(entry, task, run.seed, claimed, score, why)


def earned(entry: Entry, task: str, run: RunResult) -> float:
    """Return the score of a run's design, tried as the protocol says.

    Raises:
        UserError: a part is not installed here, or a setting can't be used.
        DesignError: the design can't be read.
    """
    cfg = _config(entry, task)
    document = {"strategies": [run.design]}
    (candidate, *_) = read_designs(
        document, tool_part(cfg).create(), task_part(cfg).create(), most=(1, 1)
    )
    if candidate.problem is not None:
        raise DesignError(candidate.problem)
    condition = Condition(
        task_part(cfg),
        part(SIMULATOR, cfg.sim),
        run.seed,
        node(cfg.rollout, RolloutSettings),
    )
    fitness = part(FITNESS, cfg.fitness).create(condition=condition)
    with part(EXECUTOR, cfg.executor).create() as executor:
        rewards, effort = try_unseen(Evaluation(candidate), fitness, Trials(executor))
    again = RunResult(run.seed, rewards, 1, 1, 1, None, 0.0, effort=effort)
    return again.score(protocol(entry.protocol), task)


def _config(entry: Entry, task: str) -> DictConfig:
    """Compose the protocol's configuration, with the entry's own way to write tools."""
    settings = {
        key: value for key, value in entry.settings.items() if key.startswith("tool.")
    }
    name = settings.pop("tool.name", "urdf")
    if not re.fullmatch(r"\w{1,50}", name) or any(
        "$" in value for value in settings.values()
    ):
        raise UserError(
            f"tool={short(name)} with such settings is no tool representation"
        )
    cfg = load("config", [f"protocol={entry.protocol}", f"task={task}", f"tool={name}"])
    for key, value in settings.items():
        if OmegaConf.select(cfg, key) is None:
            raise UserError(f"tool={name} has no setting {short(key)}")
        with contextlib.suppress(ValueError):  # else it is a text
            value = json.loads(value)
        cfg.tool[key.removeprefix("tool.")] = value
    return cfg


def verification(runs: Sequence[VerifiedRun]) -> Table:
    """Make the table of runs that were verified."""
    rows = [
        (
            run.entry.name,
            run.task,
            run.seed,
            run.claimed,
            run.score,
            "yes" if run.same else f"no {run.why}".strip(),
        )
        for run in runs
    ]
    return Table.of(
        "verification", "entry|task|seed|claimed:3|earned again:3|verified", rows
    )
