"""The fitness of what holds: the effort that it saves."""

import numpy as np
import pytest
from omegaconf import OmegaConf

from core.config.compose import load, part
from core.errors import UserError
from core.interfaces import Trial
from tests.plugins.fitness.judging import judged
from tests.support.conditions import STAY, WIDE

NUMBERS = {"BringCube": [4.0, 0.005, None]}


def fitness(references=NUMBERS, **settings):
    config = {"name": "lean", "references": references, "layouts": 1, **settings}
    return part("fitness", OmegaConf.create(config)).create(condition=WIDE)


def score(reward, seconds):
    """Score a candidate whose only trial earns so much in so many seconds."""
    trial = Trial(
        WIDE.where,
        STAY.id,
        reward=reward,
        solved=reward >= 0.95,
        measured={"motion_s": seconds},
    )
    return fitness().score(STAY, [trial])


def test_what_holds_earns_by_its_effort_and_more_than_what_does_not():
    failed = [score(reward, 0.1).reward for reward in (0.0, 0.5, 0.94)]
    held = [score(0.96, seconds).reward for seconds in (1000.0, 8.0, 4.0, 1.0)]
    assert failed == pytest.approx([0, 0.25, 0.47])
    assert held[2] == pytest.approx(0.75)  # the reference
    assert all(np.diff([*failed, *held]) > 0)
    assert held[-1] < 1
    assert score(1.0, 4.0).figures == {"lean": 1.0, "motion_s": 4.0, "mass_kg": 0.005}


def test_a_trial_says_its_time_and_the_prompt_what_it_is_compared_with():
    assert judged(fitness(), STAY)[0].trials[0].motion_s > 0
    assert "takes 4 s and has a tool of 5 g." in fitness().instructions()


@pytest.mark.parametrize(
    ("references", "said"),
    [
        (
            {},
            r"no reference for BringCube; add \[SECONDS, KILOGRAMS, MARGIN\], as in \+fitness.references.BringCube=",
        ),
        ({"BringCube": [4.0]}, "fitness.references.BringCube must be"),
        (
            {"BringCube": [-4.0, 1.0, None]},
            "an effort has finite numbers from 0 on, got -4",
        ),
    ],
)
def test_a_reference_that_is_missing_or_wrong_is_reported(references, said):
    with pytest.raises(UserError, match=said):
        fitness(references)


def test_the_protocol_composes():
    config = load("config", ["protocol=lean", "task=InsertPlug"])
    assert (config.fitness.name, config.fitness.unseen, config.action.name) == (
        "lean",
        20,
        "anchored",
    )
