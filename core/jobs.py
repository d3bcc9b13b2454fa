"""Define what a simulator is handed and what it hands back: joint trajectories, rollouts, recordings and outcomes.

`core.interfaces` offers all of it under its own name as well.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from core.design import Tool
from core.errors import UsageError, check_positive, choices
from core.geometry import Array
from core.scene import State


@dataclass(frozen=True, eq=False)
class JointTrajectory:
    """What every engine plays: joint targets over time.

    ``times`` (T,) from 0, rising, in seconds; ``arm`` (T, 7) in radians; ``fingers`` (T,) how far each finger is from
    the middle, in metres (0 closed, 0.04 open). Between instants, and before and after, targets are linear and
    constant.
    """

    times: Array
    arm: Array
    fingers: Array

    @property
    def duration(self) -> float:
        return float(self.times[-1])

    def sample(self, times: Array) -> tuple[Array, Array]:
        """Arm targets (S, 7) and finger targets (S,) at instants (S,)."""
        arm = np.stack([np.interp(times, self.times, joint) for joint in self.arm.T], axis=-1)
        return arm, np.interp(times, self.times, self.fingers)


@dataclass(frozen=True, eq=False)
class Rollout:
    """One job for a simulator: spawn the scene of ``seed`` and the robot with ``tool`` at the trajectory's first
    targets, let ``settle_s`` pass, note the start state, play the trajectory, hold its last targets for ``hold_s``,
    note the end state.

    With ``record_hz`` > 0 the whole is recorded at that rate."""

    tool: Tool
    trajectory: JointTrajectory
    seed: int = 0
    settle_s: float = 0.5
    hold_s: float = 1.0
    record_hz: float = 0.0


PENETRATION_MODES = ("forbid", "warn", "ignore")


@dataclass
class RolloutSettings:
    """How a plan is executed: the least time of a segment, the pauses before and after the motion, the share of the
    arm's velocity and acceleration limits that is used, and the longest motion, beyond which a plan is rejected.

    ``penetration``: what a rollout earns in which solids passed through one another (see
    `core.simulation.penetration`). With ``forbid`` it earns nothing, with ``warn`` the task's reward; both add a
    warning. With ``ignore`` nothing is checked.
    """

    segment_s: float = 0.5
    settle_s: float = 0.5
    hold_s: float = 1.0
    speed: float = 0.95
    max_motion_s: float = 120.0
    penetration: str = "forbid"

    def __post_init__(self) -> None:
        check_positive("rollout.", segment_s=self.segment_s, speed=self.speed, max_motion_s=self.max_motion_s)
        for name, seconds in (("settle_s", self.settle_s), ("hold_s", self.hold_s)):
            if not 0 <= seconds <= 60:
                raise UsageError(f"rollout.{name} must be between 0 and 60 seconds, got {seconds}")
        if self.speed > 1:
            raise UsageError(f"rollout.speed is a share of the arm's limits, at most 1, got {self.speed}")
        if self.penetration not in PENETRATION_MODES:
            raise choices("rollout.penetration", self.penetration, PENETRATION_MODES)


@dataclass(frozen=True, eq=False)
class Recording:
    """A film without pictures: instants (T,) in seconds, arm joints (T, 7), fingers (T, 2), and the states, stacked
    over T.
    """

    times: Array
    arm: Array
    fingers: Array
    states: State


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a rollout did: states (one world) after settling and at the end, and the largest lag of an arm joint
    behind its target.

    ``error`` says how it broke, if it did; then the states are None.
    """

    start: State | None
    end: State | None
    tracking_error_rad: float = float("nan")
    error: str | None = None
    recording: Recording | None = None
    warnings: tuple[str, ...] = ()


class World(Protocol):
    """An engine's world with scene and robot in it, stepped from outside (`core.simulation.playback`)."""

    time_step: float

    def step(self, arm: Array, fingers: float, speeds: Array, finger_speed: float) -> None:
        """Drive the joints toward targets (7,) and a finger opening, which they approach at these speeds; then one
        time step.
        """
        ...

    def joints(self) -> tuple[Array, Array]:
        """Arm (7,) and fingers (2,) as they are; fingers are 0 where there are none."""
        ...

    def state(self) -> State:
        """Of the free bodies."""
        ...
