"""A goal: a joint at a position."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from core.geometry import Array
from core.goals.goal import Given
from core.goals.keys import TOLERANCE, Bound, Key
from core.goals.measures import NEAR_M, NEAR_RAD, SLIP_M, SLIP_RAD, Measure
from core.goals.reaching import STILL_M_S, STILL_RAD_S, Reach
from core.goals.sites import JOINT, Site
from core.goals.wants import Want
from core.scene import Scene
from core.values.spans import Span
from core.values.states import State

ROUNDING = 1e-9


@dataclass(frozen=True, kw_only=True)
class JointAt(Reach):
    """A ``joint`` that must end at a position, m or rad.

    A drawer that must be open by 0.2 m: ``JointAt(joint="drawer", to=0.2, tolerance=0.01)``.

    Attributes:
        to: the position, or a `Span` of it.
        tolerance: how far off still counts as there, m or rad; a span has none.
        relative: whether the position counts from where the joint starts.
    """

    joint: str
    to: float | Span
    tolerance: float = 0.0
    relative: bool = False

    keys: ClassVar = {
        "joint": Key(str, "The joint that must be moved", way=True),
        "to": Key(Bound, "The joint's position at the end, rad or m"),
        "change": Key(Bound, "How far from its start the joint must end, rad or m"),
        "tolerance": TOLERANCE,
    }
    asks = (
        "must {% if goal.relative %}change from its start by{% else %}get to{% endif %} {% if goal.span %}"
        "{{ goal.span }}{% else %}{{ goal.to | g }}{% endif %} m or rad"
        "{% if goal.tolerance and not goal.span %} (within {{ goal.tolerance | g }}){% endif %}"
    )
    short = "move the joint {{ goal.joint }}"
    names: ClassVar = {"joint": JOINT}
    of_bodies = False

    @property
    def subject(self) -> str:
        return f"joint {self.joint}"

    @property
    def span(self) -> Span | None:
        """The span in which the position must end; None: how far it is off counts."""
        if self.relative or isinstance(self.to, Span):
            return Span.about(self.to, self.tolerance)

        return None

    def subjects(self, state: State) -> tuple[str, ...]:
        return (state.joints[self.joint].joint.body,)

    def aim(self, start: State) -> float:
        """Return the position that a program may aim for, m or rad."""
        if self.span is None:
            assert not isinstance(self.to, Span)
            return self.to

        aim = self.span.aim(0.0, SLIP_M)
        if self.relative:
            aim += start.joints[self.joint].joint.start

        return aim

    def tolerance_m(self, scene: Scene) -> float:
        return self.tolerance if self._slides(scene.state()) else 0.0

    def _slides(self, state: State) -> bool:
        return state.joints[self.joint].joint.kind == "slider"

    def measures(self, body: str, start: State) -> Iterator[Measure]:
        def value(state: State) -> Array:
            position = state.joint(self.joint).position
            if self.relative:
                position = position - start.joint(self.joint).position
            elif self.span is None:
                position = np.abs(position - self.aim(start))

            return position

        unit = "rad"
        slip = SLIP_RAD
        near = NEAR_RAD
        if self._slides(start):
            unit = "m"
            slip = SLIP_M
            near = NEAR_M

        if self.span is None:
            name = f"{self.joint} off its position"
            yield Measure(name, value, self.tolerance, slip, unit, near=near)
            return

        what = "change" if self.relative else "position"
        name = f"{what} of {self.joint}"
        yield from Measure.within(self.span, name, value, unit, slip)

    def unrest(self, body: str, state: State) -> Array:
        still = STILL_M_S if self._slides(state) else STILL_RAD_S
        return np.abs(state.joint(self.joint).speed) / still

    def place_of(self, body: str, start: State) -> Array | None:
        """Return where the frame of the joint's body gets; that of a ball joint has no place."""
        placed = start.joints[self.joint]
        joint = placed.joint
        if joint.kind == "ball":
            return None

        parent = start.placement(joint.parent)
        to = np.asarray(self.aim(start))
        return placed.carry(to, np.zeros(()), parent).position

    @classmethod
    def translate(cls, key: str, given: Given) -> Given:
        if "change" in given and "to" in given:
            raise ValueError("a joint has to (a position) or change (from its start)")
        if "change" in given:
            return {"to": given["change"], "relative": True}

        return {}

    def add_want(self, want: Want, scene: Scene) -> Want:
        return replace(want, joint=self.joint, to=self.aim(scene.state()))

    def find_faults(self, site: Site) -> Iterator[str]:
        yield from super().find_faults(site)
        joint = site.scene.placed_joints[self.joint].joint
        wanted = self.span or Span.about(self.to, self.tolerance)
        begin = joint.start if self.relative else 0.0
        lowest = joint.lower
        highest = joint.upper
        if joint.kind == "ball":  # its position is the angle that it was turned by
            lowest = 0.0
            highest = math.pi

        too_high = begin + wanted.low > highest + ROUNDING
        too_low = begin + wanted.high < lowest - ROUNDING
        if too_high or too_low:
            unit = "m" if joint.kind == "slider" else "rad"
            yield (
                f"joint {joint.name} starts at {joint.start:g} and goes from {lowest:g} to {highest:g} {unit}, and "
                "never there; ask for less, or give the joint a wider range"
            )
