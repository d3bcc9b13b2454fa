import numpy as np
import pytest
import scipy.stats

from plugins.results.report import statistics
from plugins.results.report.statistics import interquartile_mean, interval

# Twelve tasks of five runs, and what rliable 1.2.0 says of them: aggregate_iqm, aggregate_mean, and
# get_interval_estimates with 50,000 repetitions from RandomState(0).
SCORES = [
    [0.808, 0.43, 0.664, 0.734, 0.671],
    [0.683, 0.705, 0.953, 0.713, 0.755],
    [0.58, 0.773, 0.838, 0.876, 0.584],
    [0.772, 0.625, 0.819, 0.584, 0.77],
    [0.967, 0.94, 0.817, 0.698, 0.825],
    [0.515, 0.417, 0.876, 0.813, 0.97],
    [0.97, 0.875, 0.307, 0.825, 0.49],
    [0.904, 0.907, 0.707, 0.705, 0.897],
    [0.44, 0.929, 0.981, 0.846, 0.819],
    [0.728, 0.552, 0.901, 0.713, 0.806],
    [0.973, 0.634, 0.751, 0.899, 0.346],
    [0.395, 0.752, 0.919, 0.859, 0.534],
]
RLIABLE = {
    "interquartile mean": (0.77066667, 0.72203333, 0.8108),
    "mean": (0.74231667, 0.70048292, 0.78258333),
}


def test_the_interquartile_mean_is_rliables():
    pooled = [score for task in SCORES for score in task]
    assert interquartile_mean(pooled) == pytest.approx(
        RLIABLE["interquartile mean"][0], abs=1e-8
    )


@pytest.mark.parametrize("statistic", ["mean", "interquartile mean"])
def test_stratified_intervals_are_rliables(statistic, monkeypatch):
    monkeypatch.setattr(statistics, "RESAMPLES", 20_000)
    low, high = interval(SCORES, statistic)
    assert (low, high) == interval(SCORES, statistic)
    # Of 50,000 samples of theirs, 20,000 of ours.
    assert low == pytest.approx(RLIABLE[statistic][1], abs=0.002)
    assert high == pytest.approx(RLIABLE[statistic][2], abs=0.002)


def test_an_interval_is_resampled_within_each_task():
    """Tasks that differ a lot, runs that don't: drawn over all runs at once, the interval would be wide."""
    tasks = [[0.1, 0.1, 0.1], [0.9, 0.9, 0.9]]
    assert interval(tasks, "mean") == (0.5, 0.5)
    loose = scipy.stats.bootstrap(
        [np.concatenate(tasks)], np.mean, method="percentile", rng=0
    ).confidence_interval
    assert loose.high - loose.low > 0.4
