"""Define what is observed of a rollout: contacts, motions, and what became of the bodies of the task's goal.

Plugins import it from `core.interfaces`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Literal

from core.support.text import short_numbers

Class = Literal[
    "solved",
    "placed",
    "forbidden",
    "never touched",
    "missed",
    "dropped",
    "tipped",
    "stuck",
    "unreachable",
]

MISSED_M = 0.02
"""A way is missed by more than this, or by more than `MISSED_RAD`."""

MISSED_RAD = 0.1

Point = tuple[float, float, float]
Offset = tuple[float | None, float | None, float | None]


@dataclass(frozen=True)
class Contact:
    """Two things that touched in a rollout, from ``first_s`` to ``last_s``, perhaps with pauses.

    Times are those of a `Recording`, seconds. ``one`` is a component of the tool, a link of the arm or a body, as
    ``kind`` says; ``other`` is a body. A finger counts as the tool if attachments hang from it. ``depth_m`` is the
    largest penetration; a negative one is the smallest gap. ``force_n`` is the largest force; None: not measured.
    """

    kind: Literal["tool", "arm", "body"]
    one: str
    other: str
    first_s: float
    last_s: float
    depth_m: float
    force_n: float | None = None


@dataclass(frozen=True)
class Moved:
    """A body's way from its start to its end, its place at the end, metres, and how far its upward axis turned."""

    by: Point
    to: Point
    tilt_deg: float


@dataclass(frozen=True)
class Crux:
    """The body that a rollout turned on, and its way: where the task is solved that with the least room, else the one
    that is farthest off its place.

    Attributes:
        body: its name.
        begun: where it was when the motion began, and ``ended``: at the end.
        toucher: what last touched it while the robot reached it: a part of the robot, or another body; empty: nothing.
        touched_s: from when to when; None: the robot never reached it.
        velocity: in which it left that, m/s in world axes; None: it did not.
        nearest_m: how near it came to where a goal wants it, and ``nearest_s``: when; None: no goal says where.
        speed: at the end, m/s.
    """

    body: str
    begun: Point
    ended: Point
    toucher: str = ""
    touched_s: tuple[float, float] | None = None
    velocity: Point | None = None
    nearest_m: float | None = None
    nearest_s: float = 0.0
    speed: float = 0.0


@dataclass(frozen=True)
class Sight:
    """What feedback may say of bodies: all of it."""

    numbers: ClassVar[bool] = True  # of bodies

    def text(self, text: str) -> str:
        """Return a text without what may not be said."""
        return text

    def way(self, moved: Moved, *, ends: bool = True) -> str:
        """Describe a body's way, and with ``ends`` where it ends."""
        way = f"by ({short_numbers(moved.by, 3, ', ')})"
        if ends:
            way += f" to ({short_numbers(moved.to, 3, ', ')})"

        return way


@dataclass(frozen=True)
class Observation:
    """The observations of a rollout. Lengths are metres, times seconds from the start of the motion.

    Attributes:
        result: what became of the bodies of the task's goal, see `core.simulation.observing`.
        what: the body that this happened to, the thing that the robot was stuck at, or what was forbidden.
        at_s: when it happened.
        left: the bodies of the goal that are not in place.
        moved: the free bodies that moved, and those of the goal.
        errors: for each body of a goal, its place at the end minus the wanted one, along the axes of what the goal
            stands by; None: a coordinate is free.
        measured: how far other figures of the goals got, in words: of each goal those of one body not in place.
        contacts: the first contacts, the robot's before those of bodies with each other.
        clearances: the least distance of the robot to each body that it did not touch.
        nearest: for each of them the part of the robot that came nearest, and when.
        touch_m: how far from its mount's origin the tool first touched a body that can move; None: it touched none.
        miss: the number of the waypoint, from 1, on the way to which the arm can follow least, and its two errors
            there, metres and radians.
        lag_rad: the largest lag of a joint, and ``lag_s``: when.
        arrivals: when each waypoint is reached.
        felt: how each guard of the plan ended, in words.
        looked: what each look of the plan found out, in words.
        gripped: what the tool's grips held, and why they did not, in words.
        crux: the body that it turned on; None: there is none.
        instants: of the places in ``paths``: around the last touch of that body.
        paths: the places of some bodies that moved: first those of ``left``, then the goal's others.
    """

    result: Class
    what: str = ""
    at_s: float | None = None
    left: tuple[str, ...] = ()
    moved: Mapping[str, Moved] = field(default_factory=dict)
    errors: Mapping[str, Offset] = field(default_factory=dict)
    measured: tuple[str, ...] = ()
    contacts: tuple[Contact, ...] = ()
    clearances: Mapping[str, float] = field(default_factory=dict)
    nearest: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    touch_m: float | None = None
    miss: tuple[int, float, float] = (1, 0.0, 0.0)
    lag_rad: float = 0.0
    lag_s: float = 0.0
    arrivals: tuple[float, ...] = ()
    felt: tuple[str, ...] = ()
    looked: tuple[str, ...] = ()
    gripped: tuple[str, ...] = ()
    crux: Crux | None = None
    instants: tuple[float, ...] = ()
    paths: Mapping[str, tuple[Point, ...]] = field(default_factory=dict)
