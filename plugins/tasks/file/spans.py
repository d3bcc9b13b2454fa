"""Read spans of a scene file: a number, ``"> 0.3"``, ``"< 0.3"``, or ``[0.2, 0.4]``."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Annotated, Any

from pydantic import GetPydanticSchema, WithJsonSchema
from pydantic_core import core_schema

from core.goals import Span

LARGEST = 1e4
MAX_SETS = 256  # values of a number, one for a layout
_BOUND = re.compile(r"\s*([<>])=?\s*([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?)\s*")
_FORMS = 'must be a number, "> 0.3", "< 0.3", or [0.2, 0.4] (the lowest and the highest, null: no limit)'

_OFF = re.compile(r"\s*\+-\s*([0-9.]+(?:[eE][-+]?[0-9]+)?)\s*")
_RANGES = (
    "must be a list, such as [0.1, 0.2] (the lowest and the highest), "
    'or "+-0.01", how far it may be off'
)


def read_span(given: Any) -> Span | float | None:
    """Read a span; a number stays one, and null is none.

    Raises:
        ValueError: it is none of these.
    """
    if given is None or _is_number(given):
        return None if given is None else float(given)
    if isinstance(given, Span):
        return given

    if isinstance(given, str):
        found = _BOUND.fullmatch(given)
        if found and found[1] == ">":
            return Span(low=_read_number(found[2]))
        if found:
            return Span(high=_read_number(found[2]))

    if isinstance(given, list | tuple) and len(given) == 2:
        ends = [end for end in given if end is not None]
        if all(map(_is_number, ends)):
            low, high = given
            if low == high is not None:
                raise ValueError(
                    f"nothing gets to [{low:g}, {high:g}] exactly; write {low:g}, which has a tolerance"
                )
            return Span(
                -math.inf if low is None else low, math.inf if high is None else high
            )

    raise ValueError(_FORMS)


def read_least(given: Any) -> Span | None:
    """Read a span; a number alone is the least.

    Raises:
        ValueError: it is none.
    """
    found = read_span(given)
    if isinstance(found, float):
        return Span(low=found)

    return found


def read_range(given: Any) -> tuple[float, ...] | float:
    """Read what a number may vary by: a range, the values of layouts, or how far it may be off.

    Raises:
        ValueError: it is neither.
    """
    if isinstance(given, str):
        found = _OFF.fullmatch(given)
        if found and _read_number(found[1]) > 0:
            return _read_number(found[1])

    several = isinstance(given, list | tuple) and 2 <= len(given) <= MAX_SETS
    if several and all(map(_is_finite, given)):
        return tuple(map(float, given))

    raise ValueError(_RANGES)


def _read_number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError(_FORMS) from None


def _is_finite(given: Any) -> bool:
    """Report whether it is a number; what a body's field may be at most is asked of its layouts."""
    is_number = isinstance(given, int | float) and not isinstance(given, bool)
    return is_number and math.isfinite(given)


def _is_number(given: Any) -> bool:
    return _is_finite(given) and abs(given) <= LARGEST


def _read_with(read: Any, forms: str, kinds: Sequence[str]) -> Any:
    """Make a field's type of a function that reads it; ``forms`` says what it may be, ``kinds`` as JSON has it."""
    schema = {"type": [*kinds], "description": forms}

    def build(_source: Any, _handler: Any) -> core_schema.CoreSchema:
        return core_schema.no_info_plain_validator_function(read)

    return Annotated[Any, GetPydanticSchema(build), WithJsonSchema(schema)]


_SPANS = ("number", "string", "array", "null")
Bound = _read_with(read_span, _FORMS, _SPANS)
Least = _read_with(read_least, _FORMS, _SPANS)
Varied = _read_with(read_range, _RANGES, ("string", "array"))
