"""Play jobs: settle, move, hold. Every engine is played by this loop, whatever it can do.

A job is cut into *blocks* of steps, between the instants at which something may change. An engine steps a block and
takes notes of its world on the way. One that steps a world at a time is a `World`, one that steps many in lockstep has
`Worlds`.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from core.geometry import Array
from core.interfaces import (
    Block,
    Checkpoint,
    JointTrajectory,
    Outcome,
    Passed,
    Pushes,
    Recording,
    Rollout,
    World,
    Worlds,
)
from core.scene import State
from core.values.grips import Gripped
from core.values.jobs import FEEL_S

MEASURE_EVERY = 10  # steps between two measurements of the arm's lag and torques
_SAME_S = 1e-9  # between instants that are the same but for rounding
_AHEAD = 8  # readings of guards that are played in a block where the world rewinds


class Schedule:
    """What happens after which step of a job, in an engine with a time step. The motion begins at 0, seconds.

    Attributes:
        job: what is played.
        time_step: of the engine, seconds.
        settle: how many steps let the world settle.
        count: how many there are in all, S.
        ends: (S,) when steps end.
        instants: (S + 1,) when steps begin, and the last one ends.
        samples: (T,) how many steps are done at each instant of the recording, the last of them all; or none.
        measures: after how many steps the arm's lag and torques are measured, rising; while it moves, and not before.
        marks: after how many steps a note of the world is needed, rising.
        tick: the steps between two readings of guards.
        targets: of the joints.

    Args:
        job: what is played.
        time_step: of the engine, seconds.
    """

    def __init__(self, job: Rollout, time_step: float) -> None:
        self.job = job
        self.time_step = time_step
        self.settle = round(job.settle_s / time_step)
        moving = int(np.ceil(job.trajectory.duration / time_step))
        self.count = self.settle + moving + round(job.hold_s / time_step)

        steps = np.arange(-self.settle, self.count - self.settle, dtype=np.float64)
        begins = steps * time_step
        self.ends: Array = begins + time_step
        end = (
            self.ends[-1] if self.count else 0.0
        )  # a job of less than half a step has none
        self.instants: Array = np.append(begins, end)

        self.samples = np.empty(0, dtype=int)
        if job.record_hz > 0:
            every = max(1, round(1 / (job.record_hz * time_step)))
            self.samples = np.append(np.arange(0, self.count, every), self.count)

        # At multiples, where most recordings have their samples, too: a note serves both.
        first = (self.settle // MEASURE_EVERY + 1) * MEASURE_EVERY
        self.measures = range(first, self.count + 1, MEASURE_EVERY)
        self.marks = sorted({*self.samples.tolist(), *self.measures, self.count})
        self.tick = max(1, round(FEEL_S / time_step))

    def find_step(self, instant: float) -> int:
        """Return how many steps are done at an instant of the motion, seconds; at the end of the job all are."""
        return bisect_left(self.instants, instant - _SAME_S, self.settle, self.count)

    def block(self, begin: int, end: int, readings: Sequence[int] = ()) -> Block:
        """Make the block of the steps from one to another, with its marks.

        Args:
            begin: how many steps are done before.
            end: how many are done after it.
            readings: after how many of its steps the arm feels.
        """

        def list_within(steps: Sequence[int]) -> list[int]:
            within = slice(bisect_right(steps, begin), bisect_right(steps, end))
            return [step - begin for step in steps[within]]

        return Block(
            self.job.trajectory,
            self.time_step,
            self.instants[begin : end + 1],
            begin,
            list_within(self.marks),
            readings,
            list_within(self.measures),
        )

    def measure_lag(self, arm: Array) -> float:
        """Measure the largest lag of a joint, radians, from its positions (L, J) after the ``measures``."""
        measured = np.array(self.measures, dtype=int)
        wanted, _ = self.job.trajectory.sample(self.ends[measured - 1])
        return float(np.abs(wanted - np.reshape(arm, wanted.shape)).max(initial=0.0))


class Player:
    """Follows a job's schedule: which steps come next, and what was seen after which.

    Args:
        job: what is played.
        time_step: of the engine, seconds.
        ahead: how many readings of guards are played at once, beside the next one.

    Attributes:
        schedule: as guards and looks have changed it so far.
        done: how many steps are done.
        stop: it ends after so many steps at most, where a reading would be; None: with the job.
        error: why the world broke, if it did.
    """

    def __init__(self, job: Rollout, time_step: float, ahead: int = 0) -> None:
        self.schedule = Schedule(job, time_step)
        self.done = 0
        self.stop: int | None = None
        self.error: str | None = None
        self._ahead = ahead
        self._begins_s = 0.0

        self._heard: list[tuple[str, tuple[Any, ...]]] = []
        self._torques: list[Array] = []
        self._notes: dict[int, Any] = {}  # by the number of steps that are done

    def settling(self) -> Block:
        """Return the steps before the motion begins."""
        return self.schedule.block(0, self.schedule.settle)

    def begin(self, first: Any, settled: Passed, now: Any) -> None:
        """Take what came of settling.

        Args:
            first: a note of the world before the first step.
            settled: what came of the steps.
            now: a note of the world after `World.launch`.
        """
        self._notes[0] = first
        block = self.settling()
        self._keep(block, settled, len(block))
        self.done = self.schedule.settle
        self._notes[self.done] = now

    def next_block(self) -> Block:
        """Return the next steps; none: the job is over."""
        schedule = self.schedule
        if self.error is not None:
            return schedule.block(self.done, self.done)

        left = self._count_left()
        reactions = schedule.job.reactions
        if reactions is None:
            return schedule.block(self.done, self.done + left)

        looks = schedule.find_step(reactions.looks_at) - self.done
        left = min(max(looks, 0), left)
        if reactions.since == math.inf:
            return schedule.block(self.done, self.done + left)

        # The steps up to the next reading.
        quiet = bisect_left(schedule.ends, reactions.since, self.done) - self.done
        due = (quiet // schedule.tick + 1) * schedule.tick
        count = min(left, due + self._ahead * schedule.tick)
        readings = range(due, count + 1, schedule.tick)

        return schedule.block(self.done, self.done + count, readings)

    def _count_left(self) -> int:
        """Count the steps that are left; up to a stop whole ticks, so that readings come when they would without it."""
        left = self.schedule.count - self.done
        if self.stop is None:
            return left

        tick = self.schedule.tick
        return min(left, max(self.stop - self.done, 0) // tick * tick)

    def take(self, block: Block, passed: Passed) -> Block | None:
        """Take what came of a block.

        Returns:
            The first steps of the block, if a guard changed the motion after them: the others did not happen. None:
            all of them did.
        """
        reactions = self.schedule.job.reactions

        for count, reading in zip(block.readings, passed.readings, strict=True):
            now = float(self.schedule.ends[block.begin + count - 1])
            if reactions is None or now < reactions.since:
                continue

            changed = self._tell("feel", now, *reading)
            if changed is None:
                continue

            self._keep(block, passed, count)
            self.done = block.begin + count
            self._change(changed)
            if count < len(block):
                return block.until(count)

            self.add_torques(passed)
            return None

        self._keep(block, passed, len(block))
        self.add_torques(passed)
        self.done = block.end
        return None

    def _change(self, trajectory: JointTrajectory) -> None:
        """Go on with another motion, which is the same up to now."""
        job = replace(self.schedule.job, trajectory=trajectory)
        self.schedule = Schedule(job, self.schedule.time_step)

    def look(self, worlds: Worlds, number: int) -> bool:
        """Let the plan look at its world, if it is time to.

        Args:
            worlds: one of them is that of the job, as it is after the steps that are done.
            number: of that world.

        Returns:
            Whether it looked.
        """
        reactions = self.schedule.job.reactions
        if reactions is None or self.error is not None:
            return False
        if reactions.looks_at == math.inf:
            return False
        if self.schedule.find_step(reactions.looks_at) > self.done:
            return False  # where a guard ends the way to the look, its last reading may come after that
        if self.stop is not None and not self._count_left():
            return False

        now = float(self.schedule.instants[self.done])
        arm, fingers, states = worlds.read(number, [worlds.note()[number]])
        changed = self._tell("look", now, arm[0], fingers[0], states[0])
        if changed is not None:
            self._change(changed)

        return True

    def _tell(self, name: str, *given: Any) -> JointTrajectory | None:
        """Call a method of the reactions, and keep what it was given."""
        self._heard.append((name, given))
        changed: JointTrajectory | None = getattr(self.schedule.job.reactions, name)(
            *given
        )
        return changed

    def leave(self, world: World) -> Checkpoint:
        """Return what others need to go on from here."""
        schedule = self.schedule
        return Checkpoint(
            schedule.time_step,
            schedule.settle,
            self.done,
            schedule.job.trajectory.sample(schedule.instants[: self.done + 1]),
            self._expect(),
            self._heard,
            self._notes,
            self._torques,
            world.save(),
        )

    def _expect(self) -> tuple[object, ...]:
        """Return what the reactions wait for until now, and what they have found out."""
        reactions = self.schedule.job.reactions
        if reactions is None:
            return (math.inf, math.inf, (), 0)

        now = float(self.schedule.instants[self.done])
        awaited = [
            instant if instant < now else math.inf
            for instant in (reactions.since, reactions.looks_at)
        ]
        return (*awaited, reactions.felt, len(reactions.looked))

    def go_on(self, point: Checkpoint, world: World) -> bool:
        """Go on from where another job was stopped, if this one begins as that did.

        Returns:
            Whether it does. Else the reactions have to begin anew.
        """
        if (point.time_step, point.settle) != (
            self.schedule.time_step,
            self.schedule.settle,
        ):
            return False
        if point.heard and self.schedule.job.reactions is None:
            return False

        for name, given in point.heard:
            changed = self._tell(name, *given)
            if changed is not None:
                self._change(changed)

        self.done = point.done
        schedule = self.schedule
        if schedule.count < self.done or self._expect() != point.expected:
            return False

        targets = schedule.job.trajectory.sample(schedule.instants[: self.done + 1])
        if not all(map(np.array_equal, targets, point.targets)):
            return False

        needed = [mark for mark in schedule.marks if mark <= self.done]
        if not point.notes.keys() >= {schedule.settle, *needed}:
            return False

        self._notes = dict(point.notes)
        self._torques = list(point.torques)
        self._begins_s = float(schedule.instants[self.done])
        world.restore(point.world)
        return True

    def add_torques(self, passed: Passed) -> None:
        """Take the greatest torques of steps of the motion that did happen."""
        if passed.torques is not None:
            self._torques.append(passed.torques)

    def _keep(self, block: Block, passed: Passed, count: int) -> None:
        """Keep the notes of so many of a block's steps."""
        self.error = self.error or passed.error
        happened = bisect_right(block.marks, count)
        steps = [block.begin + mark for mark in block.marks[:happened]]
        self._notes.update(zip(steps, passed.notes[:happened], strict=True))

    def conclude(self, worlds: Worlds, number: int) -> Outcome:
        """Make the outcome of what was played in one of the worlds.

        It has an error if the world broke, or the end is not finite.
        """
        if self.error is not None:
            return Outcome(None, None, error=self.error)

        schedule = self.schedule
        noted = sorted({schedule.settle, *schedule.marks})
        notes = [self._notes[done] for done in noted]
        arm, fingers, states = worlds.read(number, notes)
        start = states[noted.index(schedule.settle)]
        end = states[-1]
        if not all(np.isfinite(array).all() for array in end.arrays[:3]):
            error = "the simulation blew up: a body's state is not finite"
            return Outcome(None, None, error=error)

        recording = None
        if len(schedule.samples):
            sampled = np.searchsorted(noted, schedule.samples)
            seen = arm[sampled], fingers[sampled], states[sampled]
            recording = self._develop(worlds, number, *seen)

        measured = np.searchsorted(noted, schedule.measures)
        reactions = schedule.job.reactions
        return Outcome(
            start,
            end,
            schedule.measure_lag(arm[measured]),
            recording=recording,
            felt=reactions.felt if reactions else (),
            looked=reactions.looked if reactions else (),
            gripped=worlds.grips(number),
            torques=np.max(self._torques, axis=0) if self._torques else None,
            time_step=schedule.time_step,
            begins_s=self._begins_s,
        )

    def _develop(
        self, worlds: Worlds, number: int, arm: Array, fingers: Array, states: State
    ) -> Recording:
        """Make the recording of one of the worlds, of what was seen at its samples."""
        schedule = self.schedule
        notes = [self._notes[sample] for sample in schedule.samples.tolist()]
        instants = schedule.instants[schedule.samples]
        loads = worlds.loads(number, notes)
        recording = Recording(instants, arm, fingers, states, loads=loads)
        if not schedule.job.forces:
            return recording

        forces, pushes = worlds.contact_forces(number, notes, instants)
        return replace(recording, forces=forces, pushes=pushes)


class Alone(Worlds):
    """A world by itself."""

    def __init__(self, world: World) -> None:
        self._world = world
        self.time_step = world.time_step
        self.rewinds = world.rewinds

    def launch(self) -> None:
        self._world.launch()

    def advance(self, blocks: Sequence[Block]) -> list[Passed]:
        return [self._world.advance(blocks[0])]

    def note(self) -> list[Any]:
        return [self._world.note()]

    def read(self, number: int, notes: Sequence[Any]) -> tuple[Array, Array, State]:
        return self._world.read(notes)

    def contact_forces(
        self, number: int, notes: Sequence[Any], instants: Array
    ) -> tuple[Mapping[tuple[str, str], Array], Pushes | None]:
        return self._world.contact_forces(notes, instants)

    def loads(self, number: int, notes: Sequence[Any]) -> Mapping[str, Array]:
        return self._world.loads(notes)

    def grips(self, number: int) -> tuple[Gripped, ...]:
        return self._world.grips()

    def save(self) -> Any:
        return self._world.save()

    def restore(self, saved: Any) -> None:
        self._world.restore(saved)


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
    if job.reactions is not None:
        job = replace(job, trajectory=job.reactions.begin())

    refused = refuse_targets(job)
    if refused is not None:
        return refused

    if job.begins is None:
        (outcome,) = play_together(Alone(world), [job])
        return outcome

    player = Player(job, world.time_step, _AHEAD if world.rewinds else 0)
    if not player.go_on(job.begins, world):
        return play(world, replace(job, begins=None))

    _advance(Alone(world), [player])
    return player.conclude(Alone(world), 0)


def stop_at(world: World, job: Rollout, instant: float) -> Checkpoint:
    """Play a job up to an instant of its motion, seconds.

    Args:
        world: with the scene, and with the robot at the first targets.
        job: what is played; its world does not break until then.
        instant: it is stopped at most `FEEL_S` before.
    """
    if job.reactions is not None:
        job = replace(job, trajectory=job.reactions.begin())

    player = Player(job, world.time_step, _AHEAD if world.rewinds else 0)
    player.stop = player.schedule.find_step(instant)
    worlds = Alone(world)
    _settle(worlds, [player])
    _advance(worlds, [player])
    return player.leave(world)


def play_together(worlds: Worlds, jobs: Sequence[Rollout]) -> list[Outcome]:
    """Play a job in each world. This is the loop that all engines are played by.

    Args:
        worlds: with the scenes, and with the robots at the first targets.
        jobs: with finite targets; their reactions have begun.
    """
    ahead = _AHEAD if worlds.rewinds else 0
    players = [Player(job, worlds.time_step, ahead) for job in jobs]

    _settle(worlds, players)
    _advance(worlds, players)
    return [player.conclude(worlds, number) for number, player in enumerate(players)]


def _settle(worlds: Worlds, players: Sequence[Player]) -> None:
    """Let worlds settle, and begin the motions."""
    firsts = worlds.note()
    settled = worlds.advance([player.settling() for player in players])
    worlds.launch()
    for player, first, passed, now in zip(
        players, firsts, settled, worlds.note(), strict=True
    ):
        player.begin(first, passed, now)


def _advance(worlds: Worlds, players: Sequence[Player]) -> None:
    """Play jobs from where they are to their ends."""
    while True:
        for number, player in enumerate(players):
            while player.look(worlds, number):
                pass

        blocks = [player.next_block() for player in players]
        if not any(len(block) for block in blocks):
            break

        saved = None
        if any(len(block.readings) > 1 for block in blocks):
            saved = worlds.save()

        advanced = worlds.advance(blocks)
        redone = []
        for player, block, passed in zip(players, blocks, advanced, strict=True):
            shorter = player.take(block, passed)
            if shorter is not None:
                redone.append((player, shorter))

        if redone:
            worlds.restore(saved)
            again = worlds.advance([shorter for _, shorter in redone])
            for (player, _), passed in zip(redone, again, strict=True):
                player.add_torques(passed)
