"""Define action plans: what a model writes, and the waypoints that it means in one layout.

Plugins import all of it from `core.interfaces`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal, NamedTuple, Protocol

import numpy as np

from core.geometry import Array, Pose
from core.values.contents import content_of
from core.values.jobs import Looked, Reactions, RolloutSettings
from core.values.motions import Begin, JointTrajectory, Motion
from core.values.robots import Robot
from core.values.states import State


@dataclass(frozen=True)
class Sighted:
    """What was seen of the scene at one instant.

    Attributes:
        poses: of bodies and marks in the world, by name.
        at_s: when, seconds of the motion.
        known_s: when the plan can use it.
        taken_s: of bodies that were hidden, when they were seen last; for the others it is ``at_s``.
        answers: what a plan worked out of it before: it is asked again each time that something new is known.
    """

    poses: Mapping[str, Pose]
    at_s: float = 0.0
    known_s: float = 0.0
    taken_s: Mapping[str, float] = field(default_factory=dict)
    answers: dict[object, Any] = field(default_factory=dict, compare=False, repr=False)

    @property
    def hidden(self) -> tuple[str, ...]:
        """The bodies that were not seen, and are taken to be where they were before."""
        return tuple(self.taken_s)


class Judge(Protocol):
    """What a plan may ask of what is seen; it is about one layout of a task."""

    def names(self, goal: int | str) -> tuple[str, ...]:
        """Return the bodies of one of the task's goals, by its number (from 0) or name.

        Raises:
            core.design.DesignError: there is no such goal to reach.
        """

    def left(self, goal: int | str, poses: Mapping[str, Pose]) -> tuple[str, ...]:
        """Return those of a goal's bodies that are not where it wants them; none: it is reached."""

    def box(self, body: str) -> tuple[Array, Array]:
        """Return the middle (3,) and half lengths (3,) of the box around a body, in its frame, metres."""


@dataclass(frozen=True)
class Seen:
    """What a plan knows of a layout: the poses of bodies and marks in the world before the motion, by name.

    Attributes:
        poses: before the motion.
        felt: for each of the plan's guards that ended so far, where the mount was then; None: it never fired, and the
            mount is at the guard's waypoint.
        looks: what was seen by each look of the plan so far.
        judge: answers what plans ask of what is seen.
        noise: of what is seen, standard deviations: of x and y, metres, and of the yaw, radians.
        most_s: how long the whole motion may take, seconds.
    """

    poses: Mapping[str, Pose]
    felt: tuple[Pose | None, ...] = ()
    looks: tuple[Sighted, ...] = ()
    judge: Judge | None = field(default=None, compare=False, repr=False)
    noise: tuple[float, float] = (0.0, 0.0)
    most_s: float = math.inf


@dataclass(frozen=True)
class Anchor:
    """A frame that a waypoint stands by, computed from what is seen.

    Attributes:
        name: the body or mark in which its origin is, or ``world``.
        axes: those of the ``world``, those of the ``anchor``, or those of another body or mark, by its name.
        toward: the name of a second body or mark; the world's axes are then turned about z until x points there.
        share: how far the origin lies on the way to ``toward``, 0 to 1.
    """

    name: str = "world"
    axes: str = "world"
    toward: str = ""
    share: float = 0.0


@dataclass(frozen=True)
class Guard:
    """What ends the way to a waypoint before that is reached: the arm brakes there, and goes on from there.

    Attributes:
        until: ``touch``: the force at the flange is above the noise; ``force``: it is ``newtons`` against the motion;
            ``stall``: a joint lags behind.
        newtons: see ``until``.
        otherwise: what follows if the waypoint is reached: ``go_on``, or ``end`` of the motion.
    """

    until: Literal["touch", "force", "stall"]
    newtons: float = 0.0
    otherwise: Literal["go_on", "end"] = "go_on"


class Look(NamedTuple):
    """A look of a plan: after how many of its waypoints, and in which part of the plan, in words."""

    after: int
    where: str = ""


class ActionPlan(ABC):
    """A motion as a function of what is seen of the layout. It is picklable, a frozen dataclass, and never changed.

    A plan with guards or looks makes what feels and looks, too, and is resolved again each time a guard ends, and after
    each look.
    """

    # The name of the representation that reads it, as in ``action=NAME``.
    action: ClassVar[str]

    @property
    def anchors(self) -> tuple[Anchor, ...]:
        """What its waypoints stand by, one for each; empty: all stand in the world."""
        return ()

    @property
    def turns(self) -> Array:
        """Roll, pitch and yaw (N, 3) of its waypoints as they are written, radians; (0, 3): not as such."""
        return np.empty((0, 3))

    def outline(self) -> list[str]:
        """Describe its blocks in lines, and the most that it can come to; none: all is known before it is played."""
        return []

    def most_seconds(self, look_s: float) -> float:
        """Return the most seconds that it may ask for with all its loops, of looks that last so long each.

        By default 0: what it asks for is known from its waypoints.
        """
        return 0.0

    @abstractmethod
    def resolve(self, seen: Seen) -> Waypoints:
        """Return the waypoints for one layout, as far as they are known: up to the next look that is not taken yet.

        Raises:
            core.design.DesignError: it needs something that is not there; says what, and in which waypoint.
        """

    def make_reactions(self, planned: PlannedMotion) -> Reactions:
        """Make what feels and looks while a motion is played; for plans whose waypoints have guards or looks."""
        raise NotImplementedError(
            "its waypoints have guards or looks, and nothing feels or looks"
        )

    @abstractmethod
    def dump(self) -> list[Any]:
        """Return the JSON value that its representation reads back as an equal plan."""

    @property
    def content(self) -> object:
        """What is tried, as nested tuples: equal for equal plans, in every process."""
        return content_of(self)

    def of(self, task: str) -> ActionPlan | str:
        """Return the plan for a task; a text: there is none, and why. By default this plan is for any task."""
        return self


@dataclass(frozen=True, eq=False)
class Tempo:
    """When the N waypoints are reached; nan stands for "as fast as usual".

    Attributes:
        seconds: (N,) the time of the way to each.
        speeds: (N,) the end-effector's speed on that way, m/s.
        through: (N,) bool, pass it without a stop.
        waits: (N,) seconds to stay there.
    """

    seconds: Array
    speeds: Array
    through: Array
    waits: Array

    @staticmethod
    def usual(count: int) -> Tempo:
        """The tempo of plans that ask for none."""
        none = np.full(count, np.nan)
        return Tempo(none, none, np.zeros(count, dtype=bool), np.zeros(count))


@dataclass(frozen=True, eq=False)
class Waypoints(ActionPlan):
    """Literal waypoints: the plan that looks at nothing.

    ``poses`` are (N, 6): x, y, z, roll, pitch, yaw of the mount's frame in the world; or (N, 7) with the gripper, 0
    open to 1 closed, or with suction, 0 off to 1 on. Without a ``tempo`` the arm rests at each. ``guards`` has one for
    each, or none at all. ``looks`` are those that were taken, and the next one, which ends the waypoints.
    """

    action: ClassVar[str] = "waypoints"
    poses: Array
    tempo: Tempo | None = None
    guards: tuple[Guard | None, ...] = ()
    looks: tuple[Look, ...] = ()

    def __len__(self) -> int:
        return len(self.poses)

    def __hash__(self) -> int:
        return hash(self.content)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Waypoints) and self.content == other.content

    @property
    def closes(self) -> bool:
        """Whether it closes and opens the gripper, or switches grips on and off."""
        return self.poses.shape[1] == 7

    @property
    def grips(self) -> Array:
        """How far the gripper is closed at each, (N,); 0 for plans without it."""
        return self.poses[:, 6] if self.closes else np.zeros(len(self.poses))

    @property
    def turns(self) -> Array:
        return self.poses[:, 3:6]

    def resolve(self, seen: Seen) -> Waypoints:
        return self

    def dump(self) -> list[Any]:
        return list(self.poses.tolist())

    @property
    def content(self) -> object:
        return (
            content_of(self)
            if self.tempo is not None or self.guards or self.looks
            else content_of(self.poses)
        )


@dataclass(frozen=True, eq=False)
class PlannedMotion:
    """A motion with guards or looks as it is planned before it is played, and what plans the rest of it on the way.

    Attributes:
        waypoints: what the plan means in this layout.
        motion: through them, as if no guard fired.
        robot: what moves.
        layout: its seed.
        settings: how the plan is executed.
        resolve: returns what the plan means once some guards have ended and some looks were taken; see `Seen`. It
            raises a `core.design.DesignError` where the plan means nothing then.
        perceive: looks at the scene. It gets when, the joints (J,), the fingers (F + K,), the free bodies' state, and
            what was seen before: an entry for each look.
        report: says what a look found out, of which number from 1, and after how many waypoints.
        go_on: plans the motion through waypoints from where the arm stopped. It raises a `DesignError` where no tempo
            keeps the arm's limits.
        check: raises a `DesignError` for a motion that can't be played on with, and when it would begin, seconds.
    """

    waypoints: Waypoints
    motion: Motion
    robot: Robot
    layout: int
    settings: RolloutSettings
    resolve: Callable[[tuple[Pose | None, ...], tuple[Sighted, ...]], Waypoints]
    perceive: Callable[[float, Array, Array, State, tuple[Sighted, ...]], Sighted]
    report: Callable[[Look, tuple[Sighted, ...]], Looked]
    go_on: Callable[[Waypoints, Begin], Motion]
    check: Callable[[JointTrajectory, float], object]


NO_PLAN = Waypoints(np.empty((0, 6)))
"""The plan of a candidate whose plan can't be read."""
