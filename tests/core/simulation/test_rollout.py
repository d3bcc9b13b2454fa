"""How candidates become evaluations, with an engine that does what a test needs; real ones are in `tests/tasks`."""

import numpy as np
import pytest

from core.design import Candidate
from core.interfaces import Outcome, RolloutSettings
from core.plugins.blame import PluginError
from core.simulation.rollout import evaluate_batch, prepare
from tests.faults import Faulty, Slide, candidate

SETTINGS = RolloutSettings(settle_s=0, hold_s=0)


def evaluated(*candidates, task=None, simulator=None, settings=SETTINGS):
    return evaluate_batch(task or Slide(), simulator or Faulty(), candidates, 0, settings)


def test_what_breaks_a_rule_is_not_tried_and_the_order_is_kept():
    bad = Candidate(None, np.zeros((0, 6)), 0, 0, 9, 0, problem="no tool")
    first, rejected, last = evaluated(candidate(0), bad, candidate(1))
    assert (rejected.status, rejected.reason, rejected.reward) == ("rejected", "no tool", 0.0)
    assert [first.status, last.status] == ["ok", "ok"]
    assert [first.candidate.key, last.candidate.key] == [candidate(0).key, candidate(1).key]
    assert evaluated() == []
    with pytest.raises(ValueError, match="has no tool to try: no tool"):
        prepare(Slide(), bad, 0, SETTINGS)


def test_a_motion_that_takes_too_long_is_rejected():
    (evaluation,) = evaluated(candidate(0), settings=RolloutSettings(max_motion_s=0.1))
    assert evaluation.status == "rejected"
    assert "the motion takes" in evaluation.reason
    assert evaluation.reason.endswith("more than 0 s; use fewer waypoints")


class Lost(Faulty):
    def one(self, task, job):
        return Outcome(None, None, error=None)


def test_a_rollout_without_states_has_failed():
    (evaluation,) = evaluated(candidate(0), simulator=Lost())
    assert (evaluation.status, evaluation.reason) == ("failed", "the simulator returned no state")


class Generous(Slide):
    def reward(self, start, end):
        return 2 + super().reward(start, end)


def test_a_reward_outside_0_and_1_has_failed():
    (evaluation,) = evaluated(candidate(0), task=Generous())
    assert (evaluation.status, evaluation.reward) == ("failed", 0.0)
    assert evaluation.reason.startswith("task Slide: the reward 2.")


class Single(Slide):
    def reward(self, start, end):
        return 0.5


def test_a_reward_that_is_not_one_per_world_names_the_task():
    with pytest.raises(PluginError, match=r"reward gave an array of shape \(\) for 2 worlds; expected \(2,\)"):
        evaluated(candidate(0), candidate(1), task=Single())


def test_rewards_and_shifts_are_those_of_each_candidate():
    together = evaluated(candidate(0), candidate(30))
    alone = [*evaluated(candidate(0)), *evaluated(candidate(30))]
    assert [e.reward for e in together] == [e.reward for e in alone]
    assert together[0].reward != together[1].reward
    for evaluation in together:
        assert evaluation.moved_m["block"] == pytest.approx(evaluation.reward)
