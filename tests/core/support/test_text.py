import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.support.text import clean, kind, short_number, short_numbers, shorten


def test_clean_keeps_what_can_be_printed():
    assert clean("a\tb\n c", 10) == "a b c"
    assert clean("a\x1bb\u202ec", 10) == "abc"
    assert clean("one\r\n\ntwo\u2029three", 99, lines=True) == "one\ntwo\nthree"
    assert clean("x" * 300, 200) == "x" * 197 + "..."


@given(st.text(), st.integers(3, 50), st.booleans())
def test_any_text_becomes_printable_and_short(text, longest, lines):
    cleaned = clean(text, longest, lines=lines)
    assert len(cleaned) <= longest
    assert all(
        character.isprintable() or (lines and character == "\n")
        for character in cleaned
    )


@pytest.mark.parametrize(
    ("value", "name"),
    [
        ({}, "an object"),
        ([], "a list"),
        (True, "a boolean"),
        (None, "null"),
        (0.5, "a number"),
        ("\x1b[2J", r"the text '\x1b[2J'"),
        ((), "a tuple"),
    ],
)
def test_json_values_have_names(value, name):
    assert kind(value) == name


def test_long_text_cut_by():
    assert shorten("a" * 40) == repr("a" * 40)
    assert shorten("a" * 41) == repr("a" * 37 + "...")


def test_numbers_are_short_and_never_minus_zero():
    assert short_number(-0.0001, 3) == "0"
    assert short_numbers((1.0, -0.25, 0.12346), 4, ", ") == "1, -0.25, 0.1235"
