"""A goal: soft bodies that end flat."""

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
class Flattened(Reach):
    """Soft bodies that must end at most ``max_height_m`` high, from their lowest to their highest node."""

    max_height_m: float

    keys: ClassVar = {
        "max_height_m": Key(
            AboveZero, "The most height of soft bodies at the end, m", head=True
        )
    }
    asks = "must be at most {{ goal.max_height_m | g }} m high, from its lowest node to its highest"
    short = "flatten {{ bodies }} to {{ goal.max_height_m | g(2) }} m"
    soft_nodes = (0,)

    def measures(self, body: str, start: State) -> Sequence[Measure]:
        def height(state: State) -> Array:
            return state.extent(body)[..., 2]

        slip = SLIP_SHARE * self.max_height_m
        return [Measure(f"height of {body}", height, self.max_height_m, slip, "m")]
