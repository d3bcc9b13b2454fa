"""Carry out a plan that feels or looks, a move at a time: what the arm does next, from what was felt and seen.

The same `Policy` says so to a real arm (`plugins.results.workshop.carrying`) and to an engine
(`plugins.results.workshop.dry_run`). Each move ends at rest, at the next guard or look, or at the plan's end.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from core.design import Candidate, DesignError, Tool
from core.geometry import Array, Pose
from core.interfaces import (
    Begin,
    Guard,
    JointTrajectory,
    Look,
    Motion,
    Robot,
    RolloutSettings,
    Sighted,
    Task,
    Tempo,
    Waypoints,
)
from core.robot.feeling import Watch
from core.robot.kinematics import Arm, arm_of
from core.scene import Scene
from core.simulation.attempt import plan_on
from core.trial import Part
from plugins.results.workshop.motion import STEP_S, Sampled, sample

Resolve = Callable[[tuple[Pose | None, ...], tuple[Sighted, ...]], Waypoints]
"""Says what a plan means, from where guards ended and what looks saw; see `core.interfaces.Seen`."""


@dataclass(frozen=True, eq=False)
class Move:
    """A motion of the arm from rest to rest.

    Attributes:
        samples: the motion, at a fixed rate.
        motion: through its waypoints, as it is planned.
        arrivals: when the samples reach each of them (K,), seconds.
        since_s: from when on the arm feels, seconds.
        watch: watches for the guard that ends the move; None: it has none.
    """

    samples: Sampled
    motion: Motion
    arrivals: Array
    since_s: float = 0.0
    watch: Watch | None = None

    @property
    def guard(self) -> Guard | None:
        """What ends the move before its time."""
        return self.watch.guard if self.watch else None

    @cached_property
    def trajectory(self) -> JointTrajectory:
        """The samples as engines play them."""
        return self.samples.trajectory

    def has_fired(self, time: float, joints: Array, force: Array) -> bool:
        """Take a reading, and report whether the arm must stop now.

        Args:
            time: of the move, seconds.
            joints: where the arm is (J,), radians.
            force: (3,) with which the flange is pushed, in the world, newtons.
        """
        if self.watch is None or time < self.since_s:
            return False

        return self.watch.has_fired(self.trajectory, time, joints, force)


class Stopped(NamedTuple):
    """Where a guard ended a move.

    Attributes:
        joints: at which the arm rests then (J,), radians.
        time: of the move, seconds.
    """

    joints: Array
    time: float


@dataclass(frozen=True)
class ExportedPlan:
    """A plan that feels or looks, as it is exported, to be carried out by any arm or engine.

    Attributes:
        task: the part that makes it, with the robot.
        candidate: the tool and the plan.
        layout: its seed; fixed bodies and marks stand as there, unless they are seen elsewhere.
        settings: how plans are executed.
        rate_hz: of the samples.
        speed: the share of the planned speed.
    """

    task: Part[Task]
    candidate: Candidate
    layout: int
    settings: RolloutSettings
    rate_hz: float
    speed: float = 1.0

    @property
    def tool(self) -> Tool:
        """What the arm holds."""
        assert self.candidate.tool is not None
        return self.candidate.tool

    @property
    def robot(self) -> Robot:
        return self.task.shared().robot

    @property
    def arm(self) -> Arm:
        return arm_of(self.robot)

    @property
    def scene(self) -> Scene:
        """The layout for which it was exported."""
        return self.task.shared().scene(self.layout).furnished(self.tool)

    def sample(self, trajectory: JointTrajectory) -> Sampled:
        """Sample a motion for the arm."""
        return sample(trajectory, self.arm, self.rate_hz, self.speed)

    def check_time(self, seconds: float) -> None:
        """Refuse a motion that comes to take too long.

        Raises:
            DesignError: with the figures.
        """
        most = self.settings.max_motion_s / self.speed
        if seconds > most:
            raise DesignError(
                f"the motion comes to take {seconds:.0f} s; at most {most:.0f} s are allowed"
            )


class Policy:
    """A plan on its way: call `begin`, then `moved` after each move, and `saw` after each look.

    Each returns what comes next: a `Move`, a `Look`, or None where the plan ends.

    Args:
        resolve: says what the plan means.
        exported: how moves are planned.

    Attributes:
        problem: why the rest could not be planned; the plan ended there.
        felt: what ended each guard so far.
        looks: what was seen by each look so far.
        seconds: how long the moves take, all together.
    """

    def __init__(self, resolve: Resolve, exported: ExportedPlan) -> None:
        self.problem: str | None = None
        self.felt: tuple[Pose | None, ...] = ()
        self.looks: tuple[Sighted, ...] = ()
        self.seconds = 0.0
        self._resolve = resolve
        self._exported = exported
        self._done = 0  # waypoints
        self._begin: Begin | None = None
        self._wait_s = 0.0

    def begin(self) -> Move:
        """Plan the first move.

        Raises:
            DesignError: the plan means nothing here.
        """
        self._waypoints = self._resolve((), ())
        self._move = self._plan_move()
        return self._move

    def moved(self, stopped: Stopped | None) -> Move | Look | None:
        """Take how a move ended; None: it came to its end."""
        move = self._move
        first = self._done
        self._done += len(move.arrivals)
        self._begin = self._rest_at(move, stopped)
        self.seconds += stopped.time if stopped else move.trajectory.duration

        if move.guard is None:
            return self._go_on()
        if stopped is None and move.guard.otherwise == "end":
            return None

        reached = None
        if stopped is not None:
            reached = self._exported.arm.forward(stopped.joints)
            self._wait_s = float(self._tempo.waits[first + len(move.arrivals) - 1])

        self.felt = (*self.felt, reached)
        return self._go_on()

    def saw(self, seen: Sighted) -> Move | Look | None:
        """Take what a look saw."""
        self.looks = (*self.looks, seen)
        return self._go_on()

    def _go_on(self) -> Move | Look | None:
        """Say what comes next, by what is known now."""
        try:
            self._waypoints = self._resolve(self.felt, self.looks)
            if self._done < len(self._waypoints):
                self._move = self._plan_move()
                return self._move
        except DesignError as error:
            self.problem = f"after waypoint {self._done}: {error}"
            return None

        taken = len(self.looks)
        if taken < len(self._waypoints.looks):
            return self._waypoints.looks[taken]

        return None

    @property
    def _tempo(self) -> Tempo:
        return self._waypoints.tempo or Tempo.usual(len(self._waypoints))

    def _rest_at(self, move: Move, stopped: Stopped | None) -> Begin:
        """Return where the arm and the fingers rest after a move."""
        trajectory = move.trajectory
        joints = trajectory.arm[-1]
        fingers = float(trajectory.fingers[-1])
        if stopped is not None:
            joints = stopped.joints
            fingers = float(trajectory.sample(np.array([stopped.time]))[1][0])

        opening = self._exported.robot.opening_m
        grip = 1 - fingers / opening if opening else 0.0
        return Begin(joints, grip)

    def _plan_move(self) -> Move:
        """Plan the way through the next waypoints, up to one with a guard."""
        exported = self._exported
        waypoints = self._waypoints
        guards = waypoints.guards or (None,) * len(waypoints)
        numbers = range(self._done, len(waypoints))
        last = next((k for k in numbers if guards[k]), len(waypoints) - 1)
        part = slice(self._done, last + 1)
        tempo = {name: array[part] for name, array in vars(self._tempo).items()}

        motion = plan_on(
            exported.task.shared(),
            exported.tool,
            exported.settings,
            Waypoints(waypoints.poses[part], Tempo(**tempo)),
            self._begin,
        )
        wait_s = self._wait_s
        self._wait_s = 0.0
        samples = exported.sample(_wait_first(motion.trajectory, wait_s))
        exported.check_time(self.seconds + samples.trajectory.duration)

        def when(seconds: float) -> float:
            return samples.slower * (seconds + wait_s + STEP_S)

        arrivals = np.array([when(seconds) for seconds in motion.arrivals.tolist()])
        guard = guards[last]
        if guard is None:
            return Move(samples, motion, arrivals)

        since_s = samples.slower * wait_s
        if last > self._done:
            since_s = when(float(motion.arrivals[-2] + tempo["waits"][-2]))

        watch = Watch(guard, exported.arm, exported.settings.feel)
        return Move(samples, motion, arrivals, since_s, watch)


def _wait_first(trajectory: JointTrajectory, seconds: float) -> JointTrajectory:
    """Stay at the first targets for some time."""
    if seconds <= 0:
        return trajectory

    times = np.append(0.0, trajectory.times + seconds)
    arm = np.vstack([trajectory.arm[:1], trajectory.arm])
    fingers = np.append(trajectory.fingers[:1], trajectory.fingers)
    return JointTrajectory(times, arm, fingers)
