"""Templates of prose: filled in by name, with numbers in short."""

import jinja2
import pytest

from core.support.templates import fill, macros

GIVEN = {"draws": 3, "sims": ["a", "b"]}


class Most:
    position, yaw, mass, friction = 0.0051234567, 1 / 3, 0.1, 0.25


def test_a_template_of_a_package_is_filled_in_with_numbers_of_six_digits():
    text = fill("plugins.fitness", "robust", **GIVEN, most=Most)
    assert "3 times in each of the engines a, b" in text
    assert "up to 0.00512346 m along x" in text
    assert "up to 0.333333 rad about z, masses differ by up to 10%" in text


def test_what_is_not_given_is_an_error():
    with pytest.raises(jinja2.UndefinedError, match="most"):
        fill("plugins.fitness", "robust", **GIVEN)


def test_macros_of_a_template_are_functions():
    words = macros("plugins.vlms.context", "bodies")
    assert words.place(1 / 3) == "33 %"
    assert words.weight(0.1) == "light"
