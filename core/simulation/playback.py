"""A job played in one world: settle, move, hold. The same for every engine that steps one world at a time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np

from core.geometry import Array
from core.interfaces import JointTrajectory, Outcome, Recording, Rollout, World
from core.scene import State

LAG_EVERY = 10  # steps between two looks at how far the arm is behind


@runtime_checkable
class Following(World, Protocol):
    """A world that takes the orders for many steps at once, and whose notes are read together, so that they cost less
    each.
    """

    def follow(self, arm: Array, fingers: Array, speeds: Array, finger_speeds: Array) -> Iterator[None]:
        """As many calls of `step`, one whenever the iterator is asked for the next: arm (S, 7), fingers (S,), speeds
        (S, 7), finger speeds (S,).
        """
        ...

    def note(self) -> Any:
        """Joints and free bodies as they are, in the form that is had fastest."""
        ...

    def read(self, notes: Sequence[Any]) -> tuple[Array, Array, State]:
        """Of T notes: arm (T, 7), fingers (T, 2), the free bodies' states."""
        ...


def play(world: World, job: Rollout) -> Outcome:
    """Settle, move, hold."""
    trajectory, dt = job.trajectory, world.time_step
    if not (np.isfinite(trajectory.arm).all() and np.isfinite(trajectory.fingers).all()):
        return Outcome(None, None, error="the trajectory's targets are not finite")
    settle, times = schedule(job, dt)
    every = record_every(job, dt)
    arm, fingers, speeds, finger_speeds = targets(trajectory, times, dt)

    instants, notes = [], []
    note = world.note if isinstance(world, Following) else lambda: (*world.joints(), world.state())
    start = world.state() if settle == 0 else None
    reached: list[Array] = []
    steps = _steps(world, arm, fingers, speeds, finger_speeds)
    for k in range(len(times)):
        if every and k % every == 0:
            instants.append(float(times[k]))
            notes.append(note())
        next(steps)
        if k == settle - 1:
            start = world.state()
        if k >= settle and k % LAG_EVERY == 0:
            reached.append(world.joints()[0])
    if every:
        instants.append(float(times[-1] + dt))
        notes.append(note())
    end = world.state()
    wanted = arm[-(-settle // LAG_EVERY) * LAG_EVERY :: LAG_EVERY]
    lag = float(np.abs(np.array(reached) - wanted).max()) if reached else 0.0
    if not all(np.isfinite(x).all() for x in (end.positions, end.quaternions, end.linear_velocities)):
        return Outcome(None, None, error="the simulation blew up: a body's state is not finite")
    recording = Recording(np.array(instants), *_read(world, notes)) if notes else None
    return Outcome(start, end, lag, recording=recording)


def _steps(world: World, arm: Array, fingers: Array, speeds: Array, finger_speeds: Array) -> Iterator[None]:
    if isinstance(world, Following):
        yield from world.follow(arm, fingers, speeds, finger_speeds)
        return
    for order in zip(arm, fingers.tolist(), speeds, finger_speeds.tolist(), strict=True):
        world.step(*order)
        yield


def schedule(job: Rollout, dt: float) -> tuple[int, Array]:
    """The number of steps that settle, and the instants (S,) at which steps begin; 0 is the motion's first."""
    settle, hold = round(job.settle_s / dt), round(job.hold_s / dt)
    moving = int(np.ceil(job.trajectory.duration / dt))
    return settle, np.arange(-settle, moving + hold, dtype=np.float64) * dt


def record_every(job: Rollout, dt: float) -> int:
    """The number of steps between two instants of a recording; 0 without one."""
    return max(1, round(1 / (job.record_hz * dt))) if job.record_hz > 0 else 0


def targets(trajectory: JointTrajectory, times: Array, dt: float) -> tuple[Array, Array, Array, Array]:
    """Targets at the end of each of the steps that begin at ``times`` (S,), one after another, and the speeds that lead
    there: arm (S, 7), fingers (S,), arm speeds (S, 7), finger speeds (S,).
    """
    arm, fingers = trajectory.sample(np.append(times, times[-1:] + dt))
    return arm[1:], fingers[1:], np.diff(arm, axis=0) / dt, np.diff(fingers) / dt


def _read(world: World, notes: Sequence[Any]) -> tuple[Array, Array, State]:
    if isinstance(world, Following):
        return world.read(notes)
    arms, fingers, states = zip(*notes, strict=True)
    return np.array(arms), np.array(fingers), State.stack(states)
