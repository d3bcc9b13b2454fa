"""Define spans of numbers, such as at least 0.3. Plugins import them from `core.goals`."""

from __future__ import annotations

import math
from dataclasses import dataclass

_AIM = 0.1  # of a span, or of `far`: how far within a program aims


@dataclass(frozen=True)
class Span:
    """From ``low`` to ``high``; an end that is infinite is none. At least 0.3 is ``Span(low=0.3)``.

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
