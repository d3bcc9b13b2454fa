"""Measure states: figures that must end at a limit, what they count from, and how far off is lost."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from core.geometry import Array, Vector
from core.values.joints import rotate
from core.values.margins import Margin
from core.values.spans import Span
from core.values.states import State

SLIP_M = 0.1  # what is right at the start counts as lost when it is so far off
SLIP_RAD = 0.5
SLIP_DEG = float(np.degrees(SLIP_RAD))
SLIP_SHARE = 0.2  # of a limit of height or area: what is so far off counts as lost
NEAR_M = 0.02  # observations call a body in place up to here, where the goal has no tolerance
NEAR_RAD = 0.1
BREAKS = "of what breaks it"  # the unit of forces on what can break


@dataclass(frozen=True)
class Measure:
    """A figure of a state that is to end at most at a limit, or at least.

    A cup that must end higher than 0.2 m::

        Measure("height of cup", height, 0.2, slip=0.1, unit="m", at_least=True)

    Attributes:
        name: what it is, for its margin, such as ``height of cup``.
        value: computes it from the states of one world or of many, (...).
        limit: where it is to end; a place without a tolerance has the limit 0.
        slip: how far beyond the limit counts as lost, where the figure is right at the start.
        unit: of all its numbers: m, rad, ...
        at_least: whether it must not end below the limit; else not above it.
        near: up to here observations call it good, where no tolerance says when it is.
        far: so far below a limit that it must not exceed is safe; 0: where the figure is 0.
        whole: whether less than half counts until it is there. What was there at the start is lost once it is not.
    """

    name: str
    value: Callable[[State], Array]
    limit: float
    slip: float
    unit: str
    at_least: bool = False
    near: float = 0.0
    far: float = 0.0
    whole: bool = False

    @classmethod
    def within(
        cls,
        span: Span,
        name: str,
        value: Callable[[State], Array],
        unit: str,
        far: float,
    ) -> Iterator[Measure]:
        """Yield what a span asks of a figure; so ``far`` beyond an end counts as lost, and so far within as safe."""
        if not math.isinf(span.low):
            yield cls(name, value, span.low, far, unit, at_least=True)
        if not math.isinf(span.high):
            yield cls(name, value, span.high, far, unit, far=far)

    def left(self, state: State) -> Array:
        """Compute how far a state is beyond the limit, (...)."""
        value = self.value(state)

        beyond = value - self.limit
        if self.at_least:
            beyond = self.limit - value

        return np.maximum(beyond, 0.0)

    def lost(self, before: Array, left: Array) -> Array:
        """Compute which part of the way is ``left``, (...), of what was left ``before``, at the start; see `left`.

        Where nothing was, it is counted in slips.
        """
        part: Array = left / np.maximum(before, self.slip)
        if not self.whole:
            return part

        on_the_way = np.where(before > 0, (1 + part) / 2, 1.0)
        return np.where(left > 0, on_the_way, 0.0)

    def margin(self, end: State) -> Margin | None:
        """Return the margin of one world; None: nothing may be off, so that there is no room."""
        value = float(self.value(end))

        if self.at_least:
            return Margin.at_least(self.name, value, self.limit, self.unit, self.slip)
        if self.limit > 0 or self.far:
            return Margin.at_most(self.name, value, self.limit, self.unit, self.far)

        return None


def measure_angle(
    body: str, axis: Vector, towards: Callable[[State], Array]
) -> Callable[[State], Array]:
    """Make what measures the angle between an axis of a body's frame and unit vectors (..., 3), rad, (...)."""
    own = np.divide(axis, np.linalg.norm(axis))

    def angle(state: State) -> Array:
        now = rotate(state.quaternion(body), own)
        along = (now * towards(state)).sum(axis=-1)
        return np.asarray(np.arccos(np.clip(along, -1.0, 1.0)))

    return angle
