import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline, PchipInterpolator

from core.splines import Splines, place

counts = st.lists(st.integers(2, 40), min_size=1, max_size=6)


def knots_of(counts, seed):
    rng = np.random.default_rng(seed)
    return [rng.normal(size=(count, 7)) for count in counts]


def looked_at(curves, s):
    """All curves at the same s: one array each."""
    at = curves.places([place(len(knots), s) for knots in curves.knots])
    return (curves(at, derivative).reshape(len(curves.knots), len(s), -1) for derivative in (0, 1, 2))


@settings(max_examples=60)
@given(counts, st.integers(0, 2**32 - 1))
def test_each_is_scipys_spline_through_its_knots(counts, seed):
    s = np.append(np.random.default_rng(seed).uniform(0, 1, 20), [0.0, 1.0])
    knots = knots_of(counts, seed)
    for derivative, found in enumerate(looked_at(Splines(knots), s)):
        for own, curve in zip(knots, found, strict=True):
            expected = CubicSpline(np.linspace(0, 1, len(own)), own, axis=0)(s, derivative)
            np.testing.assert_allclose(curve, expected, rtol=1e-10, atol=1e-10 * len(own) ** derivative)


@pytest.mark.parametrize("number", range(4))
def test_one_is_restrained_and_the_others_are_not(number):
    knots = knots_of([2, 3, 9, 5], 0)
    s = np.linspace(0, 1, 50)
    curves = Splines(knots)
    before, *_ = looked_at(curves, s)
    curves.restrain(number)
    after, *_ = looked_at(curves, s)
    own = knots[number]
    np.testing.assert_allclose(
        after[number], PchipInterpolator(np.linspace(0, 1, len(own)), own, axis=0)(s), atol=1e-12
    )
    others = [i for i in range(4) if i != number]
    np.testing.assert_array_equal(after[others], before[others])


@pytest.mark.parametrize("count", [2, 3, 8])
def test_at_a_knot_begins_the_cell_after_it(count):
    cells, into = place(count, np.linspace(0, 1, count))
    assert cells.tolist() == [*range(count - 1), count - 2]
    np.testing.assert_array_equal(into[:-1], 0.0)
