"""The last stage of a search: numbers of the best candidates are varied, without a model."""

import json
import re
from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest

from core.design import Candidate, Tool
from core.errors import UserError
from core.interfaces import Budget, Numbers, Waypoints
from core.plugins import installed
from core.search.experiment import Experiment
from core.search.orchestration import resume
from plugins.conformance.evaluations import tried_once
from plugins.strategies.refined.strategy import Refined

BUDGET = Budget(1, 3, 1, 0, 5, 0.0)
GOAL = np.array([0.3, -0.1, 0.2, 0.0, 0.0, 0.0])


class Plans:
    """A designer whose tools have plans of one waypoint, and what varies these."""

    assignment = None

    def __init__(self, offsets=(0.1, 0.2, 0.3, 0.4, 0.5)):
        self.offsets = offsets

    def design(self, generation, elites=()):
        for strategy, offset in enumerate(self.offsets):
            yield Candidate(
                Tool(name=str(strategy)), (GOAL + offset)[None], generation, 0, strategy
            )

    def parameters(self, candidate):
        return Numbers.near(candidate.plan.poses, 0.02, 3.0)

    def toward(self, candidate, other):
        return other.plan.poses.ravel() if self.offsets[other.design] < 0.35 else None

    def vary(self, candidate, values, key):
        generation, agent, number, action = key
        new = replace(candidate, plan=Waypoints(values[None]), parents=(candidate.id,))
        problem = "too far" if values[0] > 1 else None
        return replace(
            new,
            generation=generation,
            agent=agent,
            design=number,
            action=action,
            problem=problem,
        )


def earned(candidate):
    return float(np.exp(-np.abs(candidate.plan.poses[0] - GOAL).sum()))


def search(rollouts, designer=None, earns=earned):
    """The rewards of each generation, and the candidates' ids."""
    designer = designer or Plans()
    generations = []
    with patch("plugins.strategies.refined.strategy.Variation", lambda _: designer):
        strategy = Refined(designer, BUDGET, "sampling", rollouts)
    while strategy.has_generation(len(generations), BUDGET):
        candidates = list(strategy.ask())
        generations.append(
            [tried_once(c, "ok", reward=earns(c), distance_m=1.0) for c in candidates]
        )
        strategy.tell(generations[-1])
    return generations


def test_it_comes_close_to_the_best_numbers():
    generations = search(600)
    best = [max(e.reward for e in generation) for generation in generations]
    assert best[0] == pytest.approx(np.exp(-0.6))
    assert best[-1] > 0.9


def test_the_better_half_goes_on_and_all_rollouts_are_spent():
    generations = search(240)[1:]
    starts = [
        len({e.candidate.agent for e in generation}) for generation in generations
    ]
    assert starts[0] == 4
    assert starts[-1] == 1
    assert starts == sorted(starts, reverse=True)
    assert sum(map(len, generations)) == 240
    last = {e.candidate.agent for e in generations[-1]}
    assert {parent for e in generations[-1] for parent in e.candidate.parents} == {
        f"g0-a0-s{min(last)}-p0"
    }


def test_ids_are_new_and_the_same_again():
    first, again = (
        [
            (e.candidate.id, e.candidate.content, e.reward)
            for g in search(120)
            for e in g
        ]
        for _ in range(2)
    )
    assert first == again
    assert len({name for name, *_ in first}) == len(first)


def test_what_breaks_a_rule_is_drawn_again():
    near_the_limit = Plans(offsets=(0.69,))
    assert all(
        e.candidate.problem is None
        for generation in search(60, near_the_limit)[1:]
        for e in generation
    )


def test_nothing_is_refined_where_nothing_earned_anything():
    assert len(search(120, earns=lambda _: 0.0)) == 1


@pytest.mark.parametrize("rollouts", [1, 7, 13, 50, 130])
def test_any_number_of_rollouts_is_spent_and_begins_as_a_larger_one(rollouts):
    few, many = (
        [e.candidate.content for g in search(count)[1:] for e in g]
        for count in (rollouts, 240)
    )
    assert len(few) == rollouts
    assert few == many[:rollouts]


@pytest.mark.parametrize(
    ("rollouts", "wrong"),
    [
        (-1, "setting 'rollouts' can't be -1: must be greater than 0"),
        (0, "setting 'rollouts' can't be 0: must be greater than 0"),
        (12.5, "setting 'rollouts' can't be 12.5"),
        ("many", "setting 'rollouts' can't be 'many'"),
    ],
)
def test_rollouts_that_mean_nothing(rollouts, wrong):
    settings = {"rollouts": rollouts}
    with pytest.raises(UserError, match=re.escape(wrong)):
        installed().create(
            "evolution", "refined", settings, designer=Plans(), budget=BUDGET
        )


@pytest.mark.thorough
@pytest.mark.parametrize("action", ["waypoints", "anchored"])
def test_a_run_is_refined_alike_from_the_start_and_once_it_is_finished(
    tmp_path, action
):
    """With one worker, and with two."""
    words = [
        "task=BringCube",
        "sim=mujoco",
        f"action={action}",
        "evolution=sampling",
        "listener=[]",
        "film=false",
    ]
    words += [
        "budget=tiny",
        "budget.n_tool=2",
    ]
    whole = Experiment(*words, "evolution.refine=24", "executor.workers=1").run(
        tmp_path / "whole"
    )
    refined = [e.candidate for e in whole.generations[1].evaluations]
    assert all(candidate.parents and candidate.problem is None for candidate in refined)
    assert len({(c.tool.content, c.plan.content) for c in refined}) == len(refined)
    assert (
        min(
            len({c.tool.content for c in refined}),
            len({c.plan.content for c in refined}),
        )
        > 3
    )

    Experiment(*words, "executor.workers=2").run(tmp_path / "later")
    resume(tmp_path / "later", ["evolution.refine=5"])
    # The generation that was cut short goes on.
    resume(tmp_path / "later", ["evolution.refine=24"])
    stored = [
        json.loads((tmp_path / name / "result.json").read_text())
        for name in ("whole", "later")
    ]
    assert stored[0]["generations"] == stored[1]["generations"]
    assert stored[0]["best"] == stored[1]["best"]
    assert stored[0]["best"]["reward"] == pytest.approx(whole.best.reward)
