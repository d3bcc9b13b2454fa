"""Statistics of several runs, with confidence intervals.

The interquartile mean and its stratified bootstrap interval are those of R. Agarwal et al., "Deep Reinforcement
Learning at the Edge of the Statistical Precipice", NeurIPS 2021 (the package rliable): the mean of the middle half of
all runs of all tasks, and percentiles of the same over runs drawn anew, with replacement, within each task.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Literal, TypeVar

import numpy as np
import scipy.stats

from core.geometry import Array

Statistic = Literal["mean", "interquartile mean"]

CONFIDENCE = 0.95  # of the bootstrap intervals
RESAMPLES = 10_000
_BATCH = 1000  # resamples in memory at a time


def deviation(values: Sequence[float]) -> float | None:
    """The sample standard deviation (n - 1); None for fewer than two values."""
    if len(values) < 2:
        return None

    return float(np.std(values, ddof=1))


def interquartile_mean(values: Sequence[float] | Array) -> float:
    """The mean of the middle half: a quarter of the values is cut off at each end, rounded down."""
    return float(_mean_of_middle_half(np.asarray(values), axis=0))


def interval(
    tasks: Sequence[Sequence[float] | Array], statistic: Statistic
) -> tuple[float, float] | None:
    """The percentile interval of a statistic over the runs of several tasks, resampled within each task.

    Args:
        tasks: the runs' scores, by task.
        statistic: ``mean`` is that over tasks of each task's over runs, ``interquartile mean`` that of all runs.

    Returns:
        Low and high; None if a task has one run only, so that its deviation is unknown.
    """
    if not tasks or any(len(runs) < 2 for runs in tasks):
        return None

    result = scipy.stats.bootstrap(
        [np.asarray(runs, dtype=np.float64) for runs in tasks],
        _STATISTICS[statistic],
        n_resamples=RESAMPLES,
        batch=_BATCH,
        vectorized=True,
        paired=False,
        confidence_level=CONFIDENCE,
        method="percentile",
        rng=np.random.default_rng(0),
    )
    low, high = result.confidence_interval
    return float(low), float(high)


def _mean_of_tasks(*tasks: Array, axis: int) -> Array:
    means = [np.mean(runs, axis=axis) for runs in tasks]
    return np.asarray(np.mean(means, axis=0))


def _mean_of_middle_half(*tasks: Array, axis: int) -> Array:
    runs = np.concatenate(tasks, axis=axis)
    return np.asarray(scipy.stats.trim_mean(runs, 0.25, axis=axis))


_STATISTICS: dict[Statistic, Callable[..., Array]] = {
    "mean": _mean_of_tasks,
    "interquartile mean": _mean_of_middle_half,
}


N = TypeVar("N", int, float)


def over_known(
    function: Callable[[list[N]], N], values: Iterable[N | None]
) -> N | None:
    """``function`` of the values that are known, None where none is."""
    known = [value for value in values if value is not None]
    return function(known) if known else None
