"""A limit: what must hold all the time."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from core.geometry import Array
from core.goals.base import Evidence, Limit, Reach
from core.values.margins import Margin


@dataclass(frozen=True)
class Throughout(Limit):
    """What must hold all the time: what bodies are asked for at the end, from the start on.

    What it leaves of a reward is the least progress of ``what`` over time: 0 where it was lost.
    """

    what: Reach

    @property
    def parts(self) -> tuple[Reach, ...]:
        """What it asks for."""
        return self.what.parts

    @property
    def needs_trace(self) -> bool:
        """It does: states over time are in it."""
        return True

    def share(self, evidence: Evidence) -> Array:
        return np.asarray(self.what.progress_over_time(evidence).min(axis=-1))

    def margins(self, evidence: Evidence) -> list[Margin]:
        instant = int(self.what.progress_over_time(evidence).argmin())
        worst = evidence.film.states[instant]
        return self.what.margins(replace(evidence, end=worst))
