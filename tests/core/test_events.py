from dataclasses import replace

import pytest

from core.events import Generation, Result
from core.trial import Tally, Trial, Where
from tests.support.evaluations import evaluation


def test_a_generation_counts_what_was_tried():
    tried = (
        evaluation(0, 0.2),
        evaluation(1, 0.6),
        evaluation(2, 0.0, "failed"),
        evaluation(3, 0.0, "rejected"),
    )
    generation = Generation(0, tried)
    assert generation.best is tried[1]
    assert generation.ranking == [tried[1], tried[0]]
    assert generation.mean_reward == pytest.approx(0.4)
    assert [generation.count(status) for status in ("ok", "failed", "rejected")] == [
        2,
        1,
        1,
    ]


def test_the_best_may_earn_less_than_the_highest_reward_by_the_tie():
    far, near = evaluation(0, 0.601, distance_m=3.0), evaluation(1, 0.6, distance_m=2.0)
    generation = Generation(0, (far, near), tie=0.005)
    assert (generation.best, generation.best_reward) == (near, 0.601)
    assert Generation(0, (far, near), tie=0.0).best is far


def test_a_generation_in_which_nothing_could_be_tried():
    generation = Generation(0, (evaluation(0, 0.0, "rejected"),))
    assert (generation.best, generation.best_reward, generation.mean_reward) == (
        None,
        None,
        None,
    )
    assert Result((generation,), 1.0).best is None


def test_a_result_is_of_all_generations():
    one = Generation(0, (evaluation(0, 0.7), evaluation(1, 0.0, "failed")))
    other = Generation(1, (evaluation(2, 0.5), evaluation(3, 0.0, "rejected")))
    result = Result((one, other), 1.0)
    assert result.best is one.best
    assert result.n_evaluations == 3


def test_rollouts_of_equal_candidates_count_once():
    one, same = evaluation(0, 0.7), evaluation(1, 0.7)
    same = replace(same, trials=one.trials)
    two_trials = tuple(
        Trial(Where("Task", "mujoco", layout), "g0-a2-s0-p0") for layout in range(2)
    )
    other = replace(evaluation(2, 0.7), trials=two_trials)
    assert (
        Result((Generation(0, (one, same)), Generation(1, (other,))), 1.0).rollouts == 3
    )
    assert Result((Generation(0, (same, one)),), 1.0).rollouts == 1


def test_rollouts_of_finals_count_for_each_task_of_a_layout():
    trials = [Trial(Where(task, "mujoco", 7), "g0-a0-s0-p0") for task in ("a", "b")]
    finals = Tally({0: tuple(trials)})
    finalist = replace(evaluation(0, 0.7), finals=finals)
    result = Result((Generation(0, (finalist,)),), 1.0, perturbed=finals)
    assert result.rollouts == 1 + 2 + 2
