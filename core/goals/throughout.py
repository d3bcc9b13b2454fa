"""A limit: what must hold all the time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from core.geometry import Array
from core.goals.evidence import Evidence
from core.goals.limit import Limit
from core.goals.reaching import Reach
from core.goals.sites import Site
from core.values.margins import Margin


@dataclass(frozen=True)
class Throughout(Limit):
    """A goal that must hold all the time, from the start on.

    Attributes:
        what: a goal to reach. The reward keeps its least progress over time, which is 0 once it was lost.
    """

    what: Reach

    needs_trace = True  # states over time are in it

    @property
    def parts(self) -> tuple[Reach, ...]:
        return self.what.parts

    def share(self, evidence: Evidence) -> Array:
        return np.asarray(self.what.progress_over_time(evidence).min(axis=-1))

    def margins(self, evidence: Evidence) -> list[Margin]:
        instant = int(self.what.progress_over_time(evidence).argmin())
        worst = evidence.film.states[instant]
        return self.what.margins_at(evidence, worst, instant)

    def describe(self) -> str:
        return f"throughout, or less is earned: {self.what.describe()}"

    def fit(self, site: Site) -> Self:
        return replace(self, what=self.what.resolve(site))

    def find_faults(self, site: Site) -> Iterator[str]:
        if self.what.needs_fixture:
            return

        start = site.scene.state()
        unmet = self.what.held or bool(self.what.progress(start, start) < 1.0)
        if unmet:
            verb = "is" if len(self.what.bodies) < 2 else "are"
            yield (
                f"throughout means from the start on, and at the start {self.what.subject} {verb} not so: nothing "
                "could be earned; leave throughout out, and it must hold at the end (with held: true, in hand)"
            )
