"""How far from a limit."""

import math

import pytest

from core.values.margins import FAR_M, Margin, least_first


@pytest.mark.parametrize(
    ("made", "margin"),
    [
        (Margin.at_most("force", 5, 20, "N"), 0.75),
        (Margin.at_most("force", 20, 20, "N"), 0.0),
        (Margin.at_most("force", 500, 20, "N"), -1.0),
        (Margin.at_least("angle", 0.95, 0.9, "rad", 0.1), 0.5),
        (Margin.at_least("angle", 0.85, 0.9, "rad", 0.1), -0.5),
        (Margin.clearance("vase", FAR_M / 4), 0.25),
        (Margin.clearance("vase", 3.0), 1.0),
        (Margin.clearance("vase", 0.0), -1.0),
    ],
)
def test_1_is_far_0_is_at_the_limit_and_below_0_it_failed(made, margin):
    assert made.margin == pytest.approx(margin)


def test_the_least_comes_first_and_what_is_no_number_is_left_out():
    near, far, none = (
        Margin.at_most("x", value, 1, "m") for value in (0.9, 0.1, math.nan)
    )
    assert least_first([far, none, near]) == (near, far)
    assert str(near) == "x 0.9 m, limit 1 m"


def test_a_value_just_beyond_its_limit_does_not_read_as_the_limit():
    assert str(Margin.at_most("force", 15.02, 15, "N")) == "force 15.02 N, limit 15 N"
    assert str(Margin.at_most("force", 22.41, 15, "N")) == "force 22.4 N, limit 15 N"
    assert str(Margin.at_most("force", 15, 15, "N")) == "force 15 N, limit 15 N"
