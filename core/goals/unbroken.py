"""A limit: things that don't break."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from core.geometry import Array
from core.goals.evidence import Evidence
from core.goals.keys import Key, Names
from core.goals.limit import Breach, Limit
from core.goals.measures import BREAKS
from core.goals.reaching import Reach
from core.goals.sites import BREAKABLE
from core.scene import Scene
from core.values.margins import Margin


@dataclass(frozen=True)
class Unbroken(Limit):
    """Bodies and bonds that must not break, whatever loads them: ``unbroken`` names them."""

    unbroken: Names

    keys: ClassVar = {
        "unbroken": Key(
            Names,
            "Bodies and bonds that must not break, whatever presses or pulls them",
            head=True,
        )
    }
    asks = (
        "{{ goal.unbroken | join(', ') }} must not break: the force on one (of one other thing on a body, or at the "
        "point of a bond) may never exceed its breaks_n, or nothing is earned"
    )
    names: ClassVar = {"unbroken": BREAKABLE}
    holds_untouched: ClassVar = True
    needs_trace = True  # the forces are in it
    needs_peaks = True  # a blow is short

    def share(self, evidence: Evidence) -> Array:
        share = np.ones(())
        for name in self.unbroken:
            share = share * (evidence.film.strain(name)[..., -1] <= 1)

        return share

    def margins(self, evidence: Evidence) -> list[Margin]:
        if evidence.trace is None:
            return []

        film = evidence.film
        strains = {name: float(film.strain(name)[-1]) for name in self.unbroken}
        return [
            Margin.at_most(f"force on {name}", strain, 1.0, BREAKS)
            for name, strain in strains.items()
        ]

    def breaches(self, evidence: Evidence) -> Iterator[Breach]:
        film = evidence.film
        for name in self.unbroken:
            strain = film.strain(name)
            broken = strain > 1
            if broken.any():
                first = float(film.times[broken.argmax()])
                yield Breach(float(strain[-1]), first, f"{name} broke")

    def find_conflict(self, wanted: Reach, scene: Scene) -> str:
        spared = {*wanted.breaks} & {*self.unbroken}
        if not wanted.needs_some(len(wanted.breaks), len(spared)):
            return ""

        return f"{min(spared)} must break, and must not; leave one of the two out"
