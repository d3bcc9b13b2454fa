"""Hold what goals are judged by: the states of worlds before and after, and what happened in between."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from core.geometry import Array
from core.values.states import State
from core.values.traces import TRACE_HZ, Trace

REST_S = 0.3  # what is slower for so long is at rest: it does not only turn back


@dataclass(frozen=True, eq=False)
class Evidence:
    """What goals are judged by, of one world or of many.

    Attributes:
        start: the state after settling, before the motion.
        end: the state after the motion.
        trace: what happened in between; None: nothing was recorded.
        goals: the task's, since one may come after another.
    """

    start: State
    end: State
    trace: Trace | None = None
    goals: Sequence[object] = ()

    @property
    def film(self) -> Trace:
        """The trace.

        Raises:
            ValueError: there is none.
        """
        if self.trace is None:
            raise ValueError(
                "the goals need a trace: declare reward(self, start, end, trace), and pass the trace on"
            )

        return self.trace

    def moved(self, body: str) -> Array:
        """Measure how far a body is from where it was at the start, m, (...)."""
        return length(self.end.position(body) - self.start.position(body))

    def ways(self, body: str) -> Array:
        """Measure how far a body is from where it was at the start at each instant, m, (..., T)."""
        begin = self.start.position(body)[..., None, :]
        return length(self.film.states.position(body) - begin)


@dataclass(frozen=True)
class Conduct:
    """What a trace says of bodies at its instants, or at one of them: are they held, let go, and at rest?

    Attributes:
        evidence: with the trace.
        instant: that alone counts, (...), -1 for the last; None: all do, (..., T).
    """

    evidence: Evidence
    instant: int | None = None

    def hold(self, body: str) -> Array:
        """Report how far the robot holds a body: 1, or 0.5 where it only touches it.

        To touch what hangs from something fixed by a joint, a bond or a pin is nothing.
        """
        film = self.evidence.film
        touched = film.contact(body, "robot") & ~film.support.hangs(body)
        return self._read(np.maximum(film.support.held(body), touched / 2))

    def let_go(self, body: str) -> Array:
        """Report where the robot does not reach a body, see `Support.linked`: 1, else 0."""
        let_go = ~self.evidence.film.support.linked(body)
        return self._read(let_go.astype(np.float64))

    def stands(self, body: str, other: str) -> Array:
        """Report where a body stands on another one: 1, else 0."""
        stands = self.evidence.film.support.stands(body, other)
        return self._read(stands.astype(np.float64))

    def highest(self, figure: Callable[[State], Array], now: State) -> Array:
        """Compute the highest that a figure of a state (...) was within `REST_S`, and is ``now``."""
        value = figure(now)
        if self.evidence.trace is None:
            return value

        values = figure(self.evidence.trace.states)
        count = round(REST_S * TRACE_HZ)
        # Before the first instant it was as high as there.
        begin = np.repeat(values[..., :1], count, axis=-1)
        longer = np.concatenate([begin, values], axis=-1)
        windows = np.lib.stride_tricks.sliding_window_view(longer, count + 1, axis=-1)
        return np.maximum(value, self._read(windows.max(axis=-1)))

    def strain(self, name: str) -> Array:
        """Find the largest force so far on what can break, as a share of what it bears."""
        return self._read(self.evidence.film.strain(name))

    def _read(self, values: Array) -> Array:
        return values if self.instant is None else values[..., self.instant]


def length(vectors: Array) -> Array:
    """Compute the lengths (...) of vectors (..., 3)."""
    lengths: Array = np.linalg.norm(vectors, axis=-1)
    return lengths
