from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.scene import State
from tasks.bring_cube import SIDE, START, TARGET, BringCube

TASK = BringCube()
BEFORE = TASK.scene(0).state()


def reward(*places, start=BEFORE):
    ends = [replace(start, positions=np.array([place], dtype=float)) for place in places]
    return TASK.reward(State.stack([start] * len(ends)), State.stack(ends)).tolist()


def test_the_scene():
    cube = TASK.scene(0)["cube"]
    assert cube.mass == 1
    assert cube.collisions[0].shape.size == (0.07, 0.07, 0.07)
    np.testing.assert_allclose(cube.pose.position, [1.0, 0, 0.035])
    np.testing.assert_allclose(TASK.scene(0)["mark"].pose.position, [0.6, 0, 0])
    assert (START, TARGET, SIDE) == ((1.0, 0.0, 0.035), (0.6, 0.0, 0.035), 0.07)


def test_the_reward_is_the_fraction_of_the_way():
    x = [1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4]
    np.testing.assert_allclose(reward(*[(at, 0, 0.035) for at in x]), [0, 0.25, 0.5, 0.75, 1, 0.75, 0.5], atol=1e-12)


def test_a_miss_to_the_side_or_in_height_counts_as_much():
    np.testing.assert_allclose(reward((0.6, 0.1, 0.035), (0.6, -0.1, 0.035), (0.6, 0, 0.135)), [0.75] * 3)


@pytest.mark.parametrize(
    "place", [(1.2, 0, 0.035), (1.0, 0.3, 0.035), (1.0, 0, 0.4), (2.0, 0.5, -0.6), (0.6, 0.2, -0.6)]
)
def test_a_cube_thrown_away_earns_nothing(place):
    assert reward(place) == [0]


@given(st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-1, 3)))
def test_the_reward_is_one_minus_the_sum_of_differences(place):
    due = 1 - np.abs(np.subtract(place, TARGET)).sum() / 0.4
    assert reward(place)[0] == pytest.approx(min(max(due, 0), 1), abs=1e-9)


def test_the_way_is_counted_from_where_the_cube_settled():
    settled = replace(BEFORE, positions=np.array([[1.4, 0, 0.035]]))
    assert reward((1.0, 0, 0.035), start=settled) == pytest.approx([0.5])
