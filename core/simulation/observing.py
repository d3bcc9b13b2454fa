"""Observe a rollout: what moved where, what touched, and what became of the bodies of the task's goal.

The goal's bodies are classed by the first rule that applies:

- solved: `Task.is_solved` says so.
- forbidden: something happened that a goal forbids (`Limit.breaches`): what is most beyond its own limit.
- placed: all are where the goal wants them (`Reach.is_in_place`), yet the reward is less.
- The earliest of these causes, if there is one. The first two count only from the robot's first touch of these bodies
  to its last, or at any time if it touches none.
  - unreachable: the arm misses the way to a waypoint by more than `MISSED_M` or `MISSED_RAD`.
  - stuck: a joint lags by more than `STUCK_RAD` when a waypoint should be reached, and at the peak of the lag the robot
    touches something that does not yield.
  - dropped: one was lifted by `LIFTED_M` or more while held, and fell by `FALLEN_M` or more while not held.
  - tipped: its upward axis turned by more than `TIPPED_DEG` and stayed so, not in a fall.
- never touched: the robot touched none of them, and none moved by more than `NUDGED_M`. Missed: all else.

Dropped and tipped need at least half of the bodies that are not in place, or with `Reach.any` one.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from itertools import chain, islice
from typing import Any

import numpy as np
import numpy.typing as npt

from core.errors import UsageError
from core.geometry import Array
from core.goals import Breach, Evidence, Goal, Reach, limits, reaches
from core.interfaces import Contact, Observation, Task
from core.scene import Scene, State
from core.simulation.attempt import Attempt
from core.simulation.crux import choose_body, choose_instants, describe_crux
from core.solids.contacts import Contacts, make_trace
from core.trial import Trial
from core.values.bearing import ROBOT, WORLD, Flags
from core.values.joints import rotate, rotate_back
from core.values.observations import (
    MISSED_M,
    MISSED_RAD,
    Class,
    Crux,
    Moved,
    Offset,
)

STUCK_RAD = 0.05
"""The lag of a joint that is held back; reference solutions lag by less than 0.012."""

UNYIELDING_M = 0.005
"""What moves by no more than this in `UNYIELDING_S` does not yield."""

UNYIELDING_S = 0.2

LIFTED_M = 0.02
"""A body that was dropped was lifted by this, and fell by `FALLEN_M`."""

FALLEN_M = 0.02

TIPPED_DEG = 45.0
"""How far an upward axis has turned of a body that tipped."""

FELL_M = 0.05
"""A body that ends lower than it began by more than this fell, and did not tip."""

NUDGED_M = 0.005
"""What moved by no more than this was not moved."""

INSTANTS = 6
"""At which the places of a path are noted."""

PATHS = 2
"""The most bodies whose paths are noted."""

MAX_CONTACTS = 120
"""The most contacts that are listed."""

MEASURED = 4
"""The most figures of goals that are told."""

NAMED = 3
"""The most bodies that a missed goal names."""

_STILL_M = 0.001  # a body that moved by no more, and turned by no more than `_STILL_DEG`, stayed
_STILL_DEG = 1.0

Samples = npt.NDArray[np.intp]
Cause = tuple[float, Class, str]  # when, what, and to which body
Mishap = tuple[float, float, Class, str]  # from when to when, what, and where


def observe(task: Task, attempt: Attempt, trial: Trial) -> Observation:
    """Say how a rollout that came to its end went, and why it earned what it did."""
    case = _Case(task, attempt)
    motion = case.motion
    outcome = attempt.outcome
    contacts = case.contacts
    result, what, instant = case.classify(trial.solved)
    moved = case.moved()
    taken = contacts.taken
    approaches = contacts.approaches

    errors = case.errors()
    crux = case.find_crux(errors, trial)
    instants = choose_instants(crux, taken.times[-1], INSTANTS)
    samples = np.abs(taken.times - instants[:, None]).argmin(axis=1)
    paths: dict[str, Any] = {}

    for name in case.choose_paths(moved, crux):
        places = taken.states.position(name)[samples]
        paths[name] = tuple(_round_all(place, 3) for place in places)

    misses = motion.misses / (MISSED_M, MISSED_RAD)
    worst = int(misses.max(axis=1).argmax())
    miss_m, miss_rad = _round_all(motion.misses[worst], 4)
    # An engine may measure no lag.
    lag = float(np.nanmax([outcome.tracking_error_rad, case.lags.max()]))

    return Observation(
        result=result,
        what=what,
        at_s=_round(instant, 2),
        left=case.left,
        moved=moved,
        errors=errors,
        measured=tuple(islice(case.measured(), MEASURED)),
        contacts=list_contacts(contacts)[:MAX_CONTACTS],
        clearances={name: round(near.gap_m, 4) for name, near in approaches.items()},
        nearest={
            name: (near.part, round(float(taken.times[near.sample]), 2))
            for name, near in approaches.items()
        },
        touch_m=_round(contacts.touch_m, 4),
        miss=(worst + 1, miss_m, miss_rad),
        lag_rad=round(lag, 4),
        lag_s=round(float(taken.times[case.lags.argmax()]), 2),
        arrivals=_round_all(motion.arrivals, 2),
        felt=tuple(map(str, outcome.felt)),
        looked=tuple(map(str, outcome.looked)),
        gripped=tuple(map(str, outcome.gripped)),
        crux=crux,
        instants=_round_all(taken.times[samples], 2),
        paths=paths,
    )


def list_contacts(contacts: Contacts) -> tuple[Contact, ...]:
    """List contacts, the robot's before those of bodies with each other, the earliest first.

    Those of bodies that touched before the motion began are left out.
    """
    touching = contacts.touching
    settling = contacts.taken.times <= 0
    keys = [
        key
        for key, touched in touching.items()
        if key[0] != "body" or not (touched & settling).any()
    ]
    keys.sort(key=lambda key: (key[0] == "body", touching[key].argmax(), *key))

    return tuple(_describe(contacts, *key) for key in keys)


def _describe(contacts: Contacts, kind: Any, first: str, second: str) -> Contact:
    """Describe a contact, rounded, with the largest normal force, N.

    A component of the tool has the force of the whole tool.
    """
    key = (kind, first, second)
    touched = contacts.touching[key]
    begin, end = contacts.taken.times[touched][[0, -1]].tolist()

    force = None
    forces = contacts.taken.forces
    if forces:
        presser = "tool" if kind == "tool" else first
        unpressed = forces.get((second, presser), np.zeros(1))
        values = forces.get((presser, second), unpressed)
        force = float((values * touched).max())

    depth = round(contacts.depths[key], 4) + 0.0
    return Contact(kind, first, second, round(begin, 2), round(end, 2), depth, force)


class _Case:
    """What a rollout is classed by: what was planned, what was played, and what the task wanted.

    Attributes:
        task: gives the goals.
        scene: the layout.
        motion: as it was played.
        start: the state when the motion began, complete; ``end``: that at the end.
        contacts: those of the recording.
        times: (T,) the samples at which contacts were looked for; ``states``: those at these samples.
        goals: the task's, without those that don't fit the scene: a goal is a hint, and may be wrong.
        reaches: those of the goals that say where bodies should be.
        film: the trace of it.
        names: the bodies of the goals; all that can move, if there are none.
        left: those of them that are not in place.
        lags: of the joint that lags most at each sample, radians; 0 before the motion begins.
    """

    def __init__(self, task: Task, attempt: Attempt) -> None:
        outcome = attempt.outcome
        contacts = attempt.contacts
        assert outcome.start is not None
        assert outcome.end is not None
        assert contacts is not None
        self.task = task
        self.scene = attempt.scene
        self.motion = attempt.motion
        self.start = self.scene.complete(outcome.start)
        self.end = self.scene.complete(outcome.end)
        self.contacts = contacts
        self.states = contacts.taken.states
        self.times = contacts.taken.times
        self.goals = [goal for goal in task.goals if _fits(goal, self.scene)]
        self.reaches = reaches(self.goals)

        bodies = dict[str, None]()
        for goal in self.reaches:
            bodies |= dict.fromkeys(goal.subjects(self.start))

        self.names = tuple(bodies) or self.start.names
        self.film = make_trace(self.scene, contacts)
        self.left = tuple(name for name in self.names if not self._is_in_place(name))

        planned, _ = self.motion.trajectory.sample(self.times)
        off = np.abs(contacts.taken.arm - planned).max(axis=1)
        self.lags = np.where(self.times < 0, 0.0, off)

    def classify(self, solved: bool) -> tuple[Class, str, float | None]:
        """Choose the class, by the rules of the module.

        Args:
            solved: whether the task is solved.

        Returns:
            The class, the thing that it is about, and when it happened, seconds; None: at no one instant.
        """
        if solved:
            return "solved", "", None

        breaches = _worst_first(self._breaches())
        if breaches:
            return "forbidden", breaches[0].text, breaches[0].time_s

        if self.names and not self.left:
            return "placed", "", None

        touched = [self.contacts.with_robot(name) for name in self.names]
        touches = np.flatnonzero(np.logical_or.reduce(touched))
        causes = self._causes(touches)

        if causes:
            instant, result, what = min(causes)
            return result, what, instant

        if not touches.size and all(self._way(n) <= NUDGED_M for n in self.names):
            return "never touched", "", None
        if len(self.left) == len(self.names):
            return "missed", "", None

        return "missed", ", ".join(self.left[:NAMED]), None

    def moved(self) -> dict[str, Moved]:
        """Describe how the bodies of the goals, and what else moved, ended."""
        found = {}

        for name in self.start.names:
            begin = self.start.position(name)
            end = self.end.position(name)
            tilt = round(float(self._tilts(name, self.end)), 1)
            shifted = self._way(name) > _STILL_M or tilt > _STILL_DEG
            if shifted or name in self.names:
                way = _round_all(end - begin, 4)
                found[name] = Moved(way, _round_all(end, 4), tilt)

        return found

    def find_crux(self, errors: Mapping[str, Offset], trial: Trial) -> Crux | None:
        """Find the body that the rollout turned on, if there is one."""
        solved, margins = trial.solved, trial.margins
        body = choose_body(self.left, errors, margins, self.start, solved=solved)
        if body is None:
            return None
        return describe_crux(body, self.scene, self.film, self.contacts, self.reaches)

    def choose_paths(self, moved: Iterable[str], crux: Crux | None) -> list[str]:
        """Choose the bodies whose paths are noted.

        First comes the one that the rollout turned on, then those that are not in place, then the goal's others, and
        among these what moved most.
        """
        first = "" if crux is None else crux.body
        ways = {
            name: np.ptp(self.states.position(name), axis=0).max() for name in moved
        }
        strayed = [name for name, way in ways.items() if way > _STILL_M]
        strayed.sort(
            key=lambda name: (
                name != first,
                name not in self.left,
                name not in self.names,
                -ways[name],
            )
        )

        return strayed[:PATHS]

    def errors(self) -> dict[str, Offset]:
        """Measure how far each body of the goals ended from its place; the goal that is nearest counts."""
        found = dict[str, Offset]()

        for goal in sorted(self.reaches, key=self._measure_left):
            for name in goal.subjects(self.start):
                wanted = goal.place_of(name, self.start)
                axes = self.start.placement(goal.reference).quaternion
                found.setdefault(name, _offset(wanted, self.end.position(name), axes))

        return {name: found[name] for name in self.names if name in found}

    def measured(self) -> Iterator[str]:
        """Say how far the figures of the goals got, the nearest goal first: of its first body that is not in place.

        How far bodies are off their places is in `errors`.
        """
        for goal in sorted(self.reaches, key=self._measure_left):
            bodies = goal.subjects(self.start)
            body = next((name for name in bodies if name in self.left), bodies[0])

            if self.start.hindered and goal in self.start.hindered:
                yield f"the scene prevents {self.start.hindered[goal]}"

            parts = [part for part in goal.parts if not part.offset]
            for measure in chain(*(part.measures(body, self.start) for part in parts)):
                begun = float(measure.value(self.start))
                ended = float(measure.value(self.end))
                wanted = "least" if measure.at_least else "most"
                limit = f"at {wanted} {measure.limit:.3g} {measure.unit}"
                yield f"{measure.name} {begun:.3g} -> {ended:.3g}, wanted {limit}"

            yield from self._say_support(goal, body)

    def _say_support(self, goal: Reach, body: str) -> Iterator[str]:
        """Say what bears a body at the end that is to be held, or let go, and is not."""
        support = self.film.support
        linked = support.say(body, ROBOT)
        fixed = support.say(body, WORLD)

        if goal.held and not linked:
            yield f"the robot does not hold {body}"
        if goal.held and fixed:
            yield f"not held by the robot alone: {fixed}"
        if goal.released and linked:
            yield f"not let go: {linked}"
        if goal.stands_on and not self._stands(body, goal.stands_on):
            yield f"not standing on {goal.stands_on}: {fixed or linked}"

    def _stands(self, body: str, other: str) -> bool:
        """Report whether a body stands on another one at the end."""
        return bool(self.film.support.stands(body, other)[-1])

    def _way(self, name: str) -> float:
        """Measure how far a body ended from its start."""
        way = self.end.position(name) - self.start.position(name)
        return float(np.linalg.norm(way))

    def _is_in_place(self, name: str) -> bool:
        """Report whether a body ended where the goals want it, held or let go as they want it.

        Of several goals of a body one is enough, unless the task wants every one.
        """
        found = [
            goal.is_in_place(name, self.start, self.end)
            and (not goal.held or self.film.support.held(name)[-1])
            and not (goal.released and self.film.support.linked(name)[-1])
            and (not goal.stands_on or self._stands(name, goal.stands_on))
            for goal in self.reaches
            if name in goal.subjects(self.start)
        ]
        if not found or not self.task.every:
            return any(found)
        return all(found)

    def _measure_left(self, goal: Reach) -> float:
        """Measure how far a goal's bodies are from where it wants them, on average."""
        left = 0.0
        bodies = goal.subjects(self.start)

        for name in bodies:
            for measure in goal.all_measures(name, self.start):
                left += float(measure.left(self.end))

        return left / len(bodies)

    def _breaches(self) -> Iterator[Breach]:
        """Yield what the goals forbid and the rollout did."""
        evidence = Evidence(self.start, self.end, self.film)
        for limit in limits(self.goals):
            yield from limit.breaches(evidence)

    def _causes(self, touches: Samples) -> list[Cause]:
        """Find what may have gone wrong.

        Args:
            touches: the samples at which the robot touches the goals' bodies. What the arm suffered before the first
                and after the last does not count.
        """
        begun = 0.0
        ended = np.inf

        if touches.size:
            begun, ended = self.times[touches[[0, -1]]].tolist()

        mishaps = [*self._find_unreachable(), *self._find_stuck()]
        causes = [
            (begin, result, what)
            for begin, end, result, what in mishaps
            if end >= begun and begin <= ended
        ]
        fallen = [self._find_fallen(name) for name in self.left]
        known = [cause for cause in fallen if cause is not None]
        needed = len(self.left) / 2

        if any(goal.any for goal in self.reaches):
            needed = 1
        if len(known) >= needed:
            causes += known

        return causes

    def _find_unreachable(self) -> Iterator[Mishap]:
        """Find the waypoints that the arm misses the way to, and when it is on this way."""
        arrivals = self.motion.arrivals
        begins = np.append(0.0, arrivals[:-1])
        missed = (self.motion.misses > (MISSED_M, MISSED_RAD)).any(axis=1)

        for number in np.flatnonzero(missed):
            begin = float(begins[number])
            yield begin, arrivals[number], "unreachable", f"waypoint {number + 1}"

    def _find_stuck(self) -> Iterator[Mishap]:
        """Find stretches of large lag, at whose peak the robot touches something that does not yield."""
        times = self.times

        for begin, stop in _runs(self.lags > STUCK_RAD):
            ahead = self.motion.arrivals[self.motion.arrivals > times[begin]]
            if times[stop - 1] < ahead.min(initial=times[-1]):
                continue  # the arm caught up before the next waypoint

            peak = begin + int(self.lags[begin:stop].argmax())
            before = np.searchsorted(times, times[peak] - UNYIELDING_S)

            for (kind, _, other), touched in self.contacts.touching.items():
                if kind == "body" or not touched[max(0, peak - 2) : peak + 3].any():
                    continue

                moved = 0.0
                if not self.scene[other].fixed:
                    places = self.states.position(other)
                    moved = float(np.linalg.norm(places[peak] - places[before]))

                if moved <= UNYIELDING_M:
                    yield float(times[begin]), times[stop - 1], "stuck", other

    def _find_fallen(self, name: str) -> Cause | None:
        """Find when a body was dropped, or tipped over; None: neither.

        It was dropped if it was lifted, and fell in a stretch of time in which nothing held it.
        """
        states = self.film.states
        times = self.film.times
        heights = states.position(name)[:, 2]
        rest = float(self.start.position(name)[2])

        for begin, stop in _runs(~self.film.support.linked(name)):
            top = heights[begin - 1] if begin else rest
            if top - rest >= LIFTED_M and top - heights[begin:stop].min() >= FALLEN_M:
                return float(times[begin - 1]), "dropped", name

        upright = np.flatnonzero(self._tilts(name, states) <= TIPPED_DEG)
        tipped = int(upright[-1]) + 1 if upright.size else 0
        # It stayed so, and did not fall.
        if tipped < len(heights) and heights[tipped] >= rest - FELL_M:
            return float(times[tipped]), "tipped", name

        return None

    def _tilts(self, name: str, states: State) -> Array:
        """Compute how far a body's upward axis has turned since the start, degrees, in each state (...).

        That of a ball can't be seen.
        """
        if all(part.shape.is_ball for part in self.scene[name].collisions):
            return np.zeros(states.positions.shape[:-2])

        upward = rotate_back(self.start.quaternion(name), np.array([0.0, 0.0, 1.0]))
        heights = rotate(states.quaternion(name), upward)[..., 2]

        return np.degrees(np.arccos(np.clip(heights, -1.0, 1.0)))


def _fits(goal: Goal, scene: Scene) -> bool:
    """Report whether all that a goal names is in the scene."""
    try:
        goal.check_names(scene)
    except UsageError:
        return False

    return True


def _runs(flags: Flags) -> Iterator[tuple[int, int]]:
    """Find the stretches of flags (T,) that are set.

    Returns:
        For each the number of the first flag, and that behind the last one.
    """
    for run in np.ma.clump_masked(np.ma.masked_where(flags, flags)):  # type: ignore[no-untyped-call]
        yield run.start, run.stop


def _offset(wanted: Array | None, position: Array, axes: Array) -> Offset:
    """Subtract from a place the wanted one.

    Args:
        wanted: (3,) metres, with nan where a coordinate is free; None: all are.
        position: (3,) metres.
        axes: (4,) the turn of the frame along whose axes it is measured.

    Returns:
        Three numbers, metres; None: a coordinate that is free.
    """
    if wanted is None:
        return None, None, None

    free = np.isnan(wanted)
    way = rotate_back(axes, np.where(free, 0.0, position - wanted))
    way[free] = np.nan
    x, y, z = (None if np.isnan(off) else round(off, 4) + 0.0 for off in way.tolist())
    return x, y, z


def _round_all(values: Array, digits: int) -> Any:
    """Round numbers (N,): a tuple of N."""
    return tuple(round(value, digits) + 0.0 for value in values.tolist())


def _round(number: float | None, digits: int) -> float | None:
    """Round a number, if there is one."""
    return None if number is None else round(number, digits)


def _worst_first(breaches: Iterable[Breach]) -> list[Breach]:
    """Sort breaches, the worst beyond its own limit first.

    A touch where none is allowed goes before what is measured, of which it may be the cause, but not where that began
    before it.
    """
    found = sorted(breaches, key=lambda breach: -breach.excess)
    measured = [breach.time_s for breach in found if math.isfinite(breach.excess)]
    began = min(measured, default=math.inf)
    later = [b for b in found if math.isinf(b.excess) and b.time_s > began]
    return [breach for breach in found if breach not in later] + later
