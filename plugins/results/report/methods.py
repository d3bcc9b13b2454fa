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

TASK = "task.name"

PAPER = "paper"
"""Of a budget, and of its settings: what the paper has for the task. One method has it in all tasks."""

OF_TASK = ("k_top", "reward_save")  # which follow from the task in any budget

_NO_METHOD = (
    "name",
    "seed",
    "film",
    "second",
    "patience_s",
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
        return min(self.runs, key=rank)


def rank(run: FinishedRun) -> tuple[Any, ...]:
    """Return what sorts runs, the best first: by the reward, then by the distance."""
    best = run.best
    return -best.reward, best.distance_m is None, best.distance_m


def group(
    finished: Sequence[FinishedRun], left_out: Sequence[LeftOutRun] = ()
) -> list[Group]:
    """Group runs by task, in alphabetical order, and method, in the order in which methods appear.

    Args:
        finished: runs that count.
        left_out: runs that don't, but are counted where their task and method are known.
    """
    known = [run for run in left_out if run.task and run.config]
    names = label([*finished, *known])
    grouped: dict[tuple[str, str], list[FinishedRun]] = defaultdict(list)
    for run in finished:
        grouped[run.task, names[run]].append(run)

    lost = Counter((run.task, names[run]) for run in known)
    order = list(dict.fromkeys(names.values()))
    keys = sorted(grouped, key=lambda key: (key[0], order.index(key[1])))

    return [Group(*key, tuple(grouped[key]), lost[key]) for key in keys]


def label(runs: Sequence[AnyRun]) -> dict[AnyRun, str]:
    """Name the method of each run: by the user's ``name``, or else by what distinguishes it.

    A user's name of runs that differ says in what they do.
    """
    by_name = defaultdict(list)
    for run in runs:
        name = run.config.get("name")
        by_name[short(name) if isinstance(name, str) else ""].append(run)

    labels = dict.fromkeys(runs, "")
    for name, alike in by_name.items():
        apart = differing(alike)
        described = name
        if name and apart:
            keys = ", ".join(key.removesuffix(".name") for key in apart)
            described = f"{name} (differing in {keys})"

        shown = apart or [f"{choice}.name" for choice in CHOICES[:3]]
        for run in alike:
            labels[run] = described or " ".join(_describe(comparable(run), shown))

    return labels


def differing(runs: Sequence[AnyRun]) -> list[str]:
    """Return the settings in which runs differ, choices first (``tool.name``): by these they are of several methods.

    Left out is what follows from a choice: from that of its own group, as an engine's step, or by naming another
    group, as ``fitness.material``; and what follows from the task. The seed, what has its value in every run, as
    ``evolution.seed``, the executor and the listeners never distinguish methods. Of a setting that holds others, as
    ``vlm.options``, those count.
    """
    settings = [comparable(run) for run in runs]
    seeds = [json.dumps(run.config.get("seed")) for run in runs]
    every = set[str]().union(*settings)
    keys = sorted(every - _find_holders(every))
    choices = [key for key in keys if key.count(".") == 1 and key.endswith(".name")]
    groups = [key.partition(".")[0] for key in choices]
    found = []

    for key in sorted(keys, key=_place):
        group, *middle, _ = key.split(".")
        same = [] if key in choices else [f"{group}.name"]
        follows = not {*middle}.isdisjoint(groups)
        follows = follows or _follow_seed(settings, key, seeds)
        if not follows and key != TASK and _differ(settings, key, same):
            found.append(key)

    return found


def _follow_seed(
    settings: Sequence[Mapping[str, str]], key: str, seeds: Sequence[str]
) -> bool:
    """Report whether a setting has the value of the run's seed in each run that has it."""
    return all(
        setting.get(key, seed) == seed
        for setting, seed in zip(settings, seeds, strict=True)
    )


def _find_holders(keys: Iterable[str]) -> set[str]:
    """Return the keys below which others stand; one run may leave them empty."""
    found = set[str]()
    for key in keys:
        parts = key.split(".")
        found.update(".".join(parts[:length]) for length in range(1, len(parts)))

    return found


def _place(key: str) -> tuple[int, bool]:
    """Return what sorts settings: those that describe a method best first, and choices before others."""
    choice = key.removesuffix(".name")
    place = CHOICES.index(choice) if choice in CHOICES else len(CHOICES)
    return place, choice == key


def _differ(
    settings: Sequence[Mapping[str, str]], key: str, choices: Sequence[str]
) -> bool:
    """Report whether two runs that agree in some choices differ in a setting; one of the task, within a task."""
    within = [*choices, TASK] if key.startswith("task.") else choices
    alike = defaultdict(set)
    for setting in settings:
        alike[tuple(map(setting.get, within))].add(setting.get(key))

    return any(len(found) > 1 for found in alike.values())


def comparable(run: AnyRun) -> dict[str, str]:
    """Return the settings that can distinguish methods; `PAPER` stands for what the paper has for the task."""
    settings = flatten(run.config) | {TASK: run.task}
    paper = (run.config.get("task") or {}).get("paper") or {}
    for name, value in flatten(paper).items():
        key = f"budget.{name}"
        follows = name in OF_TASK or settings.get("budget.name") == PAPER
        if follows and settings.get(key) == value:
            settings[key] = PAPER

    return settings


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


def _describe(setting: Mapping[str, str], keys: Iterable[str]) -> list[str]:
    words = []
    for key in keys:
        name = key.removesuffix(".name")
        value = setting.get(key)
        words.append(short(f"no {name}" if value is None else f"{name}={value}"))

    return words
