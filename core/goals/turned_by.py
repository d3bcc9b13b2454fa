"""A goal: bodies turned from their start."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from core.geometry import Array
from core.goals.base import SLIP_DEG, Measure, Reach
from core.values.joints import inverse, multiply
from core.values.spans import Span
from core.values.states import State


@dataclass(frozen=True, kw_only=True)
class TurnedBy(Reach):
    """Bodies that must end turned from their start by an angle within a span, degrees, about whatever axis."""

    turned_deg: Span

    def measures(self, body: str, start: State) -> Iterator[Measure]:
        before = inverse(start.quaternion(body))

        def angle(state: State) -> Array:
            turn = multiply(state.quaternion(body), before)
            half = np.arccos(np.clip(np.abs(turn[..., 0]), 0.0, 1.0))
            return np.asarray(np.degrees(2 * half))

        name = f"turn of {body}"
        yield from Measure.within(self.turned_deg, name, angle, "deg", SLIP_DEG)
