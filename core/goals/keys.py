"""Describe the keys of a scene file that goals are written with: their types, and what they mean."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, WithJsonSchema

from core.support.inputs import in_unit
from core.values.spans import Span

LARGEST = 1e4
FARTHEST_M = 20.0
NEAR_ENOUGH = 0.01  # how far off a bare number still is there, m or rad, where an entry does not say it
_BOUND = re.compile(
    r"\s*([<>])=?\s*([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)\s*"
)
_FORMS = 'must be a number, "> 0.3", "< 0.3", or [0.2, 0.4] (the lowest and the highest, null: no limit)'


@dataclass(frozen=True)
class Key:
    """A key that an entry of a scene file's goals may have.

    Attributes:
        type: of its value, as Pydantic reads it.
        means: what it says, for editors and for models.
        head: whether an entry that has it wants a goal of this kind; else it says more of one.
        way: whether it says how far there is to go, as at most one key of an entry does.
        weak: whether it is a head only where no other one of the entry takes it.
    """

    type: Any
    means: str
    head: bool = False
    way: bool = False
    weak: bool = False


def read_span(given: Any) -> Span | float | None:
    """Read a number, ``"> 0.3"``, ``"< 0.3"``, or ``[0.2, 0.4]``; a number stays one, and null is none.

    Raises:
        ValueError: it is none of these.
    """
    if given is None or isinstance(given, Span):
        return given
    if _is_number(given):
        return float(given)

    if isinstance(given, str):
        found = _BOUND.fullmatch(given)
        if found and found[1] == ">":
            return Span(low=float(found[2]))
        if found:
            return Span(high=float(found[2]))

    if isinstance(given, list | tuple) and len(given) == 2:
        low, high = given
        if all(end is None or _is_number(end) for end in given):
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


def _is_number(given: Any) -> bool:
    is_number = isinstance(given, int | float) and not isinstance(given, bool)
    return is_number and abs(given) <= LARGEST


def _read_enough(given: Any) -> Any:
    """Refuse what is no number above 0: a text such as "80 %"."""
    if not _is_number(given):
        raise ValueError(
            "must be a whole number of bodies such as 3, or a share of them with a point such as 0.8"
        )
    if given <= 0:
        raise ValueError("must be greater than 0")

    return given


_SPANS = WithJsonSchema(
    {"type": ["number", "string", "array", "null"], "description": _FORMS}
)

Names = tuple[str, ...]
Most = Annotated[float, Field(ge=0, le=LARGEST)]
AboveZero = Annotated[float, Field(gt=0, le=LARGEST)]
Metres = Annotated[
    float, Field(ge=-FARTHEST_M, le=FARTHEST_M), in_unit("it is in metres")
]
Direction = tuple[Metres, Metres, Metres]
Place = tuple[Metres | None, Metres | None, Metres | None]
Bound = Annotated[Any, BeforeValidator(read_span), _SPANS]
Least = Annotated[Any, BeforeValidator(read_least), _SPANS]
Bounds = tuple[Bound, Bound, Bound]
Enough = Annotated[
    int | float,
    BeforeValidator(_read_enough),
    WithJsonSchema({"type": "number", "exclusiveMinimum": 0}),
]
KeptNames = Names | Literal["throughout"]

AT = Key(str, "The body or mark in whose frame places are, as it stands at the start")
NODE = Key(int, "Of soft bodies, the node that counts")
TOLERANCE = Key(
    AboveZero,
    f"How far off a bare number is near enough, m or rad; {NEAR_ENOUGH:g} if left out, and nothing of a span",
)
TOLERANCE_DEG = Key(AboveZero, "How far off is near enough, degrees")
AXIS = Key(Direction, "A direction in the frame of each body")
