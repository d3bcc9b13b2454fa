from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tasks.one_book import PULLED_OUT, OneBook

TASK = OneBook()
BEFORE = TASK.scene(0).state()


def reward(**shifts):
    """The reward of a world in which books have moved by (3,)."""
    positions = BEFORE.positions.copy()
    for name, shift in shifts.items():
        positions[BEFORE.names.index(name)] += shift
    return float(TASK.reward(BEFORE, replace(BEFORE, positions=positions)))


def test_pulled_out_far_enough():
    assert pytest.approx(np.hypot(0.14, 0.044)) == PULLED_OUT
    assert reward(book_3=(-0.15, 0, 0)) == 1
    assert reward(book_3=(0.15, 0, 0)) == 1  # any direction
    assert reward(book_3=(0, 0, 0.2)) == 1


def test_part_of_the_way():
    assert reward(book_3=(-0.07, 0, 0)) == pytest.approx(0.07 / PULLED_OUT)


@given(st.floats(0, 0.5))
def test_motion_of_the_others_is_subtracted(shift):
    due = np.exp(-2 * shift)
    assert reward(
        book_3=(-0.2, 0, 0), book_2=(shift, 0, 0), book_4=(0, 0, shift)
    ) == pytest.approx(due)
    partial = np.clip(0.1 / PULLED_OUT - (1 - due), 0, 1)
    assert reward(
        book_3=(0.1, 0, 0), book_1=(shift, 0, 0), book_5=(0, shift, 0)
    ) == pytest.approx(partial)
