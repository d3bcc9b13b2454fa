import numpy as np
import pytest

from core.design import Candidate, Tool
from core.errors import Fault, UserError
from core.interfaces import Condition, Fitness, Trial, Waypoints
from core.search.finalists import try_unseen
from core.search.trials import Trials
from plugins.conformance.evaluations import tried_once
from tests.support.executors import Inline
from tests.support.playing import Named

BEST = tried_once(Candidate(Tool(), Waypoints(np.zeros((1, 6)))), "ok", reward=1.0)


class Hidden(Fitness):
    """Unseen layouts by engine."""

    def __init__(self, **rewards):
        self.rewards_in = rewards

    def conditions(self):
        raise AssertionError("the search is over")

    def score(self, candidate, trials):
        raise AssertionError("the search is over")

    def unseen(self):
        return [
            Condition(Named(), Named(engine), layout)
            for engine, rewards in self.rewards_in.items()
            for layout in range(len(rewards))
        ]


def earned(**rewards):
    def play(condition, candidates):
        earns = rewards[condition.where.engine][condition.layout]
        if isinstance(earns, Exception):
            raise earns
        return [
            Trial(condition.where, candidate.id, "ok", earns)
            for candidate in candidates
        ]

    fitness = Hidden(**rewards)
    trials = Trials(Inline(), play=play)
    return fitness.rewards(try_unseen(BEST.candidate, fitness, trials))


def test_the_rewards_of_each_engine_in_order():
    assert earned(one=[0.5, 0.9, 0.7], other=[0.9, 0.0]) == {
        "one": (0.5, 0.9, 0.7),
        "other": (0.9, 0.0),
    }


def test_a_trial_that_fails_counts_0():
    assert earned(one=[0.5, ValueError("a bug")]) == {"one": (0.5, 0.0)}


def test_no_trials_no_rewards():
    assert earned() == {}


def test_a_fault_of_the_machine_is_reported():
    with pytest.raises(UserError, match="fault of the machine"):
        earned(one=[0.5, Fault("no room")])
