"""The reward of one rollout."""

from itertools import islice

import numpy as np
from omegaconf import OmegaConf

from core.config.compose import load, part
from core.design import Candidate, Tool
from core.interfaces import Condition, Score, Trial, Waypoints
from plugins.fitness.robustness import Perturbation, PerturbationRange
from tests.playing import Named


def test_nominal_is_the_default_and_its_score_is_the_reward_of_its_only_trial():
    assert load("config", []).fitness.name == "nominal"
    condition = Condition(Named(), Named())
    nominal = part("fitness", OmegaConf.create({"name": "nominal"})).create(
        condition=condition
    )
    assert nominal.conditions() == [condition]
    candidate = Candidate(Tool(), Waypoints(np.zeros((1, 6))))
    assert nominal.score(
        candidate, [Trial(condition.where, candidate.id, reward=0.4)]
    ) == Score(0.4)
    assert not list(nominal.finals())


def test_with_changes_those_that_earn_alike_are_tried_in_one_changed_scene_after_the_other():
    condition = Condition(Named(), Named())
    nominal = part(
        "fitness", OmegaConf.create({"name": "nominal", "changes": True})
    ).create(condition=condition)
    assert nominal.conditions() == [condition]

    finals = [where for (where,) in islice(nominal.finals(), 3)]
    assert [where.change for where in finals] == [
        Perturbation(PerturbationRange(), seed) for seed in range(3)
    ]
    assert len({where.where for where in finals} | {condition.where}) == 4
