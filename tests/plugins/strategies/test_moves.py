"""Random moves of the numbers of a design."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.interfaces import Numbers
from plugins.strategies.refined.moves import move

TABLES = Numbers.near(
    np.zeros((5, 3)), np.array([0.01, 0.01, 0.05]), 0.4
) + Numbers.near(np.zeros(2), 0.1, 1.0)


@given(seed=st.integers(0, 2**32 - 1))
def test_a_move_shifts_one_coordinate_of_neighbouring_points(seed):
    moved = (
        move(TABLES, TABLES.values, np.empty(0), np.random.default_rng(seed))
        / TABLES.steps
    )
    changed = np.flatnonzero(moved)
    assert len({*np.round(moved[changed], 9)}) == 1 or np.abs(
        moved
    ).max() == pytest.approx(8)  # cut off at the bound
    assert (
        0.2 - 1e-9 <= np.abs(moved[changed]).min() <= np.abs(moved).max() <= 10 + 1e-9
    )
    assert {*np.diff(changed)} <= {3}
    assert changed[-1] < 15 or len(changed) == 1


@given(seed=st.integers(0, 2**32 - 1))
def test_a_move_goes_toward_another_design_in_whole_points(seed):
    other = np.linspace(0.01, 0.17, 17)
    moved = move(TABLES, TABLES.values, other[None], np.random.default_rng(seed))
    changed = np.flatnonzero(moved)
    if len({*np.round((moved / other)[changed], 9)}) == 1 and len(changed) > 1:
        assert {*np.diff(changed)} == {1}
        assert (changed[0] % 3, len(changed) % 3) == (0, 0) or {*changed} == {15, 16}


def test_moves_keep_within_the_bounds_and_reach_all_numbers():
    rng = np.random.default_rng(0)
    values = TABLES.values
    seen = np.zeros(len(TABLES), dtype=bool)
    for _ in range(300):
        values = move(TABLES, values, np.full((1, len(TABLES)), 5.0), rng)
        assert (TABLES.lower <= values).all()
        assert (values <= TABLES.upper).all()
        seen |= values != 0
    assert seen.all()
    assert (TABLES.values == 0).all()
