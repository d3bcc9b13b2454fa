"""Play a job in one world: settle, move, hold. Shared by all engines that step one world at a time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, Protocol, cast, runtime_checkable

import numpy as np

from core.geometry import Array
from core.interfaces import JointTrajectory, Outcome, Recording, Rollout, World
from core.scene import State
from core.values.jobs import FEEL_S, FeelingWorld

LAG_EVERY = 10  # steps between two measurements of the arm's lag


@runtime_checkable
class BulkWorld(World, Protocol):
    """A world that prepares the orders of many steps at once, and decodes many snapshots at once, which is faster."""

    def orders(
        self, arm: Array, fingers: Array, speeds: Array, finger_speeds: Array
    ) -> Sequence[Any]:
        """Make of what `step` takes, for S steps (S, ...), the S orders that `obey` takes."""
        ...

    def obey(self, order: Any) -> None:
        """Take one step as ordered."""
        ...

    def note(self) -> Any:
        """Take a snapshot of the joints and free bodies, in the form that is fastest to get."""
        ...

    def read(self, notes: Sequence[Any]) -> tuple[Array, Array, State]:
        """Decode T snapshots: arm (T, J), fingers with the tool's joints (T, F + K), the free bodies' states."""
        ...


@runtime_checkable
class Launching(World, Protocol):
    """A world in which something moves by itself once the robot's motion begins."""

    def launch(self) -> None:
        """Give bodies their velocities, begin the time of drives, and let the tool's joints go."""


def play(world: World, job: Rollout) -> Outcome:
    """Play a job: settle, move, hold. A job with guards needs a `core.values.jobs.FeelingWorld`."""
    job, guards, dt = begun(job), job.guards, world.time_step
    trajectory = job.trajectory
    if not (
        np.isfinite(trajectory.arm).all() and np.isfinite(trajectory.fingers).all()
    ):
        return Outcome(None, None, error="the trajectory's targets are not finite")
    settle, times = schedule(job, dt)
    every, tick = record_every(job, dt), feel_every(dt)
    arm, *others = targets(trajectory, times, dt)
    orders = _orders(world, arm, others)

    instants, notes = [], []
    note = (
        world.note
        if isinstance(world, BulkWorld)
        else lambda: (*world.joints(), world.state())
    )
    step = (
        world.obey if isinstance(world, BulkWorld) else lambda order: world.step(*order)
    )
    start = begin_motion(world) if settle == 0 else None
    reached: list[Array] = []
    k = -1
    while (order := next(orders, None)) is not None:
        k += 1
        if every and k % every == 0:
            instants.append(float(times[k]))
            notes.append(note())
        step(order)
        if k == settle - 1:
            start = begin_motion(world)
        if k >= settle and k % LAG_EVERY == 0:
            reached.append(world.joints()[0])
        if (
            guards is not None
            and (k + 1 - settle) % tick == 0
            and times[k] + dt >= guards.since
        ):
            changed = guards.feel(
                float(times[k] + dt),
                world.joints()[0],
                *cast(FeelingWorld, world).pushes(),
            )
            if changed is not None:
                _, times = schedule(replace(job, trajectory=changed), dt)
                arm, *others = targets(changed, times, dt)
                orders = _orders(world, arm, others, k + 1)
    if every:
        instants.append(float(times[-1] + dt))
        notes.append(note())
    end = world.state()
    wanted = arm[-(-settle // LAG_EVERY) * LAG_EVERY :: LAG_EVERY]
    lag = float(np.abs(np.array(reached) - wanted).max()) if reached else 0.0
    if not all(
        np.isfinite(x).all()
        for x in (end.positions, end.quaternions, end.linear_velocities)
    ):
        return Outcome(
            None, None, error="the simulation blew up: a body's state is not finite"
        )
    recording = Recording(np.array(instants), *_read(world, notes)) if notes else None
    return Outcome(
        start, end, lag, recording=recording, felt=guards.felt if guards else ()
    )


def begun(job: Rollout) -> Rollout:
    """Let a job's guards begin anew."""
    return replace(job, trajectory=job.guards.begin()) if job.guards else job


def feel_every(dt: float) -> int:
    """Count the steps between two readings of guards."""
    return max(1, round(FEEL_S / dt))


def _orders(
    world: World, arm: Array, others: Sequence[Array], begin: int = 0
) -> Iterator[Any]:
    """What is asked of each step, from step ``begin`` on."""
    fingers, speeds, finger_speeds = (array[begin:] for array in others)
    if isinstance(world, BulkWorld):
        return iter(world.orders(arm[begin:], fingers, speeds, finger_speeds))
    return zip(
        arm[begin:], fingers.tolist(), speeds, finger_speeds.tolist(), strict=True
    )


def begin_motion(world: World) -> State:
    """Begin the motion, and return the state there."""
    if isinstance(world, Launching):
        world.launch()
    return world.state()


def schedule(job: Rollout, dt: float) -> tuple[int, Array]:
    """Count the settling steps, and list the times (S,) at which steps begin; the motion begins at 0."""
    settle, hold = round(job.settle_s / dt), round(job.hold_s / dt)
    moving = int(np.ceil(job.trajectory.duration / dt))
    return settle, np.arange(-settle, moving + hold, dtype=np.float64) * dt


def record_every(job: Rollout, dt: float) -> int:
    """Count the steps between two samples of a recording; 0 without one."""
    return max(1, round(1 / (job.record_hz * dt))) if job.record_hz > 0 else 0


def targets(
    trajectory: JointTrajectory, times: Array, dt: float
) -> tuple[Array, Array, Array, Array]:
    """Sample the targets at the end of each step, and the speeds that lead there.

    Steps begin at ``times`` (S,). Returns arm (S, 7), fingers (S,), arm speeds (S, 7) and finger speeds (S,).
    """
    arm, fingers = trajectory.sample(np.append(times, times[-1:] + dt))
    return arm[1:], fingers[1:], np.diff(arm, axis=0) / dt, np.diff(fingers) / dt


def _read(world: World, notes: Sequence[Any]) -> tuple[Array, Array, State]:
    if isinstance(world, BulkWorld):
        return world.read(notes)
    arms, fingers, states = zip(*notes, strict=True)
    return np.array(arms), np.array(fingers), State.stack(states)
