"""Observe a rollout: what moved where, what touched, and what became of the bodies of the task's goal.

The goal's bodies are classed by the first rule that applies:

- solved: the reward is `Task.success_reward` or more.
- forbidden: something happened that a goal forbids (`Limit.breaches`); the first of it.
- placed: all are where the goal wants them, yet the reward is less.
- The earliest of these causes, if there is one. The first two count only from the robot's first touch of these bodies
  to its last, or at any time if it touches none.
  - unreachable: the arm misses the way to a waypoint by more than `MISSED_M` or `MISSED_RAD`.
  - stuck: a joint lags by more than `STUCK_RAD` while the robot touches something that does not yield.
  - dropped: one was lifted by `LIFTED_M` or more while held, and fell by `FALLEN_M` or more while not held.
  - tipped: its upward axis turned by more than `TIPPED_DEG` and stayed so, not in a fall.
- never touched: the robot touched none of them, and none moved by more than `NUDGED_M`. Missed: all else.

Dropped and tipped need at least half of the bodies that are not in place, or with `Reach.any` one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from core.errors import UsageError
from core.geometry import Array, Sphere
from core.goals import Evidence, Goal, Reach, check_names, limits, reaches
from core.interfaces import Contact, Observation, Outcome, Task
from core.robot.trajectory import Motion
from core.scene import Scene, State
from core.solids.contacts import Contacts, make_trace
from core.values.joints import rotate, rotate_back
from core.values.observations import Class, Moved, Offset, Point
from core.values.traces import Flags

MISSED_M = 0.02
MISSED_RAD = 0.1
STUCK_RAD = 0.05  # reference solutions lag by less than 0.012
UNYIELDING_M = 0.005  # what moves by no more than this...
UNYIELDING_S = 0.2  # ...in that time does not yield
LIFTED_M = 0.02
FALLEN_M = 0.02
TIPPED_DEG = 45.0
FELL_M = 0.05
NUDGED_M = 0.005

INSTANTS = 6
PATHS = 2
MAX_CONTACTS = 40
NAMED = 3

_STILL_M = 0.001
_STILL_DEG = 1.0

Samples = npt.NDArray[np.intp]
Span = tuple[float, float]  # from when to when
Cause = tuple[float, Class, str]  # when, what, and to which body


def observe(
    task: Task,
    scene: Scene,
    motion: Motion,
    outcome: Outcome,
    reward: float,
    contacts: Contacts,
) -> Observation:
    """Observe a rollout that came to its end; ``contacts`` are those of its recording."""
    assert outcome.start is not None
    assert outcome.end is not None
    case = _Case(
        task,
        scene,
        motion,
        scene.complete(outcome.start),
        scene.complete(outcome.end),
        contacts,
    )
    result, what, instant = case.classify(reward)
    taken = contacts.taken
    found = sorted(contacts.all, key=lambda contact: contact.kind == "body")
    moved = case.moved()

    instants = np.linspace(0.0, taken.times[-1], INSTANTS)
    samples = np.abs(taken.times - instants[:, None]).argmin(axis=1)
    paths = dict[str, tuple[Point, ...]]()
    for name in case.choose_paths(moved):
        places = taken.states.position(name)[samples]
        paths[name] = tuple(_point(place, 3) for place in places)

    misses = motion.misses / (MISSED_M, MISSED_RAD)
    worst = int(misses.max(axis=1).argmax())
    miss_m, miss_rad = motion.misses[worst].tolist()
    # An engine may measure no lag.
    lag = float(np.nanmax([outcome.tracking_error_rad, case.lags.max()]))

    return Observation(
        result=result,
        what=what,
        at_s=_round(instant, 2),
        left=case.left,
        moved=moved,
        errors=case.errors(),
        contacts=tuple(_rounded(contact) for contact in found[:MAX_CONTACTS]),
        clearances={name: round(gap, 4) for name, gap in contacts.clearances.items()},
        touch_m=_round(contacts.touch_m, 4),
        miss=(worst + 1, round(miss_m, 4), round(miss_rad, 4)),
        lag_rad=round(lag, 4),
        lag_s=round(float(taken.times[int(case.lags.argmax())]), 2),
        arrivals=_rounded_times(motion.arrivals),
        felt=tuple(map(str, outcome.felt)),
        instants=_rounded_times(taken.times[samples]),
        paths=paths,
    )


class _Case:
    """What a rollout is classed by.

    Attributes:
        goals: the task's, without those that don't fit the scene: a goal is a hint, and may be wrong.
        names: the bodies of the goals; all that can move, if there are none.
        left: those of them that are not in place.
        lags: of the joint that lags most at each sample, radians; 0 before the motion begins.
    """

    def __init__(
        self,
        task: Task,
        scene: Scene,
        motion: Motion,
        start: State,
        end: State,
        contacts: Contacts,
    ) -> None:
        self.task = task
        self.scene = scene
        self.motion = motion
        self.start = start
        self.end = end
        self.contacts = contacts
        self.goals = [goal for goal in task.goals if _fits(goal, scene)]
        self.reaches = reaches(self.goals)

        bodies = [body for goal in self.reaches for body in goal.subjects(start)]
        self.names = tuple(dict.fromkeys(bodies)) or start.names
        self.left = tuple(name for name in self.names if not self._is_in_place(name))

        taken = contacts.taken
        planned, _ = motion.trajectory.sample(taken.times)
        off = np.abs(taken.arm - planned).max(axis=1)
        self.lags = np.where(taken.times < 0, 0.0, off)

    def classify(self, reward: float) -> tuple[Class, str, float | None]:
        """Choose the class, see the module; also the thing that it is about, and when it happened, seconds."""
        if reward >= self.task.success_reward:
            return "solved", "", None
        forbidden = min(self._breaches(), default=None, key=lambda breach: breach[0])
        if forbidden is not None:
            instant, what = forbidden
            return "forbidden", what, instant

        if self.names and not self.left:
            return "placed", "", None

        touched = [self.contacts.with_robot(name) for name in self.names]
        touches = np.flatnonzero(np.logical_or.reduce(touched))
        causes = self._causes(touches)
        if causes:
            instant, result, what = min(causes)
            return result, what, instant

        if not touches.size and all(self._moved(n) <= NUDGED_M for n in self.names):
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
            tilt = 0.0
            if not _is_ball(self.scene, name):
                turned = self.end.quaternion(name)
                tilt = round(float(_tilts(self.start.quaternion(name), turned)), 1)

            shifted = self._moved(name) > _STILL_M or tilt > _STILL_DEG
            if shifted or name in self.names:
                found[name] = Moved(_point(end - begin), _point(end), tilt)

        return found

    def choose_paths(self, moved: Mapping[str, Moved]) -> list[str]:
        """Choose the bodies whose ways are told: those that are not in place, the goal's others, what moved most."""
        states = self.contacts.taken.states
        ways = {
            name: float(np.ptp(states.position(name), axis=0).max()) for name in moved
        }
        strayed = [name for name, way in ways.items() if way > _STILL_M]
        strayed.sort(key=lambda name: -ways[name])
        strayed.sort(key=lambda name: (name not in self.left, name not in self.names))
        return strayed[:PATHS]

    def errors(self) -> dict[str, Offset]:
        """Measure how far each body of the goals ended from its place; the goal that is nearest counts."""
        nearest_first = sorted(self.reaches, key=self._measure_left)
        found = dict[str, Offset]()
        for goal in nearest_first:
            for name in goal.subjects(self.start):
                wanted = goal.place_of(name, self.start)
                found.setdefault(name, _offset(wanted, self.end.position(name)))
        return {name: found[name] for name in self.names if name in found}

    def _moved(self, name: str) -> float:
        return _length(self.end.position(name) - self.start.position(name))

    def _is_in_place(self, name: str) -> bool:
        enough = all if self.task.every else any
        found = []
        for goal in self.reaches:
            if name in goal.subjects(self.start):
                held = not goal.held or self.contacts.held(name)[-1]
                found.append(held and goal.is_in_place(name, self.start, self.end))
        return bool(found) and enough(found)

    def _measure_left(self, goal: Reach) -> float:
        """Measure how far a goal's bodies are from where it wants them, on average."""
        left = 0.0
        bodies = goal.subjects(self.start)
        for name in bodies:
            for measure in goal.all_measures(name, self.start):
                left += float(measure.left(self.end))
        return left / len(bodies)

    def _breaches(self) -> Iterator[tuple[float, str]]:
        """Yield what the goals forbid and the rollout did."""
        forbidding = limits(self.goals)
        if forbidding:
            trace = make_trace(self.scene, [self.contacts])[0]
            evidence = Evidence(self.start, self.end, trace)
            for limit in forbidding:
                yield from limit.breaches(evidence)

    def _causes(self, touches: Samples) -> list[Cause]:
        """Find what may have gone wrong while the robot was at work."""
        scene = self.scene
        contacts = self.contacts
        work = (0.0, np.inf)

        if touches.size:
            first, last = contacts.taken.times[touches[[0, -1]]].tolist()
            work = (first, last)

        causes = [
            *_unreachable(self.motion, work),
            *_stuck(scene, contacts, self.lags, work),
        ]

        fallen = [_fallen(scene, contacts, name, self.start) for name in self.left]
        known = [cause for cause in fallen if cause is not None]
        needed = len(self.left) / 2
        if any(goal.any for goal in self.reaches):
            needed = 1
        if len(known) >= needed:
            causes += known
        return causes


def _fits(goal: Goal, scene: Scene) -> bool:
    try:
        check_names(goal, scene)
    except UsageError:
        return False
    return True


def _unreachable(motion: Motion, work: Span) -> Iterator[Cause]:
    """Find the first waypoint that the arm misses the way to."""
    begins = np.append(0.0, motion.arrivals[:-1])
    at_work = (motion.arrivals >= work[0]) & (begins <= work[1])
    missed = (motion.misses > (MISSED_M, MISSED_RAD)).any(axis=1)
    if (at_work & missed).any():
        first = int((at_work & missed).argmax())
        yield float(begins[first]), "unreachable", f"waypoint {first + 1}"


def _stuck(
    scene: Scene, contacts: Contacts, lags: Array, work: Span
) -> Iterator[Cause]:
    """Find stretches of large lag, at whose peak the robot touches something that does not yield."""
    times = contacts.taken.times

    for begin, stop in _runs(lags > STUCK_RAD):
        if times[stop - 1] < work[0] or times[begin] > work[1]:
            continue
        peak = begin + int(lags[begin:stop].argmax())
        before = int(np.searchsorted(times, times[peak] - UNYIELDING_S))
        for (kind, _, other), touched in contacts.touching.items():
            if kind == "body" or not touched[max(0, peak - 2) : peak + 3].any():
                continue
            moved = 0.0
            if not scene[other].fixed:
                places = contacts.taken.states.position(other)
                moved = _length(places[peak] - places[before])

            if moved <= UNYIELDING_M:
                yield float(times[begin]), "stuck", other


def _fallen(scene: Scene, contacts: Contacts, name: str, start: State) -> Cause | None:
    """Find when a body was dropped, or tipped over."""
    times = contacts.taken.times
    states = contacts.taken.states
    heights = states.position(name)[:, 2]
    rest = float(start.position(name)[2])
    for begin, stop in _runs(~contacts.held(name)):
        top = heights[begin - 1] if begin else rest
        if top - rest >= LIFTED_M and top - heights[begin:stop].min() >= FALLEN_M:
            return float(times[begin - 1]), "dropped", name

    if _is_ball(scene, name):
        return None
    tilted = _tilts(start.quaternion(name), states.quaternion(name)) > TIPPED_DEG
    runs = list(_runs(tilted))
    if runs and runs[-1][1] == len(times):  # it stayed so
        tipped = runs[-1][0]
        if heights[tipped] >= rest - FELL_M:
            return float(times[tipped]), "tipped", name

    return None


def _is_ball(scene: Scene, name: str) -> bool:
    return all(isinstance(part.shape, Sphere) for part in scene[name].collisions)


def _runs(flags: Flags) -> Iterator[tuple[int, int]]:
    """Yield where flags begin to be set and where they end."""
    changes = np.diff(np.pad(flags.astype(np.int8), 1))
    edges = np.flatnonzero(changes).tolist()
    return zip(edges[::2], edges[1::2], strict=True)


def _tilts(first: Array, quaternions: Array) -> Array:
    """Compute how far a body's upward axis has turned since its ``first`` quaternion, degrees, for each of others."""
    upward = rotate_back(first, np.array([0.0, 0.0, 1.0]))
    heights = rotate(quaternions, upward)[..., 2]
    return np.degrees(np.arccos(np.clip(heights, -1.0, 1.0)))


def _offset(wanted: Array | None, position: Array) -> Offset:
    """Subtract from a place the wanted one, metres; None: a coordinate that is free."""
    if wanted is None:
        return None, None, None
    x, y, z = (
        None if np.isnan(off) else round(off, 4) + 0.0
        for off in (position - wanted).tolist()
    )
    return x, y, z


def _length(vector: Array | Point) -> float:
    return float(np.linalg.norm(vector))


def _point(position: Array, digits: int = 4) -> Point:
    x, y, z = (round(float(number), digits) + 0.0 for number in position)
    return x, y, z


def _round(number: float | None, digits: int) -> float | None:
    return None if number is None else round(number, digits)


def _rounded_times(times: Array) -> tuple[float, ...]:
    return tuple(round(time, 2) for time in times.tolist())


def _rounded(contact: Contact) -> Contact:
    return replace(
        contact,
        first_s=round(contact.first_s, 2),
        last_s=round(contact.last_s, 2),
        depth_m=round(contact.depth_m, 4) + 0.0,
    )
