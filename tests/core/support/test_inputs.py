"""What comes from outside is checked in one place, and what is wrong is said in one line."""

from dataclasses import dataclass
from typing import Annotated, Literal

import pytest
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from core.errors import UsageError
from core.support.inputs import (
    STRICT,
    check,
    check_plain,
    find_mistakes,
    in_unit,
    keys_at,
)

Length = Annotated[float, Field(gt=0, le=10), in_unit("it is in metres")]


class Part(BaseModel):
    model_config = STRICT

    size: tuple[Length, Length]
    color: Literal["red", "blue"] = "red"


class Thing(BaseModel):
    model_config = ConfigDict(extra="forbid")

    name: str
    parts: list[Part] = []
    named: dict[str, Part] = {}


@dataclass(frozen=True)
class Pair:
    one: int
    other: int = 0


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({}, "name: is missing; add it"),
        (
            {"name": 5},
            "name: must be a text; put it in quotes, got 5",
        ),
        (
            {"name": "a", "parts": 1},
            "parts: must be a list, such as [0, 0, 0.1], got 1",
        ),
        (
            {"name": "a", "parts": [{"size": (1, 50)}]},
            "parts.0.size.1: must be less than or equal to 10, got 50; it is in metres",
        ),
        (
            {"name": "a", "parts": [{"size": (1, "x")}]},
            "parts.0.size.1: must be a number, got 'x'",
        ),
        (
            {"parts": [{"color": "re"}], "parst": []},
            "parst: no key 'parst' (did you mean 'parts'?); "
            "possible: name, named, parts; missing: name",
        ),
        (
            {"name": "a", "named": {"b": {"sise": 1}}},
            "named.b.sise: no key 'sise' (did you mean 'size'?); "
            "possible: color, size; missing: size",
        ),
        ([1], "must be an object of keys and values, such as {radius: 0.1}"),
    ],
)
def test_what_is_wrong_is_said_with_its_place_and_the_words_to_type(given, said):
    with pytest.raises(UsageError) as refused:
        check(Thing, given, "the file", UsageError)
    assert str(refused.value) == f"the file: {said}"


def test_a_long_text_cut_by_and_stays_on_one_line():
    with pytest.raises(ValueError, match="must be a whole number, got") as refused:
        check(Pair, {"one": "a\n" * 1000})
    assert len(str(refused.value)) < 200
    assert "\n" not in str(refused.value)


def test_what_fits_is_returned_as_its_type_has_it():
    assert check(Pair, {"one": 1}) == Pair(1)
    assert check_plain(Part, {"size": [1, 2]}).size == (1, 2)


def test_a_type_with_notes_that_are_no_keys_is_checked_too():
    assert check(Annotated[int, {"unit": "m"}], 3) == 3


def test_keys_are_listed_at_any_depth():
    assert keys_at(Thing, ("parts", 0)) == ["color", "size"]
    assert keys_at(Thing, ("named", "a")) == ["color", "size"]
    assert keys_at(Thing, ("nothing",)) == []


def test_half_of_a_pair_is_no_text():
    with pytest.raises(ValidationError) as wrong:
        check_plain(Thing, {"name": "\ud800"})
    (mistake,) = find_mistakes(Thing, wrong.value)
    assert "no text" in str(mistake)
