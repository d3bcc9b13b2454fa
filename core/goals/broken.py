"""A goal: things that break."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from core.geometry import Array
from core.goals.evidence import Conduct, Evidence
from core.goals.keys import Key, Names
from core.goals.measures import BREAKS
from core.goals.reaching import Reach
from core.goals.sites import BREAKABLE
from core.goals.wants import Want
from core.scene import Scene
from core.values.margins import Margin
from core.values.states import State


@dataclass(frozen=True, kw_only=True)
class Broken(Reach):
    """Bodies and bonds that must break: ``broken`` names them, as in ``Broken(broken=("egg",))``.

    A thing is broken from the first step of the engine in which the force on it is more than its ``breaks_n``, for
    good. Until then less than half is earned, by the largest force so far. A look can't see it: it never counts as
    in place.
    """

    broken: Names

    keys: ClassVar = {
        "broken": Key(Names, "Bodies and bonds that must break", head=True)
    }
    asks = (
        "must break: the force on {% if goal.any %}any one{% else %}each{% endif %} (of one other thing on a body, or "
        "at the point of a bond) must once exceed its breaks_n; until then less than half is earned, by the largest "
        "force"
    )
    short = "break {{ goal.subject }}"
    names: ClassVar = {"broken": BREAKABLE}
    of_bodies = False
    needs_trace = True  # the forces are in it
    needs_peaks = True  # a blow is short
    alone = True

    def __post_init__(self) -> None:
        super().__post_init__()
        only_broken = "a goal with broken has no bodies, rest, held or released; make a goal of its own for these"
        given = bool(self.bodies or self.also)
        if given or self.rest or self.held or self.released:
            raise ValueError(only_broken)

    @property
    def subject(self) -> str:
        return (" or " if self.any else ", ").join(self.broken)

    def subjects(self, state: State) -> Names:
        bonds = state.bonds
        bodies = [bonds[n].body if n in bonds else n for n in self.broken]
        return tuple(dict.fromkeys(bodies))

    def progress(
        self, start: State, now: State, conduct: Conduct | None = None
    ) -> Array:
        if conduct is None:
            return np.zeros(now.positions.shape[:-2])

        strains = [conduct.strain(name) for name in self.broken]
        shares = [np.where(strain > 1, 1.0, strain / 2) for strain in strains]
        return self.average(shares)

    def is_in_place(self, body: str, start: State, end: State) -> bool:
        return False

    def margins(self, evidence: Evidence) -> list[Margin]:
        if evidence.trace is None:
            return []

        conduct = Conduct(evidence, -1)
        strains = {name: float(conduct.strain(name)) for name in self.broken}
        best_first = sorted(strains, key=lambda name: -strains[name])
        name = best_first[self.count_enough(len(best_first)) - 1]
        return [Margin.at_least(f"force on {name}", strains[name], 1.0, BREAKS, 1.0)]

    @property
    def breaks(self) -> Names:
        return self.broken

    def add_want(self, want: Want, scene: Scene) -> Want:
        return replace(want, breaks=True)
