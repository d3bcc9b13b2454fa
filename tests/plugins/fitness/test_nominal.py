"""The reward of one rollout."""

import numpy as np
import pytest
from omegaconf import OmegaConf

from core.config.compose import load, part
from core.design import Candidate, Tool
from core.errors import UsageError
from core.interfaces import Condition, Score, Trial, Waypoints
from core.plugins import FITNESS, installed
from plugins.fitness.perturbation_range import PerturbationRange
from plugins.fitness.robustness import Perturbation
from tests.support.playing import Named


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


def test_those_that_earn_alike_are_tried_in_as_many_changed_scenes_as_are_asked_for():
    condition = Condition(Named(), Named())
    for changes in (0, 3):
        settings = OmegaConf.create({"name": "nominal", "changes": changes})
        nominal = part("fitness", settings).create(condition=condition)
        assert nominal.conditions() == [condition]
        assert nominal.finals_check

        finals = [where for (where,) in nominal.finals()]
        assert [where.change for where in finals] == [
            Perturbation(PerturbationRange(), seed) for seed in range(changes)
        ]
        assert len({where.where for where in finals} | {condition.where}) == changes + 1

    with pytest.raises(UsageError, match="setting 'changes' can't be -1"):
        installed().create(FITNESS, "nominal", {"changes": -1}, condition=condition)
