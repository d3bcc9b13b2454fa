"""What is possible and hardly meant, for arms and scenes alike."""

import pytest

from core.values.warnings import USUAL, find_warning


@pytest.mark.parametrize(
    ("quantity", "value", "line"),
    [
        ("body mass", 250, "it weighs 250 kg; grams?"),
        ("body mass", 1e-6, "it weighs 1e-06 kg; grams?"),
        ("link mass", 1e5, "it weighs 100000 kg; grams?"),
        ("length", 10, "it is 10 m long; millimetres?"),
        ("range", 332, "it ranges over 332 rad; degrees?"),
    ],
)
def test_a_value_that_is_hardly_meant_is_said(quantity, value, line):
    (said,) = find_warning("it", quantity, value)
    assert said.startswith(line)


@pytest.mark.parametrize("quantity", USUAL)
def test_usual_values_bring_no_warning(quantity):
    least, most, *_ = USUAL[quantity]
    for value in (least, (least + most) / 2, most):
        assert not list(find_warning("it", quantity, value))
