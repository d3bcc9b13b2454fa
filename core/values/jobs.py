"""Define how a rollout is played, and what comes of it: settings, guards, worlds, recordings and outcomes.

Plugins import all of it from `core.interfaces`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from core.errors import UsageError, check_positive, choices
from core.geometry import Array
from core.support.text import list_some
from core.values.grips import Gripped
from core.values.harmless import Harmless
from core.values.motions import JointTrajectory, Motion
from core.values.states import State

Forces = Mapping[tuple[str, str], Array]
"""Normal forces of two things, by their names; see `Recording`."""


class Felt(NamedTuple):
    """How a guard ended: at its waypoint (from 1), when (s), by what, and with what force at the flange (N)."""

    waypoint: int
    at_s: float
    fired: str  # touch, force or stall; empty: it never fired
    force_n: float

    def __str__(self) -> str:
        what = f"{self.fired} at" if self.fired else "never fired; reached at"
        return f"waypoint {self.waypoint}: {what} {self.at_s:.2f} s, with {self.force_n:.1f} N at the flange"


class Looked(NamedTuple):
    """What a look of a plan found out: its number (from 1), when (s), and after which waypoint (0: before the first).

    ``where`` says in which part of the plan it was, such as a round of a loop. ``hidden`` are the bodies that the
    camera could not see, which are taken to be where they were seen before. ``left`` says of each goal which of its
    bodies were seen out of place.
    """

    number: int
    at_s: float
    waypoint: int
    where: str = ""
    hidden: tuple[str, ...] = ()
    left: tuple[tuple[str, tuple[str, ...]], ...] = ()

    def __str__(self) -> str:
        from core.support.templates import fill_text  # imports Jinja

        return fill_text(_LOOKED, look=self, list_some=list_some)


_LOOKED = """\
look {{ look.number }} at {{ "%.2f" % look.at_s }} s
{%- if look.where %}, {{ look.where }}{% endif %}
{% for goal, names in look.left %}
{{- ": " if loop.first else "; " }}{{ goal }}: {% if names %}{{ list_some(names, 4) }} not{% else %}all{% endif %}
{{- " in place" }}
{%- endfor %}
{% if look.hidden %}{{ "; " if look.left else ": " }}hidden from the camera: {{ look.hidden | join(", ") }}{% endif %}
"""


@runtime_checkable
class Reactions(Protocol):
    """What feels and looks while a motion is played, and changes it; a plan makes it (`ActionPlan.make_reactions`).

    Attributes:
        felt: how guards ended so far.
        looked: what looks found out so far.
        problem: why the rest could not be planned; the motion ended there.
    """

    felt: tuple[Felt, ...]
    looked: tuple[Looked, ...]
    problem: str | None

    @property
    def feels(self) -> bool:
        """Whether any part of the plan has guards, so that the engine must say what pushes the arm."""

    @property
    def looks(self) -> bool:
        """Whether the plan looks again while it is carried out."""

    @property
    def motion(self) -> Motion:
        """The motion as it is planned now; after a rollout, as it was played."""

    @property
    def since(self) -> float:
        """From when on the arm feels for the next guard, seconds of the motion; inf: there is none left."""

    @property
    def looks_at(self) -> float:
        """When the scene is looked at next, seconds of the motion; inf: not before another guard, or never again."""

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

    def look(
        self, time: float, arm: Array, fingers: Array, state: State
    ) -> JointTrajectory | None:
        """Take what a camera could see at ``looks_at``: joints (J,), fingers (F + K,), and the free bodies' state.

        Returns the motion to go on with, the same up to ``time``; None: as before.
        """


FEEL_S = 0.01  # between two readings


class Ability(StrEnum):
    """What a job may need, and not every engine can do; an engine lists its own (`Simulator.supports`)."""

    GUARDS = "guards ('until') in a plan"
    LOOKS = "looks in a plan"
    TOOL_JOINTS = "joints in a tool"
    JOINTS = "joints in a scene"
    LAUNCHED_BODIES = "launched bodies"
    SOFT_BODIES = "soft bodies"
    FORCES = "forces of contacts"
    BONDS = "bonds that break"
    GRIPS = "tools that hold on to what they touch"
    LIGHT_BODIES = "bodies lighter than 0.2 g"
    FINE_STEPS = "steps so fine that small things don't fall through thin ones"
    # No job needs these: without, trials do not say torques, and are played from the start.
    TORQUES = "torques of motors"
    FORKS = "going on from a stored state"


@dataclass(unsafe_hash=True)
class Perception:
    """The noise of what plans see: standard deviations of x and y, metres, and of the yaw, radians.

    Attributes:
        position: of x and y, each.
        yaw: of the turn about the vertical.
        height: the most by which all heights of a layout are wrong for a plan, metres. They are wrong by the same.
        look_s: how long the arm stays where a plan looks again, seconds: to take a picture and find the bodies in it.
        camera: where the camera is when a plan looks again: ``fixed``, the task's, or in the ``hand``, from where what
            is near is seen better.
    """

    position: float = 0.0
    yaw: float = 0.0
    height: float = 0.0
    look_s: float = 0.5
    camera: Harmless[str] = "fixed"

    def __post_init__(self) -> None:
        for name in ("position", "yaw", "height"):
            _check_range(f"perception.{name}", getattr(self, name), 1)

        _check_range("perception.look_s", self.look_s, 10, " seconds")
        if self.camera not in CAMERAS:
            raise choices("rollout.perception.camera", self.camera, CAMERAS)


CAMERAS = ("fixed", "hand")


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

    penetration: Harmless[str] = "forbid"
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
    ``pushes`` come with the forces; None: the engine does not tell where they act. ``loads`` has the largest force on
    each bond of the scene since the instant before, over the engine's steps, newtons (T,): 0 once it is broken.
    """

    times: Array
    arm: Array
    fingers: Array
    states: State
    forces: Forces = field(default_factory=dict)
    pushes: Pushes | None = None
    loads: Mapping[str, Array] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Outcome:
    """The result of a rollout: the states of its world after settling and at the end.

    ``tracking_error_rad`` is the largest lag of an arm joint behind its target. ``error`` says why the rollout failed;
    then the states are None. ``felt``: how guards ended. ``looked``: what looks found out. ``gripped``: what
    the tool's grips held. ``torques`` (J,): the
    greatest that the arm's motors applied in a step of the motion, N m; None: the engine does not say. ``time_step``:
    of the engine, seconds; 0: it does not say. ``begins_s``: from when on it was played, seconds of the motion; until
    then it is that of a `Checkpoint`.
    """

    start: State | None
    end: State | None
    tracking_error_rad: float = float("nan")
    error: str | None = None
    recording: Recording | None = None
    warnings: tuple[str, ...] = ()
    felt: tuple[Felt, ...] = ()
    looked: tuple[Looked, ...] = ()
    gripped: tuple[Gripped, ...] = ()

    torques: Array | None = None
    time_step: float = 0.0
    begins_s: float = 0.0


class Order(NamedTuple):
    """What a step drives the joints to, in plain numbers, which most engines take.

    Attributes:
        arm: targets at the step's end (J,), radians.
        fingers: each finger's distance from the middle there, metres.
        speeds: at which the arm approaches its targets (J,).
        finger_speed: at which the fingers do.
    """

    arm: Sequence[float]
    fingers: float
    speeds: Sequence[float]
    finger_speed: float


@dataclass(frozen=True, eq=False)
class Block:
    """S steps that an engine takes in a row, and when the playback looks at the world meanwhile.

    Attributes:
        trajectory: the motion, which begins at 0 s.
        time_step: seconds.
        instants: when each step begins, and when the last one ends (S + 1,), seconds.
        begin: how many of the job's steps are done before.
        marks: after how many of the block's steps (1 to S, rising) a note of the world is taken.
        readings: after how many of them the arm feels what pushes it.
        measures: at which of the marks the torques of the arm's motors are read.
    """

    trajectory: JointTrajectory
    time_step: float
    instants: Array
    begin: int
    marks: Sequence[int] = ()
    readings: Sequence[int] = ()
    measures: Sequence[int] = ()

    def __len__(self) -> int:
        return len(self.instants) - 1

    @property
    def end(self) -> int:
        """How many of the job's steps are done after it."""
        return self.begin + len(self)

    @cached_property
    def _sampled(self) -> tuple[Array, Array]:
        return self.trajectory.sample(self.instants)

    @property
    def arm(self) -> Array:
        """The arm's targets at each instant (S + 1, J)."""
        return self._sampled[0]

    @property
    def fingers(self) -> Array:
        """The fingers' target at each instant (S + 1,)."""
        return self._sampled[1]

    @property
    def speeds(self) -> Array:
        """With which the arm approaches the target at each step's end (S, J)."""
        return np.asarray(np.diff(self.arm, axis=0) / self.time_step)

    @property
    def finger_speeds(self) -> Array:
        """With which the fingers do (S,)."""
        return np.asarray(np.diff(self.fingers) / self.time_step)

    @property
    def orders(self) -> Iterator[Order]:
        """What `World.step` takes, for each step; made one by one, since many lists would busy Python's collector."""
        return map(
            Order,
            map(np.ndarray.tolist, self.arm[1:]),
            self.fingers[1:].tolist(),
            map(np.ndarray.tolist, self.speeds),
            self.finger_speeds.tolist(),
        )

    def until(self, count: int) -> Block:
        """Return the block's first steps, during which nobody looks."""
        instants = self.instants[: count + 1]
        return Block(self.trajectory, self.time_step, instants, self.begin)


class Reading(NamedTuple):
    """What the arm feels at an instant: its joints (J,), and forces (C, 3) at points (C, 3)."""

    arm: Array
    points: Array
    forces: Array


class Passed(NamedTuple):
    """What came of a block.

    Attributes:
        notes: one for each of the block's marks, see `World.note`.
        readings: one for each of the block's readings.
        torques: the greatest that each motor of the arm applied in the steps that end at ``measures`` (J,), N m; None:
            there are none, or the engine does not say.
        error: why the world broke on the way; then the rest means nothing.
    """

    notes: Sequence[Any] = ()
    readings: Sequence[Reading] = ()
    torques: Array | None = None
    error: str | None = None


class World(ABC):
    """An engine's world with a scene and the robot, which `core.simulation.playback` plays a job in.

    An engine says how its world steps, and how joints and bodies stand: `step`, `joints` and `state`. It says more if
    it can do more (`launch`, `pushes`, `contact_forces`, `note_torques`), or faster (`note` with `read`,
    `advance`, and `save` with `restore`). What it can't do it leaves out of `Simulator.supports`.

    Attributes:
        time_step: seconds.
        rewinds: whether `save` and `restore` are fast. Then several readings of guards are played in one block.
        tells_torques: whether it has `note_torques`.
    """

    time_step: float
    rewinds: bool = False
    tells_torques: bool = False

    @abstractmethod
    def step(self, order: Order) -> None:
        """Drive the joints to targets, and advance by one time step."""

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

    def advance(self, block: Block) -> Passed:
        """Take the steps of a block, with notes at its marks, and readings."""
        notes = []
        readings = []
        torques: list[Any] = []
        marks = frozenset(block.marks)
        measures = frozenset(block.measures)
        looked = marks.union(block.readings)

        for done, order in enumerate(block.orders, start=1):
            self.step(order)
            if done not in looked:
                continue

            if done in marks:
                notes.append(self.note())
            if self.tells_torques and done in measures:
                torques.append(self.note_torques())
            if done in block.readings:
                readings.append(Reading(self.joints()[0], *self.pushes()))

        greatest = None
        if torques:
            greatest = np.abs(self.read_torques(torques)).max(axis=0)

        return Passed(notes, readings, greatest)

    def save(self) -> Any:
        """Return how the world is now, after its launch, with all that it has measured so far."""
        raise NotImplementedError("this engine does not go back")

    def restore(self, saved: Any) -> None:
        """Go on from how a world was when it was saved: this one, or another one of the same scene and tool."""
        raise NotImplementedError("this engine does not go back")

    def note(self) -> Any:
        """Take a snapshot of the joints and free bodies, in the form that is fastest to get."""
        return *self.joints(), self.state()

    def read(self, notes: Sequence[Any]) -> tuple[Array, Array, State]:
        """Decode T snapshots: arm (T, J), fingers with the tool's joints (T, F + K), the free bodies' states."""
        arms, fingers, states = zip(*notes, strict=True)
        return np.array(arms), np.array(fingers), State.stack(states)

    def contact_forces(
        self, notes: Sequence[Any], instants: Array
    ) -> tuple[Forces, Pushes | None]:
        """Return ``forces`` and ``pushes`` of a `Recording`, from its snapshots and their instants (T,), seconds.

        It is asked for after a job with `Rollout.forces`.
        """
        raise NotImplementedError("this engine does not measure the forces of contacts")

    def loads(self, notes: Sequence[Any]) -> Mapping[str, Array]:
        """Return ``loads`` of a `Recording`, from its snapshots; none where the world has no bonds."""
        return {}

    def grips(self) -> tuple[Gripped, ...]:
        """Return what the tool's grips did; none where it has none."""
        return ()

    def note_torques(self) -> Any:
        """Take a snapshot of what the arm's motors applied in the last step; it is taken right after a `note`.

        They are whole torques: what bears the arm's own weight and turns the motors' inertia is in them. By default it
        is the torques (J,), N m; what is faster to get is decoded by `read_torques`.
        """
        raise NotImplementedError("this engine does not say what motors apply")

    def read_torques(self, notes: Sequence[Any]) -> Array:
        """Decode S snapshots: torques (S, J), N m."""
        return np.array(notes)

    def pushes(self) -> tuple[Array, Array]:
        """Return what pushed the links beyond the arm's last joint in the last step; plans with guards need it.

        Points (C, 3) in the world, metres, and the forces there (C, 3), newtons.
        """
        raise NotImplementedError("this engine does not say what pushes the arm")


class Worlds(ABC):
    """Several worlds that an engine steps together, each with a job of its own; its methods are those of `World`.

    They are stepped in lockstep: a block is as long for each of them, but for those whose job ends within it, and they
    settle for equally many steps. A world whose job is over gets blocks of no steps.
    """

    time_step: float
    rewinds: bool = False

    @abstractmethod
    def launch(self) -> None:
        """Begin the motions."""

    @abstractmethod
    def advance(self, blocks: Sequence[Block]) -> list[Passed]:
        """Take the steps of a block in each world."""

    @abstractmethod
    def note(self) -> list[Any]:
        """Take a snapshot of each world."""

    @abstractmethod
    def read(self, number: int, notes: Sequence[Any]) -> tuple[Array, Array, State]:
        """Decode T snapshots of one of the worlds."""

    def contact_forces(
        self, number: int, notes: Sequence[Any], instants: Array
    ) -> tuple[Forces, Pushes | None]:
        """Return the contact forces of one of the worlds."""
        raise NotImplementedError("this engine does not measure the forces of contacts")

    def loads(self, number: int, notes: Sequence[Any]) -> Mapping[str, Array]:
        """Return the largest forces on the bonds of one of the worlds."""
        return {}

    def grips(self, number: int) -> tuple[Gripped, ...]:
        """Return what the grips of the tool in one of the worlds did."""
        return ()

    def save(self) -> Any:
        """Return how the worlds are now."""
        raise NotImplementedError("this engine does not go back")

    def restore(self, saved: Any) -> None:
        """Return to how they were."""
        raise NotImplementedError("this engine does not go back")


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """A rollout that was stopped on its way. Others with the same beginning go on from there.

    Attributes:
        time_step: of the engine, seconds.
        settle: how many steps let the world settle.
        done: how many steps are done.
        targets: of the arm (S, J) and the fingers (S,), when steps begin and the last one ends.
        expected: what the reactions were waiting for, and what they had found out.
        heard: what the reactions were given, in order: the name of a method, and its arguments.
        notes: of the world, by how many steps were done.
        torques: the greatest of each block.
        world: see `World.save`.
    """

    time_step: float
    settle: int
    done: int
    targets: tuple[Array, Array]
    expected: tuple[object, ...]
    heard: Sequence[tuple[str, tuple[Any, ...]]]
    notes: Mapping[int, Any]
    torques: Sequence[Array]
    world: Any
