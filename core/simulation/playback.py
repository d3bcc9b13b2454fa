"""Play a job: settle, move, hold. All engines share the schedule; those that step one world share `play` too."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from core.geometry import Array
from core.interfaces import Outcome, Recording, Rollout, World
from core.scene import State
from core.values.jobs import FEEL_S

LAG_EVERY = 10  # steps between two measurements of the arm's lag

Film = tuple[Array, Array, State]  # arm, fingers and states of a `Recording`


class Schedule:
    """When an engine with a time step does what while it plays a job. The motion begins at 0, seconds.

    `play` steps one world by it. An engine that steps many at once reads the same schedule, so that all engines let the
    world settle, record and measure at the same instants.

    Attributes:
        job: what is played.
        time_step: of the engine, seconds.
        settle: how many steps let the world settle.
        times: (S,) when steps begin; ``ends`` (S,) when they end.
        every: the steps between two samples of a recording; 0 without one.
        samples: (T,) how many steps are done at each sample, the last of them all.
        looks: (L,) the steps after which the arm's lag is measured.
        tick: the steps between two readings of guards.
    """

    def __init__(self, job: Rollout, time_step: float) -> None:
        self.job = job
        self.time_step = time_step
        self.settle = round(job.settle_s / time_step)
        moving = int(np.ceil(job.trajectory.duration / time_step))
        count = self.settle + moving + round(job.hold_s / time_step)
        steps = np.arange(-self.settle, count - self.settle, dtype=np.float64)
        self.times: Array = steps * time_step
        self.ends: Array = self.times + time_step
        self.every = 0
        self.samples = np.empty(0, dtype=int)

        if job.record_hz > 0:
            self.every = max(1, round(1 / (job.record_hz * time_step)))
            self.samples = np.append(np.arange(0, count, self.every), count)

        first = -(-self.settle // LAG_EVERY) * LAG_EVERY
        self.looks = np.arange(first, count, LAG_EVERY)
        self.tick = max(1, round(FEEL_S / time_step))

    def targets(self) -> tuple[Array, Array, Array, Array]:
        """Sample the targets at the end of each step, and the speeds that lead there.

        Returns arm (S, 7), fingers (S,), arm speeds (S, 7) and finger speeds (S,).
        """
        arm, fingers = self.job.trajectory.sample(np.append(self.times, self.ends[-1:]))
        speeds = np.diff(arm, axis=0) / self.time_step

        return arm[1:], fingers[1:], speeds, np.diff(fingers) / self.time_step

    def orders(self) -> list[tuple[Array, float, Array, float]]:
        """Return what `World.step` takes, for each step."""
        arm, fingers, speeds, finger_speeds = self.targets()
        steps = zip(arm, fingers.tolist(), speeds, finger_speeds.tolist(), strict=True)

        return list(steps)

    def measure_lag(self, arm: Array) -> float:
        """Measure the largest lag of a joint.

        Args:
            arm: its joints (L, J) after the ``looks``.

        Returns:
            The lag, radians.
        """
        wanted, _ = self.job.trajectory.sample(self.ends[self.looks])
        return float(np.abs(wanted - np.reshape(arm, wanted.shape)).max(initial=0.0))

    def conclude(
        self,
        start: State | None,
        end: State,
        lag: float,
        film: Film | None = None,
    ) -> Outcome:
        """Make the outcome of what was played.

        Args:
            start: the state when the motion began.
            end: the state at the end.
            lag: see `measure_lag`.
            film: what was seen at the samples, if the job is recorded.

        Returns:
            The outcome; it has an error if the end is not finite.
        """
        if not all(np.isfinite(array).all() for array in end.arrays[:3]):
            error = "the simulation blew up: a body's state is not finite"
            return Outcome(None, None, error=error)

        recording = None
        if film is not None:
            instants = np.append(self.times, self.ends[-1])[self.samples]
            recording = Recording(instants, *film)

        felt = self.job.guards.felt if self.job.guards else ()
        return Outcome(start, end, lag, recording=recording, felt=felt)


def begin_motion(world: World) -> State:
    """Begin the motion, and return the state there."""
    world.launch()
    return world.state()


def begin_guards(job: Rollout) -> Rollout:
    """Let a job's guards begin anew."""
    return replace(job, trajectory=job.guards.begin()) if job.guards else job


def refuse_targets(job: Rollout) -> Outcome | None:
    """Refuse a job whose targets are not finite, before an engine sees it.

    Returns:
        Its outcome; None: they are finite.
    """
    targets = np.column_stack([job.trajectory.arm, job.trajectory.fingers])
    if np.isfinite(targets).all():
        return None

    return Outcome(None, None, error="the trajectory's targets are not finite")


def play(world: World, job: Rollout) -> Outcome:
    """Play a job: settle, move, hold.

    Args:
        world: with the scene, and with the robot at the first targets.
        job: what is played.
    """
    job = begin_guards(job)
    refused = refuse_targets(job)

    if refused is not None:
        return refused

    schedule = Schedule(job, world.time_step)
    orders = schedule.orders()
    start = begin_motion(world) if schedule.settle == 0 else None
    notes: list[Any] = []
    reached: list[Array] = []
    done = 0  # steps

    while done < len(orders):
        if schedule.every and done % schedule.every == 0:
            notes.append(world.note())

        world.step(*orders[done])
        now = float(schedule.ends[done])
        if done >= schedule.settle and done % LAG_EVERY == 0:
            reached.append(world.joints()[0])

        done += 1
        if done == schedule.settle:
            start = begin_motion(world)

        due = (done - schedule.settle) % schedule.tick == 0
        if job.guards is None or not due or now < job.guards.since:
            continue

        changed = job.guards.feel(now, world.joints()[0], *world.pushes())
        if changed is not None:
            schedule = Schedule(replace(job, trajectory=changed), world.time_step)
            orders = schedule.orders()

    film = None
    if schedule.every:
        film = world.read([*notes, world.note()])

    lag = schedule.measure_lag(np.array(reached))
    return schedule.conclude(start, world.state(), lag, film)
