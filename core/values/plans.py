"""Define action plans: what a model writes, and the waypoints that it means in one layout.

Plugins import all of it from `core.interfaces`.
"""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from core.geometry import Array, Pose
from core.values.jobs import Guards, RolloutSettings
from core.values.motions import Begin, JointTrajectory, Motion
from core.values.robots import Robot


@dataclass(frozen=True)
class Seen:
    """What a plan knows of a layout: the poses of bodies and marks in the world before the motion, by name.

    ``felt`` has, for each of the plan's guards that ended so far, where the mount was then; None: it never fired, and
    the mount is at the guard's waypoint.
    """

    poses: Mapping[str, Pose]
    felt: tuple[Pose | None, ...] = ()


@dataclass(frozen=True)
class Anchor:
    """A frame that a waypoint stands by, computed from what is seen.

    Attributes:
        name: the body or mark in which its origin is, or ``world``.
        axes: those of the world, or those of the anchor.
        toward: the name of a second body or mark; the world's axes are then turned about z until x points there.
        share: how far the origin lies on the way to ``toward``, 0 to 1.
    """

    name: str = "world"
    axes: Literal["world", "anchor"] = "world"
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


class ActionPlan(ABC):
    """A motion as a function of what is seen of the layout. It is picklable, a frozen dataclass, and never changed.

    A plan whose waypoints have guards makes what feels, too, and is resolved again each time a guard ends.
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

    @abstractmethod
    def resolve(self, seen: Seen) -> Waypoints:
        """Return the waypoints for one layout.

        Raises:
            core.design.DesignError: it needs something that is not there; says what, and in which waypoint.
        """

    def make_guards(self, planned: PlannedMotion) -> Guards:
        """Make what feels while a motion with guards is played; for plans whose waypoints have some."""
        raise NotImplementedError("its waypoints have guards, and nothing feels them")

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
    open to 1 closed. Without a ``tempo`` the arm rests at each. ``guards`` has one for each, or none at all.
    """

    action: ClassVar[str] = "waypoints"
    poses: Array
    tempo: Tempo | None = None
    guards: tuple[Guard | None, ...] = ()

    def __len__(self) -> int:
        return len(self.poses)

    def __hash__(self) -> int:
        return hash(self.content)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Waypoints) and self.content == other.content

    @property
    def grips(self) -> Array:
        """How far the gripper is closed at each, (N,); 0 for plans without it."""
        return (
            self.poses[:, 6] if self.poses.shape[1] == 7 else np.zeros(len(self.poses))
        )

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
            if self.tempo is not None or self.guards
            else content_of(self.poses)
        )


@dataclass(frozen=True, eq=False)
class PlannedMotion:
    """A motion with guards as it is planned before anything is felt, and what plans the rest of it on the way.

    Attributes:
        waypoints: what the plan means in this layout.
        motion: through them, as if no guard fired.
        robot: what moves.
        layout: its seed.
        settings: how the plan is executed.
        resolve: returns what the plan means once some guards have ended; see `Seen.felt`. It raises a
            `core.design.DesignError` where the plan means nothing then.
        go_on: plans the motion through waypoints from where the arm stopped. It raises a `DesignError` where no tempo
            keeps the arm's limits.
        check: raises a `DesignError` for a motion that can't be played on with, and when it would begin, seconds.
    """

    waypoints: Waypoints
    motion: Motion
    robot: Robot
    layout: int
    settings: RolloutSettings
    resolve: Callable[[tuple[Pose | None, ...]], Waypoints]
    go_on: Callable[[Waypoints, Begin], Motion]
    check: Callable[[JointTrajectory, float], object]


def digest(content: object) -> str:
    """Hash nested tuples of plain values."""
    return hashlib.blake2b(repr(content).encode(), digest_size=16).hexdigest()


def content_of(value: object) -> object:
    """Write a value as nested tuples. Fields with their default are left out, so that a new field changes no hash."""
    if is_dataclass(value):
        named = [(field, getattr(value, field.name)) for field in fields(value)]
        given = [
            (f.name, content_of(v))
            for f, v in named
            if not (type(v) is type(f.default) and v == f.default)
        ]
        return type(value).__name__, *given

    if isinstance(value, np.ndarray):
        return value.shape, value.dtype.str, value.tobytes()
    if isinstance(value, tuple):
        return tuple(content_of(item) for item in value)
    return value
