"""Time, mass and margin: what is saved against a reference."""

import math
from dataclasses import replace

import pytest

from core.values.efforts import Effort, holds

REFERENCE = Effort(8.0, 0.2, 0.4)


def test_the_reference_scores_1_and_there_is_no_upper_bound():
    assert REFERENCE.saved(REFERENCE) == 1
    assert Effort(4.0, 0.1, 0.9).saved(REFERENCE) == pytest.approx(2)
    assert Effort(8.0, 0.2, 0.0).saved(REFERENCE) == pytest.approx(0.2 ** (1 / 3))
    assert replace(REFERENCE, motion_s=0.8, mass_kg=0.002).saved(
        REFERENCE
    ) == pytest.approx(10)
    assert math.isfinite(Effort(0.0, 0.0, 0.4).saved(REFERENCE))  # the bare hand
    assert Effort(8.0, 0.2).saved(REFERENCE) == 1  # a task that says no margins


def test_a_mean_that_is_the_limit_but_for_rounding_holds():
    assert sum([0.95] * 12) / 12 < 0.95
    assert holds(sum([0.95] * 12) / 12)
    assert not holds(0.9499)


@pytest.mark.parametrize(
    "numbers", [(-1.0, 0.2), (math.nan, 0.2), (1.0, math.inf), (1.0, 0.2, 1.5)]
)
def test_what_is_no_effort(numbers):
    with pytest.raises(ValueError, match=r"an effort has finite|at most 1"):
        Effort(*numbers)
