"""A goal: bodies turned from their start."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from core.geometry import Array
from core.goals.goal import Given
from core.goals.keys import TOLERANCE_DEG, Bound, Key
from core.goals.measures import SLIP_DEG, Measure
from core.goals.reaching import Reach
from core.goals.sites import Site
from core.goals.turned import FAR_DEG, find_angle_faults, read_angle
from core.goals.wants import Want
from core.scene import Scene
from core.values.joints import inverse, multiply
from core.values.spans import Span
from core.values.states import State

OVER_DEG = 120.0  # a turn by more is one over an edge
LEAST_OFF_DEG = 3.0


@dataclass(frozen=True, kw_only=True)
class TurnedBy(Reach):
    """Bodies that must end turned from their start by ``turned_deg``, a `Span` in degrees, about any axis."""

    turned_deg: Span

    orients: ClassVar = True
    keys: ClassVar = {
        "turned_deg": Key(
            Bound,
            "By how much they must be turned from the start, degrees",
            head=True,
        ),
        "tolerance_deg": TOLERANCE_DEG,
    }
    asks = "must be turned from its start by {{ goal.turned_deg }} degrees, about whatever axis"
    short = "turn {{ bodies }} by {{ goal.turned_deg }} degrees"
    turns = True

    def measures(self, body: str, start: State) -> Iterator[Measure]:
        before = inverse(start.quaternion(body))

        def angle(state: State) -> Array:
            turn = multiply(state.quaternion(body), before)
            half = np.arccos(np.clip(np.abs(turn[..., 0]), 0.0, 1.0))
            return np.asarray(np.degrees(2 * half))

        name = f"turn of {body}"
        yield from Measure.within(self.turned_deg, name, angle, "deg", SLIP_DEG)

    @classmethod
    def translate(cls, key: str, given: Given) -> Given:
        return read_angle(key, given)

    def find_faults(self, site: Site) -> Iterator[str]:
        yield from super().find_faults(site)
        yield from find_angle_faults(self.turned_deg)

    def add_want(self, want: Want, scene: Scene) -> Want:
        """Return it with a turn over the side where that is far, and else about the vertical."""
        least = self.turned_deg.aim(0.0, 0.0)
        over = least >= OVER_DEG
        angle = np.radians(self.turned_deg.aim(180.0 if over else 0.0, FAR_DEG))

        now = np.array([1.0, 0.0, 0.0])
        points = np.array([np.cos(angle), np.sin(angle), 0.0])
        if over:
            now = np.array([0.0, 0.0, 1.0])
            points = np.array([np.sin(angle), 0.0, np.cos(angle)])

        back = scene[want.bodies[0]].pose.rotation.inv()
        off = float(abs(np.degrees(angle) - least))
        return replace(
            want,
            axis=tuple(back.apply(now).tolist()),
            points=tuple(points.tolist()),
            tolerance_deg=max(off, LEAST_OFF_DEG),
        )
