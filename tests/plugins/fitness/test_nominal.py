"""The reward of one rollout."""

import numpy as np
from omegaconf import OmegaConf

from core.config.compose import load, part
from core.design import Candidate, Tool
from core.interfaces import Condition, Score, Trial, Waypoints
from tests.playing import Named


def test_nominal_is_the_default_and_its_score_is_the_reward_of_its_only_trial():
    assert load("config", []).fitness == {"name": "nominal"}
    condition = Condition(Named(), Named())
    nominal = part("fitness", OmegaConf.create({"name": "nominal"})).create(
        condition=condition
    )
    assert nominal.conditions() == [condition]
    candidate = Candidate(Tool(), Waypoints(np.zeros((1, 6))))
    assert nominal.score(
        candidate, [Trial(condition.where, candidate.id, reward=0.4)]
    ) == Score(0.4)
