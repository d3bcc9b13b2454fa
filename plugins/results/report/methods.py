"""Methods: runs with the same configuration are one method's, with a short name that distinguishes it."""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from plugins.results.pages.runs import AnyRun, FinishedRun, LeftOutRun, short

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
    """The runs of one method on one task.

    Attributes:
        task: its name.
        method: its name, as reports show it.
        runs: those that count.
        left_out: how many failed or are unfinished.
    """

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

        def order(run: FinishedRun) -> tuple[Any, ...]:
            best = run.best
            return -best.reward, best.distance_m is None, best.distance_m

        return min(self.runs, key=order)


def group(
    finished: Sequence[FinishedRun], left_out: Sequence[LeftOutRun] = ()
) -> list[Group]:
    """Group runs by task, in alphabetical order, and method, in the order in which methods appear.

    Args:
        finished: runs that count.
        left_out: runs that don't, but are counted where their task and method are known.
    """
    known = [run for run in left_out if run.task and run.config]
    runs: list[AnyRun] = [*finished, *known]
    labels = label([(run.task, run.config) for run in runs])
    grouped: dict[tuple[str, str], list[FinishedRun]] = defaultdict(list)
    for run, name in zip(finished, labels, strict=False):
        grouped[run.task, name].append(run)
    lost: Counter[tuple[str, str]] = Counter()
    for left, name in zip(known, labels[len(finished) :], strict=True):
        lost[left.task, name] += 1

    order = list(dict.fromkeys(labels))
    keys = sorted(grouped, key=lambda key: (key[0], order.index(key[1])))

    return [Group(*key, tuple(grouped[key]), lost[key]) for key in keys]


def label(configs: Sequence[tuple[str, Mapping[str, Any]]]) -> list[str]:
    """Name the method of each (task, configuration): by the user's ``name``, or else as `_distinguish` says."""
    labels = []
    unnamed = []
    for number, (_, config) in enumerate(configs):
        name = config.get("name")
        labels.append(short(name) if isinstance(name, str) else "")
        if not labels[-1]:
            unnamed.append(number)

    names = _distinguish([configs[number] for number in unnamed])
    for number, name in zip(unnamed, names, strict=True):
        labels[number] = name

    return labels


def _distinguish(configs: Sequence[tuple[str, Mapping[str, Any]]]) -> list[str]:
    """Name the method of each (task, configuration) by the settings that distinguish methods.

    Choices (``tool=none``) distinguish methods wherever they differ. Another setting does where two runs of one task
    with the same choices differ in it, so that a setting that follows from a choice or from the task makes no method
    of its own. The seed, the executor and the listeners never do.
    """
    settings = [flatten(config) for _, config in configs]
    keys = sorted(set[str]().union(*settings))
    first = [f"{choice}.name" for choice in CHOICES]
    more = [key for key in keys if key.count(".") == 1 and key.endswith(".name")]
    choices = list(dict.fromkeys([*first, *more]))

    # The runs of one task with the same choices.
    alike = defaultdict(list)
    for (task, _), setting in zip(configs, settings, strict=True):
        alike[task, *(setting.get(key) for key in choices)].append(setting)
    varying = [key for key in choices if _varies(settings, key)]

    for key in keys:
        if key not in choices and any(_varies(runs, key) for runs in alike.values()):
            varying.append(key)

    named_by = varying or choices[:3]

    return [" ".join(_describe(setting, named_by)) for setting in settings]


def flatten(config: Mapping[str, Any], prefix: str = "") -> dict[str, str]:
    """The settings that can distinguish methods, as text by dotted key."""
    found: dict[str, str] = {}
    for key, value in config.items():
        name = f"{prefix}{key}"
        if name in _NO_METHOD:
            continue
        if isinstance(value, Mapping):
            found |= flatten(value, f"{name}.")
        else:
            found[name] = value if isinstance(value, str) else json.dumps(value)

    return found


def _varies(settings: Iterable[Mapping[str, str]], key: str) -> bool:
    return len({setting.get(key) for setting in settings}) > 1


def _describe(setting: Mapping[str, str], keys: Iterable[str]) -> list[str]:
    words = []
    for key in keys:
        name = key.removesuffix(".name")
        value = setting.get(key)
        words.append(short(f"no {name}" if value is None else f"{name}={value}"))

    return words
