"""Define margins: how far something stayed from its limit."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from core.support.text import number_beside

FAR_M = 0.02  # a clearance that counts as far
ROUNDING = 1e-9


@dataclass(frozen=True)
class Margin:
    """How far something stayed from its limit.

    Attributes:
        name: what, such as ``clearance to vase``.
        value: what it was.
        limit: what it may be at most, or at least.
        unit: of both.
        margin: 1: far from the limit; 0: at it; below 0: beyond it. From -1 to 1.
        body: that must not be touched; empty: it is of something else.
        subject: the body of a goal to reach whose margin it is; empty: of none, or of several.
    """

    name: str
    value: float
    limit: float
    unit: str
    margin: float
    body: str = ""
    subject: str = ""

    @classmethod
    def at_most(
        cls, name: str, value: float, limit: float, unit: str, far: float = 0.0
    ) -> Margin:
        """Of what must not exceed a limit: 1 where the value is below it by ``far``; 0: where it is 0."""
        room = (limit - float(value)) / (far or limit)
        return cls(name, float(value), float(limit), unit, _cut(room))

    @classmethod
    def at_least(
        cls, name: str, value: float, limit: float, unit: str, far: float
    ) -> Margin:
        """Of what must reach a limit: 1 where the value exceeds it by ``far``."""
        return cls(
            name, float(value), float(limit), unit, _cut((float(value) - limit) / far)
        )

    @classmethod
    def clearance(cls, body: str, gap_m: float) -> Margin:
        """Of a body that must not be touched; a gap of 0 is a touch."""
        return cls(
            f"clearance to {body}",
            float(gap_m),
            0.0,
            "m",
            _cut(gap_m / FAR_M) if gap_m > 0 else -1.0,
            body,
        )

    @classmethod
    def missed(cls, name: str) -> Margin:
        """Return the margin of a yes or no that is no and must be yes; a yes has no room, and no margin."""
        return cls(name, 0.0, 1.0, "", -1.0)

    @property
    def excess(self) -> float:
        """How many times its limit the value is, where that is exceeded; else 0."""
        is_beyond = self.value > self.limit > 0
        return self.value / self.limit if is_beyond else 0.0

    @property
    def has_room(self) -> bool:
        """Whether it is of a number, and not of a yes or no."""
        return bool(self.unit)

    @property
    def is_kept(self) -> bool:
        """Whether it is within its limit, but for rounding."""
        return self.margin >= -ROUNDING

    def __str__(self) -> str:
        value = number_beside(self.value, self.limit)
        text = f"{self.name} {value} {self.unit}, limit {self.limit:.3g} {self.unit}"
        return text.replace(" ,", ",").rstrip()


def least_first(margins: Iterable[Margin]) -> tuple[Margin, ...]:
    """Sort margins, the least first, without those that are no numbers; of those at -1 what is farthest beyond."""
    known = (
        m for m in margins if all(map(math.isfinite, (m.value, m.limit, m.margin)))
    )
    return tuple(sorted(known, key=lambda m: (m.margin, -m.excess)))


def find_least(margins: Iterable[Margin]) -> float:
    """Return the least margin; 1, the most, of what has none."""
    return min((margin.margin for margin in margins), default=1.0)


def _cut(margin: float) -> float:
    return float(min(max(margin, -1.0), 1.0))
