"""Entries of a benchmark: what a method earned on all tasks of a track, by a protocol that all entries have in common.

An entry is made of runs, or read from the results file of one that was made elsewhere. Both are checked alike.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from statistics import fmean
from typing import Annotated, Any, NamedTuple

from omegaconf import OmegaConf
from pydantic import Field, TypeAdapter

from core.config.compose import load
from core.errors import UserError, choices
from core.plugins import installed
from core.store.database import FILE
from core.store.reader import StoredRun
from core.store.rows import Amount, Count, Id, Reward, Seed, parsed, validated
from core.support.files import read_untrusted
from core.values.efforts import Effort, holds
from plugins.results.pages.formats import Table
from plugins.results.pages.runs import FinishedRun, LeftOutRun, short
from plugins.results.report.methods import flatten, label
from plugins.results.report.statistics import RunCost, interval

AnyRun = FinishedRun | LeftOutRun

MAX_BYTES = 10_000_000  # of a results file
FIRST_UNSEEN = 1_000_000  # the seed of the first test layout


@dataclass(frozen=True)
class Protocol:
    """A protocol as it is now: the settings that it fixes, the tasks of each track, and what the best is tried in.

    With ``references``, by task, what counts of a design that holds is the effort saved.
    """

    name: str
    version: int
    fixed: dict[str, str]
    tracks: dict[str, list[str]]
    engines: list[str]
    layouts: int
    references: dict[str, Effort] = field(default_factory=dict)


@lru_cache
def protocol(name: str) -> Protocol:
    """Return the protocol of this name.

    Raises:
        UserError: there is none.
    """
    # A file or a store says it.
    if name == "none" or not re.fullmatch(r"\w{1,50}", name):
        raise UserError(f"no protocol {short(name)!r}")
    config = load("config", [f"protocol={name}"])
    chosen = config.protocol
    container: Any = OmegaConf.to_container(config, resolve=True)
    settings = flatten(container)
    starts = tuple(f"{key}." for key in chosen.fixed)
    fixed = {
        key: value for key, value in settings.items() if f"{key}.".startswith(starts)
    }
    offers = [offer for offer in installed().offers.values() if offer.kind == "task"]
    known = {
        task: Effort(*numbers)
        for task, numbers in config.fitness.get("references", {}).items()
    }
    tracks = {
        track: [
            o.name
            for o in offers
            if o.entry_point == plugin and (o.name in known or not known)
        ]
        for track, plugin in chosen.tracks.items()
    }
    return Protocol(
        name, chosen.version, fixed, tracks, list(chosen.engines), chosen.layouts, known
    )


@dataclass(frozen=True)
class RunResult:
    """A run: its rewards in unseen layouts by engine, what its search took, and the design that earned them.

    Where nothing could be tried, all rewards are 0 and there is no design.
    """

    seed: Seed
    rewards: dict[
        str, Annotated[tuple[Reward, ...], Field(min_length=1, max_length=1000)]
    ]
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
        return (
            self.effort.saved(rules.references[task])
            if self.effort is not None and holds(lowest)
            else 0.0
        )


@dataclass(frozen=True)
class TaskResult:
    """The runs of a task, each with another seed."""

    runs: Annotated[tuple[RunResult, ...], Field(min_length=1, max_length=100)]

    def reward(self, engine: str) -> float:
        """Return the mean over the runs of their rewards in an engine."""
        return fmean([fmean(run.rewards[engine]) for run in self.runs])


@dataclass(frozen=True)
class Entry:
    """The content of a results file; ``settings`` are those that all runs share, ``versions`` of packages."""

    name: Id
    protocol: str
    version: Count
    track: Id
    settings: dict[str, str]
    versions: dict[str, str]
    tasks: dict[str, TaskResult]

    @property
    def runs(self) -> list[RunResult]:
        return [run for task in self.tasks.values() for run in task.runs]

    @property
    def scores(self) -> dict[str, list[float]]:
        """The scores of the runs of each task."""
        rules = protocol(self.protocol)
        return {
            name: [run.score(rules, name) for run in task.runs]
            for name, task in self.tasks.items()
        }

    @property
    def score(self) -> float:
        """The mean over tasks of the mean over their runs."""
        return fmean(map(fmean, self.scores.values()))

    def dump(self) -> bytes:
        return TypeAdapter(Entry).dump_json(self, indent=2) + b"\n"


def read_entry(file: Path) -> Entry:
    """Read a results file.

    Raises:
        UserError: it is none, does not follow its protocol, or is not possible.
    """
    try:
        return check(validated(Entry, parsed(read_untrusted(file, MAX_BYTES))))
    except (ValueError, UserError) as error:
        raise UserError(f"{file} can't be compared: {short(str(error))}") from error


def check(entry: Entry) -> Entry:
    """Check that an entry follows its protocol, and that runs can have such figures; return it.

    Raises:
        UserError: the first thing that differs.
    """
    rules = protocol(entry.protocol)
    if entry.version != rules.version:
        raise UserError(
            f"it follows version {entry.version} of the protocol {rules.name}, not {rules.version}"
        )
    if entry.track not in rules.tracks:
        raise choices("track", entry.track, rules.tracks)
    engine = entry.settings.get("sim.name", "")
    for key, value in {**rules.fixed, **_engine(entry.protocol, engine)}.items():
        value_of_runs = entry.settings.get(key, "not the same in all runs")
        if value_of_runs != value:
            where = engine if key.startswith("sim.") else f"the protocol {rules.name}"
            raise UserError(
                f"{key} is {short(value_of_runs)}, where {where} has {value}"
            )
    tasks = rules.tracks[entry.track]
    if lacks := [task for task in tasks if task not in entry.tasks]:
        raise UserError(
            f"it lacks {', '.join(lacks)}; an entry has all {len(tasks)} tasks of the track {entry.track}"
        )
    if more := [short(task) for task in entry.tasks if task not in tasks]:
        raise UserError(f"the track {entry.track} has no task {', '.join(more)}")
    seeds = {
        tuple(sorted(run.seed for run in task.runs)) for task in entry.tasks.values()
    }
    if len(seeds) > 1 or any(len({*own}) < len(own) for own in seeds):
        raise UserError(
            "its tasks have other seeds, or one twice; run each task once with each of the same seeds"
        )
    wanted = dict.fromkeys(rules.engines, rules.layouts)
    if any(
        {engine: len(earned) for engine, earned in run.rewards.items()} != wanted
        for run in entry.runs
    ):
        raise UserError(
            f"a run lacks rewards in {rules.layouts} unseen layouts in each of {', '.join(rules.engines)}"
        )
    tried = [
        entry.settings.get(name, "") for name in ("fitness.layouts", "budget.n_final")
    ]
    layouts = sum(int(count) for count in tried if re.fullmatch(r"\d{1,9}", count))
    for run in entry.runs:
        if run.seed + max(layouts, 1) > FIRST_UNSEEN:
            raise UserError(
                f"no run has the seed {run.seed}: its layouts reach the unseen ones"
            )
    return entry


@lru_cache
def _engine(protocol_name: str, name: str) -> dict[str, str]:
    """The settings of an engine as it is, by dotted key.

    Raises:
        UserError: there is none of this name.
    """
    if not re.fullmatch(r"\w{1,50}", name):
        raise UserError(f"sim.name is {short(name)!r}, which is no engine")
    config = OmegaConf.to_container(
        load("config", [f"protocol={protocol_name}", f"sim={name}"]).sim, resolve=True
    )
    return flatten({"sim": config})


def find_entries(
    finished: Sequence[FinishedRun], left_out: Sequence[LeftOutRun], name: str = ""
) -> tuple[list[Entry], list[str]]:
    """Make an entry of each method's runs on a track by a protocol; return them, and why others are none.

    ``name`` is what entries are called; of several methods each adds its own.
    """
    every: list[AnyRun] = [*finished, *left_out]
    known = [run for run in every if run.task and run.config]
    methods = label([(run.task, run.config) for run in known])
    grouped: dict[tuple[str, str, int], list[AnyRun]] = {}
    for run, method in zip(known, methods, strict=True):
        called = " ".join(
            [name] * bool(name) + [method] * (not name or len({*methods}) > 1)
        )
        named = run.config.get("protocol")
        if (
            isinstance(named, dict)
            and named.get("name", "none") != "none"
            and isinstance(named.get("version"), int)
        ):
            grouped.setdefault(
                (called, str(named["name"]), named["version"]), []
            ).append(run)
    entries: list[Entry] = []
    problems: list[str] = []
    for (called, rules, version), runs in grouped.items():
        try:
            chosen = protocol(rules)
        except (
            UserError
        ):  # runs of a protocol that is not installed are runs like others
            continue
        for track, tasks in chosen.tracks.items():
            own = [run for run in runs if run.task in tasks]
            try:
                entries += [_entry(called, chosen, version, track, own)] if own else []
            except UserError as error:
                problems.append(f"no entry of the track {track}: {called}: {error}")
    return entries, problems


def differences(runs: Sequence[AnyRun]) -> str:
    """Say in which settings runs differ; empty: in none."""
    methods = {*label([(run.task, {**run.config, "name": ""}) for run in runs])}
    return "; ".join(sorted(methods)) if len(methods) > 1 else ""


def _entry(
    name: str, rules: Protocol, version: int, track: str, runs: Sequence[AnyRun]
) -> Entry:
    for run in runs:
        if isinstance(run, LeftOutRun) and not (
            run.status == "failed" and (run.folder / FILE).exists()
        ):
            raise UserError(
                f"{short(str(run.folder))} is {run.status}; resume it, or delete it"
            )
    if apart := differences(runs):
        raise UserError(f"its runs differ in more than task and seed: {apart}")
    settings = [flatten(run.config) for run in runs]
    shared = {
        key: value
        for key, value in settings[0].items()
        if all(own.get(key) == value for own in settings)
    }
    versions: dict[str, str] = {}
    tasks: dict[str, list[RunResult]] = {}
    for run in sorted(runs, key=lambda run: run.task):
        tasks.setdefault(run.task, []).append(_result(run, rules))
        if isinstance(run, FinishedRun):
            versions |= run.figures.versions
    results = {task: TaskResult(tuple(own)) for task, own in tasks.items()}
    return check(Entry(name, rules.name, version, track, shared, versions, results))


def _result(run: AnyRun, rules: Protocol) -> RunResult:
    """What a run earned and took; one in which nothing could be tried earned nothing."""
    store = StoredRun(run.folder)
    cost = RunCost.of(store.requests())
    tried = [e for e in store.evaluations() if e.status != "rejected"]
    result = RunResult(
        seed=run.config["seed"],
        rewards=dict.fromkeys(rules.engines, (0.0,) * rules.layouts),
        candidates=len(tried),
        rollouts=sum(each.rollouts for each in tried),
        requests=cost.requests,
        cost_usd=cost.cost_usd,
        wall_time_s=store.seconds(),
    )
    if not isinstance(run, FinishedRun):
        return result
    best = next((e for e in tried if e.candidate == run.best.candidate), None)
    return replace(
        result,
        rewards=run.figures.unseen.engines if run.figures.unseen else {},
        design=store.designs()[best.design].written | {"action_sets": [best.plan]}
        if best
        else None,
        effort=run.figures.effort,
    )


class ListedEntry(NamedTuple):
    """An entry, and how it was verified, in words."""

    entry: Entry
    verified: str


def entry_tables(entries: Sequence[ListedEntry]) -> list[Table]:
    """Make the table of entries, the best of each track first, and that of their tasks."""
    listed = sorted(entries, key=lambda item: (item.entry.track, -item.entry.score))
    ranked = [item.entry for item in listed]
    engines = list(
        dict.fromkeys(
            engine for entry in ranked for engine in protocol(entry.protocol).engines
        )
    )
    head = f"track|entry|told|score:3|low:3|high:3{''.join(f'|{engine}:3' for engine in engines)}|seeds"
    head += "|rollouts per run:0|calls of the model per run:1|cost (USD):2|protocol|vlmgineer|verified"
    rows = []
    for entry, verified in listed:
        tasks = [*entry.tasks.values()]
        costs = [run.cost_usd for run in entry.runs if run.cost_usd is not None]
        rules = protocol(entry.protocol)
        alone = "" if len(rules.engines) > 1 else ", one engine"
        rows.append(
            (
                *(
                    entry.track,
                    entry.name,
                    entry.settings.get("prompt.told", "source"),
                    entry.score,
                ),
                *(interval([*entry.scores.values()], "mean") or (None, None)),
                *(
                    fmean([task.reward(e) for task in tasks])
                    if e in rules.engines
                    else None
                    for e in engines
                ),
                ", ".join(str(run.seed) for run in tasks[0].runs),
                *(
                    fmean([getattr(run, name) for run in entry.runs])
                    for name in ("rollouts", "requests")
                ),
                sum(costs) if costs else None,
                *(
                    f"{entry.protocol} {entry.version}{alone}",
                    entry.versions.get("vlmgineer"),
                    verified,
                ),
            )
        )
    by_task = [
        (e.track, task, e.name, fmean(own), len(own))
        for e in ranked
        for task, own in e.scores.items()
    ]
    by_task_head = "track|task|entry|score:3|runs:0"
    return [
        Table.of("entries", head, rows),
        Table.of("entries_by_task", by_task_head, sorted(by_task)),
    ]
