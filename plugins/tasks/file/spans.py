"""Read spans of a scene file: a number, ``"> 0.3"``, ``"< 0.3"``, or ``[0.2, 0.4]``."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import GetPydanticSchema, WithJsonSchema
from pydantic_core import core_schema

from core.goals import Measure

LARGEST = 1e4
_BOUND = re.compile(r"\s*([<>])=?\s*([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?)\s*")
_FORMS = 'must be a number, "> 0.3", "< 0.3", or [0.2, 0.4] (the lowest and the highest, null: no limit)'
_AIM = 0.1  # of a span, or of `far`: how far within a program aims


@dataclass(frozen=True)
class Span:
    """From ``low`` to ``high``; an end that is infinite is none.

    Raises:
        ValueError: nothing is within it, or all is.
    """

    low: float = -math.inf
    high: float = math.inf

    def __post_init__(self) -> None:
        if not self.low <= self.high:
            raise ValueError(
                f"its range is from {self.low:g} to {self.high:g}; write the lower number first"
            )
        if math.isinf(self.low) and math.isinf(self.high):
            raise ValueError("a range without ends says nothing; write null for it")

    def __str__(self) -> str:
        if math.isinf(self.high):
            return f"at least {self.low:g}"
        if math.isinf(self.low):
            return f"at most {self.high:g}"

        return f"{self.low:g} to {self.high:g}"

    @classmethod
    def about(cls, value: float | Span, tolerance: float) -> Span:
        """Make the span of what may be off a ``value`` by a tolerance; a span stays what it is."""
        if isinstance(value, Span):
            return value

        return cls(value - tolerance, value + tolerance)

    def aim(self, value: float, far: float) -> float:
        """Return the value nearest to a given one that is well within; ``far``: that is far from an end."""
        room = _AIM * far
        if not math.isinf(self.high - self.low):
            room = min(room, (self.high - self.low) / 2)

        return min(max(value, self.low + room), self.high - room)

    def measures(
        self, name: str, value: Any, unit: str, far: float
    ) -> Iterator[Measure]:
        """Yield what it asks of the ``value`` of a state.

        Args:
            name: of the value.
            value: computes it from a state, (...).
            unit: of the value and of the ends.
            far: so far beyond an end counts as lost, and so far within as safe.
        """
        if not math.isinf(self.low):
            yield Measure(name, value, self.low, far, unit, at_least=True)
        if not math.isinf(self.high):
            yield Measure(name, value, self.high, far, unit, far=far)


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


def _read_number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError(_FORMS) from None


def _is_number(given: Any) -> bool:
    is_number = isinstance(given, int | float) and not isinstance(given, bool)
    return is_number and abs(given) <= LARGEST


def _read_with(read: Any) -> Any:
    """Make a field's type of a function that reads it."""
    kinds = ["number", "string", "array", "null"]
    schema = {"type": kinds, "description": _FORMS}

    def build(_source: Any, _handler: Any) -> core_schema.CoreSchema:
        return core_schema.no_info_plain_validator_function(read)

    return Annotated[Any, GetPydanticSchema(build), WithJsonSchema(schema)]


Bound = _read_with(read_span)
Least = _read_with(read_least)
