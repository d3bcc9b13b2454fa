from dataclasses import replace

import numpy as np
import pytest

from core.scene import State
from tasks.clean_table import SIDE, CleanTable

TASK = CleanTable()
BEFORE = TASK.scene(0).state()
MIDDLE = np.array([1.1, 0.0, SIDE / 2])


def reward(*ends, start=BEFORE):
    """The reward for positions (8, 3) of the cubes."""
    states = [replace(start, positions=np.asarray(end, dtype=float)) for end in ends]
    return TASK.reward(State.stack([start] * len(states)), State.stack(states))


def test_each_cube_counts_an_eighth():
    end = BEFORE.positions.copy()
    for count in range(8):
        assert reward(end)[0] == pytest.approx(count / 8)
        end[count] = np.add(MIDDLE, (0.1, -0.1, 0))
    assert reward(end)[0] == 1


def test_inside_is_a_centimetre_more_than_the_circle():
    end = np.tile(MIDDLE, (8, 1))
    end[3] = np.add(MIDDLE, (0, 0.1599, 0))
    almost = end.copy()
    almost[3] = np.add(MIDDLE, (0, 0.1601, 0))
    whole = np.linalg.norm(BEFORE.positions[3] - MIDDLE)
    np.testing.assert_allclose(
        reward(end, almost), [1, 7 / 8 + (1 - 0.1601 / whole) / 8]
    )
