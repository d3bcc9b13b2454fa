"""Define how a rollout is played, and what comes of it: settings, guards, worlds, recordings and outcomes.

Plugins import all of it from `core.interfaces`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from core.errors import UsageError, check_positive, choices
from core.geometry import Array
from core.values.motions import JointTrajectory, Motion
from core.values.states import State


class Felt(NamedTuple):
    """How a guard ended: at its waypoint (from 1), when (s), by what, and with what force at the flange (N)."""

    waypoint: int
    at_s: float
    fired: str  # touch, force or stall; empty: it never fired
    force_n: float

    def __str__(self) -> str:
        what = f"{self.fired} at" if self.fired else "never fired; reached at"
        return f"waypoint {self.waypoint}: {what} {self.at_s:.2f} s, with {self.force_n:.1f} N at the flange"


@runtime_checkable
class Guards(Protocol):
    """What feels while a motion is played, and changes it; a plan makes it (`ActionPlan.make_guards`).

    Attributes:
        felt: how guards ended so far.
        problem: why the rest could not be planned; the motion ended there.
    """

    felt: tuple[Felt, ...]
    problem: str | None

    @property
    def motion(self) -> Motion:
        """The motion as it is planned now; after a rollout, as it was played."""

    @property
    def since(self) -> float:
        """From when on the arm feels for the next guard, seconds of the motion; inf: there is none left."""

    def begin(self) -> JointTrajectory:
        """Begin anew, and return the motion in which no guard fires."""

    def feel(
        self,
        time: float,
        arm: Array,
        points: Array,
        forces: Array,
    ) -> JointTrajectory | None:
        """Take what the arm feels every `FEEL_S`: its joints (J,), and forces (C, 3) at points (C, 3).

        Returns the motion to go on with, the same up to ``time``; None: as before.
        """


FEEL_S = 0.01  # between two readings


@dataclass(unsafe_hash=True)
class Perception:
    """The noise of what plans see: standard deviations of x and y, metres, and of the yaw, radians.

    ``height``: the most by which all heights of a layout are wrong for a plan, metres. They are wrong by the same.
    """

    position: float = 0.0
    yaw: float = 0.0
    height: float = 0.0

    def __post_init__(self) -> None:
        for name, noise in vars(self).items():
            _check_range(f"perception.{name}", noise, 1)


def _check_range(
    name: str,
    value: float,
    most: float,
    unit: str = "",
) -> None:
    if not 0 <= value <= most:
        raise UsageError(
            f"rollout.{name} must be between 0 and {most}{unit}, got {value}"
        )


@dataclass(unsafe_hash=True)
class Feel:
    """What guards feel: the arm's own estimate of the force at its flange, from the torques of its joints.

    Attributes:
        noise: the standard deviation of each joint's torque, N m.
        threshold: a force above it is a touch, N.
        stall: a joint that lags by more is stalled, radians.
    """

    noise: float = 0.05
    threshold: float = 3.0
    stall: float = 0.05

    def __post_init__(self) -> None:
        check_positive("rollout.feel.", threshold=self.threshold, stall=self.stall)
        _check_range("feel.noise", self.noise, 10, " N m")


PENETRATION_MODES = ("forbid", "warn", "ignore")


@dataclass(unsafe_hash=True)
class RolloutSettings:
    """How a plan is executed. Times are in seconds.

    ``segment_s`` is the shortest time of a segment; ``settle_s`` and ``hold_s`` are the pauses before and after the
    motion. ``speed`` is the share of the arm's velocity and acceleration limits that is used. A plan whose motion lasts
    longer than ``max_motion_s`` is rejected. ``penetration`` says what a rollout earns in which solids passed through
    one another (`core.solids.penetration`): with ``forbid`` nothing, with ``warn`` the task's reward; both add a
    warning. With ``ignore`` nothing is checked. A plan that drives the arm through itself or the tool through the arm
    (`core.solids.self_collision`) is rejected with ``forbid``, and adds a warning with ``warn``. A trial of a rollout
    that was checked and earns nothing holds an observation (`Observation`), with ``observe`` each trial.
    Plans that look see the scene with the noise of ``perception``, and guards feel by ``feel``.
    """

    segment_s: float = 0.5
    settle_s: float = 0.5
    hold_s: float = 1.0
    speed: float = 0.95
    max_motion_s: float = 120.0
    penetration: str = "forbid"
    observe: bool = False
    perception: Perception = field(default_factory=Perception)
    feel: Feel = field(default_factory=Feel)

    def __post_init__(self) -> None:
        check_positive(
            "rollout.",
            segment_s=self.segment_s,
            speed=self.speed,
            max_motion_s=self.max_motion_s,
        )
        _check_range("settle_s", self.settle_s, 60, " seconds")
        _check_range("hold_s", self.hold_s, 60, " seconds")

        if self.speed > 1:
            raise UsageError(
                f"rollout.speed is a share of the arm's limits, at most 1, got {self.speed}"
            )

        if self.penetration not in PENETRATION_MODES:
            raise choices("rollout.penetration", self.penetration, PENETRATION_MODES)


@dataclass(frozen=True, eq=False)
class Pushes:
    """What bodies push the tool with: N contact points, of all steps of a rollout.

    Attributes:
        samples: (N,) the number of the recording's instant that comes next.
        bodies: (N,) names.
        points: (N, 3) in the world.
        forces: (N, 3) on the tool, newtons: what the impulse adds to the mean since the instant before. Friction is in
            them if the engine tells it.
    """

    samples: npt.NDArray[np.int64]
    bodies: npt.NDArray[np.str_]
    points: Array
    forces: Array


@dataclass(frozen=True, eq=False)
class Recording:
    """A rollout over time: instants (T,) in seconds, arm joints (T, J), and states stacked over T.

    ``fingers`` (T, F + K) are the joints of the robot's F fingers, and then those of the tool (`Tool.bearers`).
    ``forces`` has, for each two things that touched, the mean of their normal force since the instant before, newtons
    (T,): an impulse divided by its time, which engines with different time steps agree on. Of two names the first is
    ``tool``, a link of the arm, or a body, the second a body; of two bodies the one that the scene lists first.
    ``pushes`` come with the forces; None: the engine does not tell where they act.
    """

    times: Array
    arm: Array
    fingers: Array
    states: State
    forces: Mapping[tuple[str, str], Array] = field(default_factory=dict)
    pushes: Pushes | None = None


@dataclass(frozen=True, eq=False)
class Outcome:
    """The result of a rollout: the states of its world after settling and at the end.

    ``tracking_error_rad`` is the largest lag of an arm joint behind its target. ``error`` says why the rollout failed;
    then the states are None. ``felt``: how guards ended.
    """

    start: State | None
    end: State | None
    tracking_error_rad: float = float("nan")
    error: str | None = None
    recording: Recording | None = None
    warnings: tuple[str, ...] = ()
    felt: tuple[Felt, ...] = ()


class World(ABC):
    """An engine's world with a scene and the robot, stepped by its caller (`core.simulation.playback`).

    An engine says how its world steps, and how joints and bodies stand. It says more if it can do more, or faster.
    """

    time_step: float

    @abstractmethod
    def step(
        self,
        arm: Array,
        fingers: float,
        speeds: Array,
        finger_speed: float,
    ) -> None:
        """Drive the joints to targets (J,) and a finger opening at these speeds, and advance by one time step."""

    @abstractmethod
    def joints(self) -> tuple[Array, Array]:
        """Return the arm's joints (J,), and the fingers' with the tool's (F + K,); see `Recording`."""

    @abstractmethod
    def state(self) -> State:
        """Return the state of the free bodies."""

    def launch(self) -> None:
        """Begin the robot's motion, once: `Body.velocity`, the time of each `Drive`, and the tool's joints are let go.

        By default nothing moves by itself.
        """
        return

    def note(self) -> Any:
        """Take a snapshot of the joints and free bodies, in the form that is fastest to get."""
        return *self.joints(), self.state()

    def read(self, notes: Sequence[Any]) -> tuple[Array, Array, State]:
        """Decode T snapshots: arm (T, J), fingers with the tool's joints (T, F + K), the free bodies' states."""
        arms, fingers, states = zip(*notes, strict=True)
        return np.array(arms), np.array(fingers), State.stack(states)

    def pushes(self) -> tuple[Array, Array]:
        """Return what pushed the links beyond the arm's last joint in the last step; plans with guards need it.

        Points (C, 3) in the world, metres, and the forces there (C, 3), newtons.
        """
        raise NotImplementedError("this engine does not say what pushes the arm")
