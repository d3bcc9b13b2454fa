"""Methods: runs with the same configuration are one method's, with a short name that distinguishes it."""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from plugins.results.pages.runs import FinishedRun, LeftOutRun, short

CHOICES = (
    "tool",
    "evolution",
    "vlm",
    "action",
    "robot",
    "material",
    "prompt",
    "sim",
    "budget",
)
"""The choices that describe a method best, in this order; others follow."""

_NO_METHOD = (
    "name",
    "seed",
    "film",
    "listener",
    "executor",
    "protocol",
    "task.name",
    "task.paper",
)


@dataclass(frozen=True, eq=False)
class Group:
    """The runs of one method on one task; ``left_out`` counts those that failed or are unfinished."""

    task: str
    method: str
    runs: tuple[FinishedRun, ...]
    left_out: int = 0

    @property
    def rewards(self) -> list[float]:
        """The best reward of each run."""
        return [run.best.reward for run in self.runs]

    @property
    def best(self) -> FinishedRun:
        """The run with the highest reward; of two with the same, the one with the shorter distance."""
        return min(
            self.runs,
            key=lambda run: (
                -run.best.reward,
                run.best.distance_m is None,
                run.best.distance_m,
            ),
        )


def group(
    finished: Sequence[FinishedRun], left_out: Sequence[LeftOutRun] = ()
) -> list[Group]:
    """Group runs by task, in alphabetical order, and method, in the order in which methods appear."""
    known = [run for run in left_out if run.task and run.config]
    labels = label(
        [(run.task, run.config) for run in finished]
        + [(run.task, run.config) for run in known]
    )
    order = list(dict.fromkeys(labels))
    grouped: dict[tuple[str, int], list[FinishedRun]] = defaultdict(list)
    for run, name in zip(finished, labels, strict=False):
        grouped[run.task, order.index(name)].append(run)
    lost = Counter(
        (run.task, name)
        for run, name in zip(known, labels[len(finished) :], strict=True)
    )
    return [
        Group(
            task, order[method], tuple(grouped[task, method]), lost[task, order[method]]
        )
        for task, method in sorted(grouped)
    ]


def label(configs: Sequence[tuple[str, Mapping[str, Any]]]) -> list[str]:
    """Name the method of each (task, configuration): by the user's ``name``, or else as `_distinguished`."""
    given = [
        short(name) if isinstance(name := config.get("name"), str) else ""
        for _, config in configs
    ]
    others = iter(
        _distinguished(
            [pair for pair, name in zip(configs, given, strict=True) if not name]
        )
    )
    return [name or next(others) for name in given]


def _distinguished(configs: Sequence[tuple[str, Mapping[str, Any]]]) -> list[str]:
    """Name the method of each (task, configuration) by the settings that distinguish methods.

    Choices (``tool=none``) distinguish methods wherever they differ. Another setting does where two runs of one task
    with the same choices differ in it, so that a setting that follows from a choice or from the task makes no method
    of its own. The seed, the executor and the listeners never do.
    """
    settings = [flatten(config) for _, config in configs]
    named = {
        key
        for setting in settings
        for key in setting
        if key.endswith(".name") and key.count(".") == 1
    }
    first = [f"{choice}.name" for choice in CHOICES]
    choices = [*first, *sorted(named - set(first))]
    varying = [key for key in choices if len(_values(settings, key)) > 1]
    alike = defaultdict(list)
    for (task, _), setting in zip(configs, settings, strict=True):
        alike[task, *(setting.get(key) for key in choices)].append(setting)
    others = sorted({key for setting in settings for key in setting} - set(choices))
    varying += [
        key
        for key in others
        if any(len(_values(runs, key)) > 1 for runs in alike.values())
    ]
    named_by = varying or choices[:3]
    return [
        " ".join(_say(key, setting.get(key)) for key in named_by)
        for setting in settings
    ]


def flatten(config: Mapping[str, Any], prefix: str = "") -> dict[str, str]:
    """The settings that can distinguish methods, as text by dotted key."""
    found: dict[str, str] = {}
    for key, value in config.items():
        name = f"{prefix}{key}"
        if name not in _NO_METHOD:
            below = (
                flatten(value, f"{name}.")
                if isinstance(value, Mapping)
                else {name: value}
            )
            found |= {
                k: v if isinstance(v, str) else json.dumps(v) for k, v in below.items()
            }
    return found


def _values(settings: Sequence[Mapping[str, str]], key: str) -> set[str | None]:
    return {setting.get(key) for setting in settings}


def _say(key: str, value: str | None) -> str:
    name = key.removesuffix(".name")
    return short(f"{name}={value}" if value is not None else f"no {name}")
