from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.scene import State
from tasks.bring_cube import TARGET, BringCube

TASK = BringCube()
BEFORE = TASK.scene(0).state()


def reward(*places, start=BEFORE):
    ends = [
        replace(start, positions=np.array([place], dtype=float)) for place in places
    ]
    return TASK.reward(State.stack([start] * len(ends)), State.stack(ends)).tolist()


@given(st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-1, 3)))
def test_the_reward_is_one_minus_the_sum_of_differences(place):
    due = 1 - np.abs(np.subtract(place, TARGET)).sum() / 0.4
    assert reward(place)[0] == pytest.approx(min(max(due, 0), 1), abs=1e-9)


def test_the_way_is_counted_from_where_the_cube_settled():
    settled = replace(BEFORE, positions=np.array([[1.4, 0, 0.035]]))
    assert reward((1.0, 0, 0.035), start=settled) == pytest.approx([0.5])
