import numpy as np
import pytest

from core.design import Candidate, Evaluation, Tool
from core.errors import Fault, UserError
from core.interfaces import Fitness, Waypoints
from core.search.finalists import try_unseen
from plugins.executors.local import LocalExecutor

BEST = Evaluation(Candidate(Tool(), Waypoints(np.zeros((1, 6)))), "ok", reward=1.0)


class Trial:
    """A trial that earns so much, or raises."""

    def __init__(self, earns):
        self.earns = earns

    def __call__(self, candidates):
        if isinstance(self.earns, Exception):
            raise self.earns
        return [Evaluation(candidate, "ok", reward=self.earns) for candidate in candidates]


class Hidden(Fitness):
    """Unseen trials by engine."""

    def __init__(self, **trials):
        self.trials = {engine: [Trial(earns) for earns in of] for engine, of in trials.items()}

    def unseen(self):
        return self.trials

    def __call__(self, candidates):
        raise AssertionError("the search is over")


def earned(**trials):
    with LocalExecutor(workers=2) as executor:
        return try_unseen(BEST, Hidden(**trials), executor)[0]


def test_the_rewards_of_each_engine_in_order():
    assert earned(one=[0.5, 0.9, 0.7], other=[0.9, 0.0]) == {"one": (0.5, 0.9, 0.7), "other": (0.9, 0.0)}


def test_a_trial_that_fails_counts_0():
    assert earned(one=[0.5, ValueError("a bug")]) == {"one": (0.5, 0.0)}


def test_no_trials_no_rewards():
    assert earned() == {}


def test_a_fault_of_the_machine_is_reported():
    with pytest.raises(UserError, match="more layouts: no room"):
        earned(one=[0.5, Fault("no room")])
