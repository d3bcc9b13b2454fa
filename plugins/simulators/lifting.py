"""Lift what a drive bears, where an engine's motor alone would sag under it."""

from __future__ import annotations

_RATE = 5.0  # 1/s: how fast what is left over is made up for
_SAGS = 0.005  # rad or m: a drive that holds its load is no farther off


class Lift:
    """Says by how much more than its target a drive has to aim at: an integral of how far it is off.

    A drive that is far off can't bear its load, or has a way to go: then it aims at its target.

    Args:
        time_step: seconds.
    """

    def __init__(self, time_step: float) -> None:
        self._share = _RATE * time_step
        self._more = 0.0

    def add(self, off: float) -> float:
        """Take how far the drive is below its target before a step, m or rad, and return how much more to aim at."""
        self._more = self._more + self._share * off if abs(off) <= _SAGS else 0.0
        return self._more
