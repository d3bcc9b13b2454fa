"""Make entries of a benchmark from the runs at hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from core.errors import UserError
from core.store.reader import StoredRun
from core.values.messages import Bill
from plugins.results.pages.runs import AnyRun, FinishedRun, LeftOutRun, short
from plugins.results.report.entries import Entry, RunResult, TaskResult, check_entry
from plugins.results.report.methods import differing, flatten, label
from plugins.results.report.protocols import Protocol, protocol


class _Followed(NamedTuple):
    """A method, and the protocol that its runs followed.

    Attributes:
        name: as the entry will be called.
        protocol: its name.
        version: when the runs were made.
    """

    name: str
    protocol: str
    version: int


def find_entries(
    finished: Sequence[FinishedRun], left_out: Sequence[LeftOutRun], name: str = ""
) -> tuple[list[Entry], list[str]]:
    """Make an entry of each method's runs on a track by a protocol.

    Args:
        finished: runs that count.
        left_out: runs that don't; an entry must not have any, but those in which nothing could be tried.
        name: what entries are called; of several methods each adds its own. Empty: by their methods.

    Returns:
        The entries, and why other runs are none.
    """
    entries: list[Entry] = []
    problems: list[str] = []
    for followed, runs in _group([*finished, *left_out], name).items():
        try:
            rules = protocol(followed.protocol)
        except UserError:
            # Runs of a protocol that is not installed are runs like others.
            continue

        for track, tasks in rules.tracks.items():
            on_track = [run for run in runs if run.task in tasks]
            if not on_track:
                continue

            try:
                entries.append(_make_entry(followed, rules, track, on_track))
            except UserError as error:
                problems.append(
                    f"no entry of the track {track}: {followed.name}: {error}"
                )

    return entries, problems


def _group(runs: Sequence[AnyRun], name: str) -> dict[_Followed, list[AnyRun]]:
    """Group the runs that followed a protocol by it and their method."""
    known = [run for run in runs if run.task and run.config]
    methods = label(known)
    several = len({*methods.values()}) > 1
    groups: dict[_Followed, list[AnyRun]] = {}
    for run, method in methods.items():
        called = name or method
        if name and several:
            called = f"{name} {method}"

        match run.config.get("protocol"):
            case {"name": str(rules), "version": int(version)}:
                followed = _Followed(called, rules, version)
                groups.setdefault(followed, []).append(run)

    return groups


def _make_entry(
    followed: _Followed, rules: Protocol, track: str, runs: Sequence[AnyRun]
) -> Entry:
    """Make an entry of runs on a track.

    Args:
        followed: the name of the entry, and the version of the protocol that its runs followed.
        rules: the protocol as it is now.
        track: whose tasks they are.
        runs: of one method.

    Raises:
        UserError: a run is not finished, they differ, or they are no entry (`check_entry`).
    """
    for run in runs:
        if isinstance(run, LeftOutRun) and run.status != "failed":
            raise UserError(
                f"{short(str(run.folder))} is {run.status}; resume it, or delete it"
            )

    apart = differing(runs)
    if apart:
        names = ", ".join(apart)
        raise UserError(f"its runs differ in more than task and seed: {names}")

    settings = flatten(runs[0].config)
    for run in runs[1:]:
        theirs = flatten(run.config)
        settings = {k: v for k, v in settings.items() if theirs.get(k) == v}

    versions: dict[str, str] = {}
    results: dict[str, list[RunResult]] = {}
    for run in sorted(runs, key=lambda run: run.task):
        results.setdefault(run.task, []).append(_make_result(run, rules))
        if isinstance(run, FinishedRun):
            versions |= run.figures.versions

    entry = Entry(
        name=followed.name,
        protocol=rules.name,
        version=followed.version,
        track=track,
        settings=settings,
        versions=versions,
        tasks={task: TaskResult(tuple(rows)) for task, rows in results.items()},
    )

    return check_entry(entry)


def _make_result(run: AnyRun, rules: Protocol) -> RunResult:
    """Return what a run earned and took; one in which nothing could be tried earned nothing."""
    store = StoredRun(run.folder)
    bill = Bill.of([reply for _, reply in store.answers()])
    tried = [e for e in store.evaluations() if e.status != "rejected"]
    result = RunResult(
        seed=run.config["seed"],
        rewards=dict.fromkeys(rules.engines, (0.0,) * rules.layouts),
        candidates=len(tried),
        rollouts=sum(evaluation.rollouts for evaluation in tried),
        requests=len(store.requests()),
        cost_usd=bill.cost_usd,
        wall_time_s=store.seconds(),
    )
    if not isinstance(run, FinishedRun):
        return result

    design = None
    for evaluation in tried:
        if evaluation.candidate == run.best.candidate:
            written = store.designs()[evaluation.design_key].written
            design = written | {"action_sets": [evaluation.plan]}

    unseen = run.figures.unseen

    return replace(
        result,
        rewards=unseen.engines if unseen is not None else {},
        design=design,
        effort=run.figures.effort,
    )
