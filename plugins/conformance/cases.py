"""Compare engines with formulas: a case is a scene that is let go, and a figure of what comes of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import wraps

import numpy as np
from numpy.typing import ArrayLike

from core.geometry import Array
from core.interfaces import Simulator
from core.scene import Body, Joint, Scene
from plugins.conformance.shared import near
from plugins.conformance.worlds import Film, watch

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
        settle_s: how long it settles before.
    """

    what: str
    bodies: tuple[Body, ...]
    measure: Measure
    due: ArrayLike
    within: ArrayLike
    seconds: float = 1.0
    joints: tuple[Joint, ...] = ()
    settle_s: float = 0.0


def compare(make: Callable[[], Iterable[Case]]) -> Callable[[Simulator], None]:
    """Make a check of a function that makes cases: it plays each, and compares what is measured with the formula."""

    @wraps(make)
    def check(simulator: Simulator) -> None:
        for case in make():
            scene = Scene(case.bodies, case.joints)
            played = watch(simulator, scene, case.seconds, settle_s=case.settle_s)
            near(case.what, case.measure(played), case.due, case.within)

    return check


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


def spin(name: str) -> Measure:
    """A body's angular velocity at the end, (3,) rad/s."""

    def measure(played: Film) -> Array:
        states = played.states
        last: Array = states.angular_velocities[-1, states.names.index(name)]
        return last

    return measure
