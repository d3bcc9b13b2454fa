"""Candidates that stop early: the reward that is certain, what is said of it, and who wins."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.design import SAVED, STOPPED, Candidate, Evaluation, Tool, best_first
from core.errors import UsageError
from core.simulation.rollout import Evaluator, Part
from core.simulation.staging import Stops, foreseeing, try_in_turn
from plugins.fitness.layouts.fitness import COMBINE

EVALUATOR = Evaluator(Part("task", "BringCube"), Part("sim", "mujoco"))


def candidates(count):
    return [Candidate(Tool(), np.zeros((1, 6)), action=number) for number in range(count)]


def table(rewards, calls=None):
    """Evaluators for rewards by engine, trial and candidate; ``calls`` notes how many candidates each got."""

    def evaluator(of):
        def evaluate(chunk):
            if calls is not None:
                calls.append(len(chunk))
            return [Evaluation(c, "ok", of[c.action], distance_m=1.0) for c in chunk]

        return evaluate

    return {engine: [evaluator(of) for of in trials] for engine, trials in rewards.items()}


def staged(rewards, combine="mean", calls=None, **stops):
    count = len(next(iter(rewards.values()))[0])
    tried = try_in_turn(candidates(count), table(rewards, calls), COMBINE[combine][0], Stops(**stops))
    return [of.combined(COMBINE[combine][0], "layout") for of in tried]


def test_it_stops_as_soon_as_it_cannot_exceed_the_threshold():
    calls = []
    good, poor = staged({"a": [[1.0, 0.1], [1.0, 0.0], [1.0, 0.9], [0.0, 1.0]]}, calls=calls, below=0.6)
    assert calls == [2, 2, 1, 1]
    assert (good.reward, good.stopped, good.warnings) == (0.75, False, ())
    assert SAVED not in good.details
    assert poor.reward == pytest.approx(0.1 / 4)
    assert poor.details[STOPPED] == {"after": 2, "of": 4}
    assert poor.details[SAVED]["rollouts"] == 2
    assert poor.warnings == (
        "stopped after 2 of 4 layouts: it can't earn more than 0.525 any more, and fitness.stop_below is 0.6",
    )


def test_an_engine_that_it_does_not_come_to_counts_nothing():
    (found,) = staged({"a": [[0.2], [0.4]], "b": [[1.0], [1.0]]}, below=0.3)
    assert (found.reward, found.details[STOPPED]) == (0.0, {"after": 2, "of": 4})
    assert list(found.details["engines"]) == ["a"]


def test_it_stops_after_a_first_trial_that_earned_too_little():
    calls = []
    missed, hit = staged({"a": [[0.0, 0.1], [1.0, 0.0]]}, calls=calls, first=0.0)
    assert calls == [2, 1]
    assert (missed.reward, missed.stopped, hit.reward, hit.stopped) == (0.0, True, 0.05, False)
    assert missed.warnings == ("stopped after 1 of 2 layouts: it earned 0 in the first, and fitness.stop_first is 0",)
    assert staged({"a": [[0.0], [1.0]]}, first=None)[0].reward == 0.5


REWARDS = st.lists(st.lists(st.floats(0, 1), min_size=4, max_size=4), min_size=1, max_size=4)


@given(one=REWARDS, other=REWARDS, below=st.floats(0, 0.99), combine=st.sampled_from(list(COMBINE)))
def test_the_threshold_changes_nothing_of_what_exceeds_it(one, other, below, combine):
    rewards = {"a": one, "b": other}
    full, found = staged(rewards, combine), staged(rewards, combine, below=below)
    for whole, part in zip(full, found, strict=True):
        if part.stopped:
            assert part.reward <= whole.reward <= below + 1e-6
        else:
            assert (part.reward, part.details) == (whole.reward, whole.details)
    best = best_first(full)[0]
    if best_first(full, tie=0.0)[0].reward - 0.005 > below:
        assert best_first(found)[0].candidate.id == best.candidate.id
    kinds = [e.stopped for e in best_first(found)]
    assert kinds == sorted(kinds)  # none that stopped comes before one that did not


def test_no_candidates_and_all_stopped():
    assert try_in_turn([], table({"a": [[]]}), np.mean, Stops()) == []
    calls = []
    assert all(e.stopped for e in staged({"a": [[0.0, 0.0], [1.0, 1.0]]}, calls=calls, first=0.5))
    assert calls == [2]


@pytest.mark.parametrize("settings", [{"below": 1.0}, {"below": -0.1}, {"first": float("nan")}])
def test_a_wrong_threshold_is_reported(settings):
    with pytest.raises(UsageError, match=r"fitness.stop_(below|first) must be null, or from 0 to below 1, got"):
        Stops(**settings)


def test_a_clearance_that_is_too_small_is_reported():
    with pytest.raises(UsageError, match=r"fitness.clearance must be null, or at least 0.02 m, got 0.01"):
        foreseeing(EVALUATOR, 0.01)
    assert foreseeing(EVALUATOR, 0.05).clearance == 0.05


def test_the_prompt_says_when_a_plan_is_given_up():
    assert Stops().instructions() == ""
    said = Stops(0.5, 0.0).instructions()
    assert "as soon as it can't earn more than 0.5 any more, or after the first trial, if that earned no more" in said
