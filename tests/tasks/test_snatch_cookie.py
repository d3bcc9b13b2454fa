"""The reward and the layouts of SnatchCookie."""

from dataclasses import replace

import numpy as np
import pytest

from core.scene import State
from tasks.snatch_cookie import JAR, THICKNESS, SnatchCookie
from tests.support.panda import on_panda

TASK = on_panda(SnatchCookie())
START = TASK.scene(0).state()


def moved(name, position):
    """The layout of seed 0 with one cookie elsewhere."""
    positions = START.positions.copy()
    positions[START.names.index(name)] = position
    return replace(START, positions=positions)


def lifted(name, to):
    """The layout of seed 0 with one cookie raised to a height."""
    here = START.position(name)
    return [
        moved(name, np.array([here[0], here[1], z]))
        for z in np.linspace(here[2], to, 60)
    ]


def rewards(ends):
    return TASK.reward(State.stack([START] * len(ends)), State.stack(ends))


@pytest.mark.parametrize("name", ["cookie_6", "cookie_12", "cookie_1"])
def test_the_reward_rises_from_0_to_1_while_a_cookie_is_lifted_out(name):
    reward = rewards(lifted(name, 0.31))
    assert reward[0] == 0.0
    assert reward[-1] == 1.0
    assert (np.diff(reward) >= 0).all()


@pytest.mark.parametrize(
    "where",
    [
        pytest.param((JAR[0] - 0.045, 0.0, 0.06), id="pressed down"),
        pytest.param((0.4, 0.3, THICKNESS / 2), id="on the table"),
        pytest.param((2.0, 1.0, -0.6), id="flung to the floor"),
    ],
)
def test_a_cookie_that_ends_low_earns_nothing(
    where,
):
    assert rewards([moved("cookie_6", np.array(where))])[0] == 0.0
