"""A goal: soft bodies that cover an area."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from core.geometry import Array
from core.goals.keys import AboveZero, Key
from core.goals.measures import SLIP_SHARE, Measure
from core.goals.reaching import Reach
from core.values.states import State


@dataclass(frozen=True, kw_only=True)
class Spread(Reach):
    """Soft bodies that must each cover at least ``min_area_m2`` at the end, seen from above."""

    min_area_m2: float

    keys: ClassVar = {
        "min_area_m2": Key(
            AboveZero, "The least area that they cover, seen from above, m^2", head=True
        )
    }
    asks = "must cover at least {{ goal.min_area_m2 | g }} m^2 as seen from above"
    short = "spread {{ bodies }} over {{ goal.min_area_m2 | g(2) }} m^2"
    soft_nodes = (0,)

    def measures(self, body: str, start: State) -> Sequence[Measure]:
        def area(state: State) -> Array:
            return state.covered_area(body)

        least = self.min_area_m2
        name = f"area of {body}"
        return [Measure(name, area, least, SLIP_SHARE * least, "m^2", at_least=True)]
