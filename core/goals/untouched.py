"""A limit: bodies that nothing touches, or presses too hard."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from core.errors import refuse
from core.geometry import Array
from core.goals.evidence import Evidence
from core.goals.keys import Key, Most, Names
from core.goals.limit import Breach, Limit
from core.goals.reaching import Reach
from core.goals.sites import SOLID_BODY, Site
from core.scene import Scene
from core.support.text import number_beside
from core.values.bearing import Flags
from core.values.margins import Margin
from core.values.traces import Trace


@dataclass(frozen=True)
class Untouched(Limit):
    """Bodies that the robot must not touch, or not press too hard.

    An egg that bears 5 N: ``Untouched(("egg",), max_force_n=5.0)``. A table on which no grain may fall:
    ``Untouched(("table",), by=("grain_0", "grain_1"))``.

    Attributes:
        untouched: their names.
        max_force_n: the most force on each at any instant, N; 0: no touch. The peak over the engine's steps counts, so
            blows count in full.
        mean: whether the mean over an instant of the trace counts instead, as a slow scale would read it.
        by: the bodies that must not touch them; empty: the robot.
    """

    untouched: Names
    max_force_n: float = 0.0
    mean: bool = False
    by: Names = ()

    keys: ClassVar = {
        "untouched": Key(
            Names,
            "Bodies that the robot must not touch, or other bodies, see by",
            head=True,
        ),
        "by": Key(
            Names,
            "The bodies that must not touch the untouched ones, in place of the robot",
        ),
        "max_force_n": Key(Most, "How hard it may press on them, N; 0 is not at all"),
    }
    asks = (
        "{{ goal.by | join(', ') or 'the robot' }} must not {% if goal.max_force_n %}press harder than "
        "{{ goal.max_force_n | g }} N on{% else %}touch{% endif %} {{ goal.untouched | join(', ') }}, or nothing "
        "is earned"
    )
    names: ClassVar = {"untouched": SOLID_BODY, "by": SOLID_BODY}
    holds_untouched: ClassVar = True
    needs_trace = True  # what touched is in it

    def __post_init__(self) -> None:
        refuse("a goal's ", {"max_force_n must be 0 or more": self.max_force_n < 0})

    @property
    def needs_peaks(self) -> bool:
        """Whether it limits the peak of a force."""
        return self.max_force_n > 0 and not self.mean

    @property
    def touchers(self) -> Names:
        """What must not touch them, as a trace names it."""
        return self.by or ("robot",)

    def _forces(self, name: str, film: Trace) -> Array:
        """Measure how hard a body is pressed at each instant by one of those that must not, N, (..., T)."""
        measure = film.forces_n if self.mean else film.peaks_n
        pressed = [measure(name, toucher) for toucher in self.touchers]
        return np.asarray(np.max(pressed, axis=0))

    def _harmed(self, name: str, film: Trace) -> Flags:
        """Report at which instants (..., T) something is done to a body that must not be."""
        if self.max_force_n:
            return self._forces(name, film) > self.max_force_n

        touched = [film.contact(name, toucher) for toucher in self.touchers]
        return np.asarray(np.any(touched, axis=0))

    def share(self, evidence: Evidence) -> Array:
        share = np.ones(())
        for name in self.untouched:
            share = share * ~self._harmed(name, evidence.film).any(axis=-1)

        return share

    def margins(self, evidence: Evidence) -> list[Margin]:
        trace = evidence.trace
        if trace is None:
            return []

        found = []

        for name in self.untouched:
            if self.max_force_n and trace.forces is not None:
                force = float(self._forces(name, trace).max())
                what = f"force on {name}"
                found.append(Margin.at_most(what, force, self.max_force_n, "N"))
            elif not (self.max_force_n or self.by) and name in trace.clearances:
                touched = trace.touched(name, "robot")
                gap = 0.0 if touched else float(trace.clearances[name])
                found.append(Margin.clearance(name, gap))

        return found

    def breaches(self, evidence: Evidence) -> Iterator[Breach]:
        film = evidence.film
        if self.max_force_n and film.forces is None:
            return

        for name in self.untouched:
            harmed = self._harmed(name, film)
            if not harmed.any():
                continue

            did = f"{self._find_toucher(film, name)} touched {name}"
            excess = np.inf
            if self.max_force_n:
                force = float(self._forces(name, film).max())
                excess = force / self.max_force_n
                pressed = number_beside(force, self.max_force_n)
                did = f"{name} pressed with {pressed} N, {self.max_force_n:g} N allowed"

            yield Breach(excess, float(film.times[harmed.argmax()]), did)

    def _find_toucher(self, film: Trace, body: str) -> str:
        """Name what touched a body first: of the robot the part; ``the robot`` where its force alone is known."""
        touches = [(float(film.first_s(body, name)), name) for name in self.by]
        if not self.by:
            touches = [
                (float(film.first_s(body, part)), part)
                for kind, part, other in film.touching
                if kind != "body" and other == body
            ]

        known = [touch for touch in touches if np.isfinite(touch[0])]
        _, first = min(known, default=(0.0, "the robot"))

        return first

    def find_faults(self, site: Site) -> Iterator[str]:
        if self.max_force_n or not self.by:
            return

        for pair in site.find_touching(self.by):
            for name, other in (pair, pair[::-1]):
                if name in self.by and other in self.untouched:
                    yield (
                        f"{name} must not touch {other}, and begins at it: nothing could be earned; move it, or say "
                        "where it must end"
                    )

    def allows_n(self, body: str) -> float | None:
        """See `Limit.allows_n`; what must not be touched may still be moved by something else."""
        limits_force = self.max_force_n > 0 and not self.by and body in self.untouched
        return self.max_force_n if limits_force else None

    def find_conflict(self, wanted: Reach, scene: Scene) -> str:
        alone = {*wanted.bodies} & {*self.untouched}
        if not wanted.held or self.by or self.max_force_n:
            return ""
        if not wanted.needs_some(len(wanted.bodies), len(alone)):
            return ""

        return (
            f"{min(alone)} must be held, and must not be touched by the robot; leave one of the two out, or give "
            "max_force_n"
        )
