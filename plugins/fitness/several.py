"""Score candidates by several trials, in one or more engines."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from core.interfaces import Score, Trial

Combine = Callable[[Sequence[float]], float]


def mean(rewards: Sequence[float]) -> float:
    """Compute the mean."""
    return float(np.mean(rewards))


def worst_quarter(rewards: Sequence[float]) -> float:
    """Compute the mean of the lowest quarter of rewards, of at least one."""
    return mean(sorted(rewards)[: math.ceil(len(rewards) / 4)])


def score_by_worst_engine(
    trials: Sequence[Trial],
    combine: Combine = mean,
    word: str = "change",
) -> Score:
    """Combine the rewards in each engine, and take the engine where that is the lowest.

    The trial that is shown is the one with the lowest reward of those that succeeded, of equal ones that with the least
    margin, in the worst engine if there is one there. Failures become warnings.

    Args:
        trials: of a candidate; one that was rejected or failed counts 0.
        combine: makes one number of an engine's rewards.
        word: what the warnings call a trial.
    """
    by_engine: dict[str, list[int]] = {}
    for number, trial in enumerate(trials):
        by_engine.setdefault(trial.engine, []).append(number)

    combined: dict[str, float] = {}
    for engine, numbers in by_engine.items():
        combined[engine] = combine([trials[number].reward for number in numbers])

    worst = min(combined, key=lambda engine: combined[engine])

    succeeded = [n for n, trial in enumerate(trials) if trial.status == "ok"]
    in_worst = [n for n in succeeded if trials[n].engine == worst]
    candidates = in_worst or succeeded or by_engine[worst][:1]
    shown = min(candidates, key=lambda n: (trials[n].reward, _least_margin(trials[n])))

    warnings: list[str] = []
    if trials[shown].status == "ok":
        warnings = _describe_failures(trials, by_engine, word)

    return Score(combined[worst], shown=shown, warnings=tuple(warnings))


def _least_margin(trial: Trial) -> float:
    return min((margin.margin for margin in trial.margins), default=np.inf)


def _describe_failures(
    trials: Sequence[Trial], by_engine: dict[str, list[int]], word: str
) -> list[str]:
    """Name the trials that were rejected or failed, each with its reason."""
    lines: list[str] = []
    for engine, numbers in by_engine.items():
        for place, number in enumerate(numbers, start=1):
            trial = trials[number]
            if trial.status == "ok":
                continue

            where = f"{engine}, {word} {place} of {len(numbers)}"
            lines.append(f"{where}: {trial.status}: {trial.reason}")

    return lines
