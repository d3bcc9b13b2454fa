"""Compare engines with formulas: a case is a scene that is let go, and a figure of what comes of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import wraps
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from core.geometry import Array
from core.interfaces import Recording, Rollout, Simulator
from core.scene import Body, Joint, Scene, State
from plugins.conformance.checking import near
from plugins.conformance.worlds import BARE, film, run, still

FILM_HZ = 100.0


class Film(NamedTuple):
    """What came of a scene: instants (T,), the states there with fixed bodies and joints, and all that was recorded."""

    times: Array
    states: State
    recording: Recording


Measure = Callable[[Film], ArrayLike]
"""Reads a figure, or several, from a film."""


@dataclass(frozen=True)
class Case:
    """A scene that is let go while the arm waits, and what a formula says of it.

    Attributes:
        what: the figure in words, with its unit.
        bodies: of the scene.
        measure: reads the figure, or several.
        due: what the formula says; one figure for each that is measured, or for all.
        within: the largest difference that is allowed, as ``due``.
        seconds: how long it is played.
        joints: of the scene.
    """

    what: str
    bodies: tuple[Body, ...]
    measure: Measure
    due: ArrayLike
    within: ArrayLike
    seconds: float = 1.0
    joints: tuple[Joint, ...] = ()


def compare(make: Callable[[], Iterable[Case]]) -> Callable[[Simulator], None]:
    """Make a check of a function that makes cases: it plays each, and compares what is measured with the formula."""

    @wraps(make)
    def check(simulator: Simulator) -> None:
        for case in make():
            played = play(simulator, Scene(case.bodies, case.joints), case.seconds)
            near(case.what, case.measure(played), case.due, case.within)

    return check


def play(
    simulator: Simulator, scene: Scene, seconds: float, settle_s: float = 0.0
) -> Film:
    """Let the arm wait beside a scene."""
    job = Rollout(BARE, still(), 0, settle_s, seconds, FILM_HZ)
    recording = film(run(simulator, scene.bodies, job, scene.joints))
    return Film(recording.times, scene.complete(recording.states), recording)


def place(name: str) -> Measure:
    """Where a body ends, (3,) m."""
    return lambda played: played.states.position(name)[-1]


def moved(name: str) -> Measure:
    """How far a body ends from where it was put, m."""

    def measure(played: Film) -> float:
        places = played.states.position(name)
        return float(np.linalg.norm(places[-1] - places[0]))

    return measure


def velocity(name: str) -> Measure:
    """A body's velocity at the end, (3,) m/s."""
    return lambda played: played.states.linear_velocity(name)[-1]
