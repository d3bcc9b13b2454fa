"""Read by what a number of a scene file varies: a range, values, or ``"+-0.01"``."""

from __future__ import annotations

import math
import re
from typing import Annotated, Any

from pydantic import BeforeValidator, WithJsonSchema

MAX_SETS = 256  # values of a number, one for a layout
_OFF = re.compile(r"\s*\+-\s*([0-9.]+(?:[eE][-+]?[0-9]+)?)\s*")
_RANGES = (
    "must be a list, such as [0.1, 0.2] (the lowest and the highest), "
    'or "+-0.01", how far it may be off'
)


def read_range(given: Any) -> tuple[float, ...] | float:
    """Read what a number may vary by: a range, the values of layouts, or how far it may be off.

    Raises:
        ValueError: it is neither.
    """
    if isinstance(given, str):
        found = _OFF.fullmatch(given)
        if found and found[1].count(".") < 2 and float(found[1]) > 0:
            return float(found[1])

    several = isinstance(given, list | tuple) and 2 <= len(given) <= MAX_SETS
    if several and all(map(_is_finite, given)):
        if len(given) == 2 and given[0] > given[1]:
            low, high = given
            raise ValueError(
                f"its range is from {low:g} to {high:g}; write the lower number first"
            )

        return tuple(map(float, given))

    raise ValueError(_RANGES)


def _is_finite(given: Any) -> bool:
    """Report whether it is a number; what a body's field may be at most is asked of its layouts."""
    is_number = isinstance(given, int | float) and not isinstance(given, bool)
    return is_number and math.isfinite(given)


Varied = Annotated[
    Any,
    BeforeValidator(read_range),
    WithJsonSchema({"type": ["string", "array"], "description": _RANGES}),
]
