"""The reward of HighObject."""

from dataclasses import replace

import numpy as np
import pytest

from core.scene import State
from core.task import margins_of
from tasks.high_object import BIN_CENTER, START, HighObject

TASK = HighObject()


def rewards(positions):
    """The rewards (N,) for positions (N, 3) of the cube."""
    start = TASK.scene(0).state()
    ends = [replace(start, positions=position[None]) for position in positions]
    return TASK.reward(State.stack([start] * len(ends)), State.stack(ends))


def test_the_reward_rises_from_0_to_1_on_the_way_into_the_bin():
    way = np.linspace((*START, 0.925), BIN_CENTER, 101)
    reward = rewards(way)
    assert reward[0] == 0.0
    assert reward[-1] == 1.0
    assert (np.diff(reward) >= 0).all()
    assert 0.1 < reward[30] < 0.9


@pytest.mark.parametrize(
    ("where", "inside"),
    [
        pytest.param((0.65, 0.55, 0.04), True, id="in a corner of the bin"),
        pytest.param((0.8, 0.0, 0.5), False, id="high above the bin"),
        pytest.param((1.2, 0.0, 0.475), False, id="on the lower board"),
        pytest.param((1.3, 0.0, 0.025), False, id="on the floor below the shelf"),
    ],
)
def test_only_a_cube_inside_the_bin_earns_everything(where, inside):
    assert (rewards(np.array([where]))[0] == 1.0) == inside
    start = TASK.scene(0).state()
    end = replace(start, positions=np.array([where]))
    earned = float(rewards(np.array([where]))[0])
    assert (margins_of(TASK, start, end, None, earned)[0].margin > 0) == inside
