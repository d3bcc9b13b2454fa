"""Entries of a benchmark: what a method earned on all tasks of a track, by a protocol that all entries have in common.

An entry is made of runs (`plugins.results.report.own_entries`), or read from the results file of one that was made
elsewhere. Both are checked alike.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean
from typing import Annotated, Any, NamedTuple

from pydantic import Field, TypeAdapter

from core.errors import UserError, choices
from core.store.rows import Amount, Count, Id, Reward, parsed
from core.support.files import read_untrusted
from core.support.inputs import check
from core.values.efforts import Effort, holds
from plugins.results.pages.runs import short
from plugins.results.report.protocols import Protocol, fixed_settings, protocol

MAX_BYTES = 10_000_000
"""Of a results file."""

FIRST_UNSEEN = 1_000_000
"""The seed of the first test layout."""

FINALS = 1_000
"""Layouts after those of the search that finalists may see."""

Rewards = Annotated[tuple[Reward, ...], Field(min_length=1, max_length=1000)]


@dataclass(frozen=True)
class RunResult:
    """What a run earned in layouts that its search never saw, and what the search took.

    Where nothing could be tried, all rewards are 0 and there is no design.

    Attributes:
        seed: of the run; its search may see the layouts from this one on.
        rewards: in the unseen layouts, by engine.
        candidates: how many were tried.
        rollouts: in how many layouts and engines, all together.
        requests: to the model.
        cost_usd: of the replies; None: none reports it.
        wall_time_s: of the search.
        design: that earned the rewards, as a design of a designs file.
        effort: what its motion costs; None: it was not measured.
    """

    seed: Count
    rewards: dict[str, Rewards]
    candidates: Count
    rollouts: Count
    requests: Count
    cost_usd: Amount | None
    wall_time_s: Amount
    design: dict[str, Any] | None = None
    effort: Effort | None = None

    def score(self, rules: Protocol, task: str) -> float:
        """Return the mean in the engine where that is the lowest, or where the protocol asks for it, the effort saved.

        Then what does not hold scores 0, and the reference 1.
        """
        lowest = min(map(fmean, self.rewards.values()), default=0.0)
        if not rules.references:
            return lowest
        if self.effort is None or not holds(lowest):
            return 0.0
        return self.effort.saved(rules.references[task])


@dataclass(frozen=True)
class TaskResult:
    """The runs of a task, each with another seed."""

    runs: Annotated[tuple[RunResult, ...], Field(min_length=1, max_length=100)]

    def reward(self, engine: str) -> float:
        """Return the mean over the runs of their rewards in an engine."""
        return fmean([fmean(run.rewards[engine]) for run in self.runs])


@dataclass(frozen=True)
class Entry:
    """The content of a results file.

    Attributes:
        name: of the method.
        protocol: that all runs followed.
        version: of the protocol.
        track: whose tasks were run.
        settings: those that all runs share, as text by dotted key.
        versions: of packages.
        tasks: the results of each.
    """

    name: Id
    protocol: str
    version: Count
    track: Id
    settings: dict[str, str]
    versions: dict[str, str]
    tasks: dict[str, TaskResult]

    @property
    def rules(self) -> Protocol:
        """The protocol that it follows."""
        return protocol(self.protocol)

    @property
    def runs(self) -> list[RunResult]:
        runs = list[RunResult]()
        for task in self.tasks.values():
            runs += task.runs
        return runs

    @property
    def scores(self) -> dict[str, list[float]]:
        """The scores of the runs of each task."""
        scores = {}
        for name, task in self.tasks.items():
            scores[name] = [run.score(self.rules, name) for run in task.runs]
        return scores

    @property
    def score(self) -> float:
        """The mean over tasks of the mean over their runs."""
        return fmean(map(fmean, self.scores.values()))

    def dump(self) -> bytes:
        return TypeAdapter(Entry).dump_json(self, indent=2) + b"\n"


class ListedEntry(NamedTuple):
    """An entry, and how it was verified, in words."""

    entry: Entry
    verified: str


def read_entry(file: Path) -> Entry:
    """Read a results file.

    Raises:
        UserError: it is none, does not follow its protocol, or is not possible.
    """
    try:
        return check_entry(check(Entry, parsed(read_untrusted(file, MAX_BYTES))))
    except (ValueError, UserError) as error:
        raise UserError(f"{file} can't be compared: {short(str(error))}") from error


def check_entry(entry: Entry) -> Entry:
    """Check that an entry follows its protocol, and that runs can have such figures; return it.

    Raises:
        UserError: the first thing that differs.
    """
    rules = entry.rules
    if entry.version != rules.version:
        raise UserError(
            f"it follows version {entry.version} of the protocol {rules.name}, not {rules.version}"
        )

    if entry.track not in rules.tracks:
        raise choices("track", entry.track, rules.tracks)
    _check_settings(entry)
    _check_tasks(entry)
    _check_seeds(entry)

    wanted = dict.fromkeys(rules.engines, rules.layouts)
    for run in entry.runs:
        if {engine: len(rewards) for engine, rewards in run.rewards.items()} != wanted:
            raise UserError(
                f"a run lacks rewards in {rules.layouts} unseen layouts in each of {', '.join(rules.engines)}"
            )

    return entry


def _check_settings(entry: Entry) -> None:
    """Check that all runs have the settings that the protocol fixes, and their engine as it is."""
    engine = entry.settings.get("sim.name", "")
    for key, value in fixed_settings(entry.protocol, engine).items():
        value_of_runs = entry.settings.get(key, "not the same in all runs")
        if value_of_runs != value:
            where = f"the protocol {entry.protocol}"
            if key.startswith("sim."):
                where = engine
            raise UserError(
                f"{key} is {short(value_of_runs)}, where {where} has {value}"
            )


def _check_tasks(entry: Entry) -> None:
    """Check that an entry has all tasks of its track, and no other."""
    tasks = entry.rules.tracks[entry.track]
    lacks = [task for task in tasks if task not in entry.tasks]
    if lacks:
        raise UserError(
            f"it lacks {', '.join(lacks)}; an entry has all {len(tasks)} tasks of the track {entry.track}"
        )

    more = [short(task) for task in entry.tasks if task not in tasks]
    if more:
        raise UserError(f"the track {entry.track} has no task {', '.join(more)}")


def _check_seeds(entry: Entry) -> None:
    """Check that all tasks have the same seeds, whose layouts are none of the unseen ones."""
    seeds = set()
    for task in entry.tasks.values():
        of_task = sorted(run.seed for run in task.runs)
        seeds.add(tuple(of_task))

        if len(seeds) > 1 or len(set(of_task)) < len(of_task):
            raise UserError(
                "its tasks have other seeds, or one twice; run each task once with each of the same seeds"
            )

    layouts = 1
    count = entry.settings.get("fitness.layouts", "")
    if re.fullmatch(r"\d{1,9}", count):
        layouts = max(int(count), 1)

    for run in entry.runs:
        if run.seed + layouts > FIRST_UNSEEN - FINALS:
            raise UserError(
                f"no run has the seed {run.seed}: its layouts reach the unseen ones"
            )
