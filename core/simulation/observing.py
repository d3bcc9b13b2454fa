"""Observe a rollout: what moved where, what touched, and what became of the bodies of the task's goal.

The goal's bodies are classed by the first rule that applies:

- solved: the reward is `Task.success_reward` or more.
- forbidden: something happened that a goal forbids (`_forbidden`); the first of it.
- placed: all are where the goal wants them, yet the reward is less.
- The earliest of these causes, if there is one. The first two count only from the robot's first touch of these bodies
  to its last, or at any time if it touches none.
  - unreachable: the arm misses the way to a waypoint by more than `MISSED_M` or `MISSED_RAD`.
  - stuck: a joint lags by more than `STUCK_RAD` while the robot touches something that does not yield.
  - dropped: one was lifted by `LIFTED_M` or more while held, and fell by `FALLEN_M` or more while not held.
  - tipped: its upward axis turned by more than `TIPPED_DEG` and stayed so, not in a fall.
- never touched: the robot touched none of them, and none moved by more than `NUDGED_M`. Missed: all else.

Dropped and tipped need at least half of the bodies that are not in place, or with `Goal.any` one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from core.geometry import Array, Sphere
from core.goals import DONE, KEPT_M, progress
from core.interfaces import Contact, Observation, Outcome, Task
from core.robot.trajectory import Motion
from core.scene import Goal, Scene, State
from core.solids.contacts import Contacts, Flags, make_trace
from core.values.observations import Class, Moved, Offset, Point
from core.values.states import Trace

MISSED_M, MISSED_RAD = 0.02, 0.1
STUCK_RAD = 0.05  # reference solutions lag by less than 0.012
UNYIELDING_M, UNYIELDING_S = (
    0.005,
    0.2,
)  # what moves by no more than this in that time does not yield
LIFTED_M, FALLEN_M = 0.02, 0.02
TIPPED_DEG, FELL_M = 45.0, 0.05
NUDGED_M = 0.005
MARGINAL = 0.25  # of what a body to keep may move; a task's own limit may be lower than that of its goal
PLACE_M, PLACE_RAD = (
    0.02,
    0.1,
)  # the tolerance of a goal's place, if the goal names a smaller one

INSTANTS, PATHS, MAX_CONTACTS, NAMED = 6, 2, 40, 3

_STILL_M, _STILL_DEG = 0.001, 1.0

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
    start, end, taken = (
        scene.complete(outcome.start),
        scene.complete(outcome.end),
        contacts.taken,
    )
    there = {body.name for body in scene.bodies}
    goals = [
        part
        for goal in task.goals
        if goal.at in (None, *there) and goal.joint in (None, *scene.placed_joints)
        for part in goal.within(scene).spread()
        if part.bodies and set(part.bodies) <= set(start.names)
    ]  # a goal is a hint, and may be wrong
    goal = min(goals, key=lambda goal: _left(goal, start, end), default=None)
    off = np.abs(taken.arm - motion.trajectory.sample(taken.times)[0]).max(axis=1)
    lags = np.where(
        taken.times < 0, 0.0, off
    )  # of a joint at each sample, radians; 0 before the motion begins
    names = (
        tuple(dict.fromkeys(name for goal in goals for name in goal.bodies))
        or start.names
    )
    enough = all if task.every else any
    wanted = {name: [goal for goal in goals if name in goal.bodies] for name in names}
    left = tuple(
        n
        for n in names
        if not (
            wanted[n]
            and enough(_in_place(g, n, start, end, contacts) for g in wanted[n])
        )
    )
    result, what, at = _Case(
        task, scene, motion, start, end, names, left, contacts, lags
    ).judge(reward)
    worst = int((motion.misses / (MISSED_M, MISSED_RAD)).max(axis=1).argmax())
    shifts = {name: _moved(scene, start, end, name) for name in start.names}
    moved = {
        n: m
        for n, m in shifts.items()
        if n in names or _length(m.by) > _STILL_M or m.tilt_deg > _STILL_DEG
    }
    found = sorted(contacts.all, key=lambda contact: contact.kind == "body")
    instants = np.linspace(0.0, taken.times[-1], INSTANTS)
    samples = np.abs(taken.times - instants[:, None]).argmin(axis=1)
    ways = {
        name: float(np.ptp(taken.states.position(name), axis=0).max()) for name in moved
    }
    strayed = [name for name in moved if ways[name] > _STILL_M]
    followed = sorted(
        strayed, key=lambda name: (name not in left, name not in names, -ways[name])
    )[:PATHS]
    return Observation(
        result=result,
        what=what,
        at_s=None if at is None else round(at, 2),
        left=left,
        moved=moved,
        errors={
            name: _offset(
                goal if name in goal.bodies else wanted[name][0], end.position(name)
            )
            for name in names
        }
        if goal is not None
        else {},
        contacts=tuple(_rounded(contact) for contact in found[:MAX_CONTACTS]),
        clearances={name: round(gap, 4) for name, gap in contacts.clearances.items()},
        touch_m=None if contacts.touch_m is None else round(contacts.touch_m, 4),
        miss=(
            worst + 1,
            round(float(motion.misses[worst, 0]), 4),
            round(float(motion.misses[worst, 1]), 4),
        ),
        lag_rad=round(
            float(np.nanmax([outcome.tracking_error_rad, lags.max()])), 4
        ),  # an engine may measure none
        lag_s=round(float(taken.times[int(lags.argmax())]), 2),
        arrivals=tuple(round(instant, 2) for instant in motion.arrivals.tolist()),
        felt=tuple(map(str, outcome.felt)),
        instants=tuple(round(instant, 2) for instant in taken.times[samples].tolist()),
        paths={
            name: tuple(_point(p, 3) for p in taken.states.position(name)[samples])
            for name in followed
        },
    )


@dataclass(frozen=True, eq=False)
class _Case:
    """What a rollout is judged by; ``names`` are the goal's bodies, ``left`` those that are not in place."""

    task: Task
    scene: Scene
    motion: Motion
    start: State
    end: State
    names: Sequence[str]
    left: Sequence[str]
    contacts: Contacts
    lags: Array

    def judge(self, reward: float) -> tuple[Class, str, float | None]:
        """Choose the class, see the module; also the thing that it is about, and when it happened, seconds."""
        names, contacts, taken = self.names, self.contacts, self.contacts.taken
        if reward >= self.task.success_reward:
            return "solved", "", None
        if forbidden := list(
            _forbidden(self.task, self.scene, contacts, self.start, self.end)
        ):
            instant, result, what = min(
                forbidden, key=lambda cause: cause[0]
            )  # of several at once the touch
            return result, what, instant
        if names and not self.left:
            return "placed", "", None
        touches = np.flatnonzero(
            np.logical_or.reduce([contacts.with_robot(name) for name in names])
        )
        work = (
            (float(taken.times[touches[0]]), float(taken.times[touches[-1]]))
            if touches.size
            else (0.0, np.inf)
        )
        causes = [
            *_unreachable(self.motion, work),
            *_stuck(self.scene, contacts, self.lags, work),
        ]
        fallen = [
            cause
            for name in self.left
            if (cause := _fallen(self.scene, contacts, name, self.start)) is not None
        ]
        if len(fallen) >= (
            1 if any(goal.any for goal in self.task.goals) else len(self.left) / 2
        ):
            causes += fallen
        if causes:
            instant, result, what = min(causes)
            return result, what, instant
        shifts = [
            _length(self.end.position(name) - self.start.position(name))
            for name in names
        ]
        untouched = not touches.size and all(shift <= NUDGED_M for shift in shifts)
        where = (
            ", ".join(self.left[:NAMED])
            if len(self.left) < len(names) and not untouched
            else ""
        )
        return ("never touched" if untouched else "missed"), where, None


def _forbidden(
    task: Task, scene: Scene, contacts: Contacts, start: State, end: State
) -> Iterator[Cause]:
    """Yield what the goals forbid and the rollout did, with the numbers."""
    names = {body.name for body in scene.bodies}
    goals = [goal for goal in task.goals if goal.untouched or goal.keep]
    if not goals:
        return
    trace = make_trace(scene, [contacts])[0]
    for goal in goals:
        yield from _touched(
            goal, [name for name in goal.untouched if name in names], contacts, trace
        )
    for name in (name for goal in goals for name in goal.keep if name in start.names):
        way = float(np.linalg.norm(end.position(name) - start.position(name)))
        if way > MARGINAL * KEPT_M:
            ways = np.linalg.norm(
                trace.states.position(name) - start.position(name), axis=-1
            )
            begun = float(trace.times[(ways > MARGINAL * KEPT_M).argmax()])
            yield (
                begun,
                "forbidden",
                f"{name} moved by {1000 * way:.0f} mm, and is to stay",
            )


def _touched(
    goal: Goal, names: Iterable[str], contacts: Contacts, trace: Trace
) -> Iterator[Cause]:
    for name in names:
        if goal.max_force_n > 0:
            forces = (
                trace.forces_n(name, "robot")
                if trace.forces is not None
                else np.zeros(len(trace.times))
            )
            if (over := forces > goal.max_force_n).any():
                said = f"{name} pressed with {forces.max():.0f} N, {goal.max_force_n:g} N allowed"
                yield float(trace.times[over.argmax()]), "forbidden", said
        elif (flags := trace.contact(name, "robot")).any():
            by = [c for c in contacts.all if c.kind != "body" and c.other == name]
            first = (
                min(by, key=lambda contact: contact.first_s).one if by else "the robot"
            )
            yield (
                float(trace.times[flags.argmax()]),
                "forbidden",
                f"{first} touched {name}",
            )


def _unreachable(motion: Motion, work: Span) -> Iterator[Cause]:
    begins = np.append(0.0, motion.arrivals[:-1])
    at_work = (motion.arrivals >= work[0]) & (begins <= work[1])
    for i in np.flatnonzero(
        at_work & (motion.misses > (MISSED_M, MISSED_RAD)).any(axis=1)
    )[:1].tolist():
        yield float(begins[i]), "unreachable", f"waypoint {i + 1}"


def _stuck(
    scene: Scene, contacts: Contacts, lags: Array, work: Span
) -> Iterator[Cause]:
    """Find stretches of large lag, at whose peak the robot touches something that does not yield."""
    times, states = contacts.taken.times, contacts.taken.states
    for begin, stop in _runs(lags > STUCK_RAD):
        if times[stop - 1] < work[0] or times[begin] > work[1]:
            continue
        peak = begin + int(lags[begin:stop].argmax())
        before = int(np.searchsorted(times, times[peak] - UNYIELDING_S))
        for (kind, _, other), touched in contacts.touching.items():
            if kind != "body" and touched[max(0, peak - 2) : peak + 3].any():
                ends = (
                    None
                    if scene[other].fixed
                    else states.position(other)[[before, peak]]
                )
                if ends is None or _length(ends[1] - ends[0]) <= UNYIELDING_M:
                    yield float(times[begin]), "stuck", other


def _fallen(scene: Scene, contacts: Contacts, name: str, start: State) -> Cause | None:
    """Find when a body was dropped, or tipped over."""
    taken = contacts.taken
    heights, rest = taken.states.position(name)[:, 2], float(start.position(name)[2])
    held = contacts.held(name)
    for begin, stop in _runs(~held):
        top = heights[begin - 1] if begin else rest
        if top - rest >= LIFTED_M and top - heights[begin:stop].min() >= FALLEN_M:
            return float(taken.times[begin - 1]), "dropped", name
    if _is_ball(scene, name):
        return None
    tilts = _tilts(start.quaternion(name), taken.states.quaternion(name))
    upright = np.flatnonzero(tilts <= TIPPED_DEG)
    after = int(upright[-1]) + 1 if upright.size else 0
    if after < len(tilts) and heights[after] >= rest - FELL_M:
        return float(taken.times[after]), "tipped", name
    return None


def _is_ball(scene: Scene, name: str) -> bool:
    return all(isinstance(part.shape, Sphere) for part in scene[name].collisions)


def _runs(flags: Flags) -> Iterator[tuple[int, int]]:
    """Yield where flags begin to be set and where they end."""
    edges = np.flatnonzero(
        np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8))
    )
    return zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)


def _tilts(first: Array, quaternions: Array) -> Array:
    """How far the upward axis of a body has turned since its ``first`` quaternion, degrees, for each of others."""
    turned = (
        Rotation.from_quat(quaternions, scalar_first=True)
        * Rotation.from_quat(first, scalar_first=True).inv()
    )
    return np.degrees(np.arccos(np.clip(turned.as_matrix()[..., 2, 2], -1.0, 1.0)))


def _moved(scene: Scene, start: State, end: State, name: str) -> Moved:
    tilt = (
        0.0
        if _is_ball(scene, name)
        else float(_tilts(start.quaternion(name), end.quaternion(name)))
    )
    return Moved(
        _point(end.position(name) - start.position(name)),
        _point(end.position(name)),
        round(tilt, 1),
    )


def _offset(goal: Goal, position: Array) -> Offset:
    """A place minus the goal's, metres; None where the goal leaves a coordinate free."""
    wanted = goal.place or (None, None, None)
    x, y, z = (
        None if w is None else round(float(p) - w, 4) + 0.0
        for w, p in zip(wanted, position, strict=True)
    )
    return x, y, z


def _in_place(
    goal: Goal, name: str, start: State, end: State, contacts: Contacts
) -> bool:
    turned = Goal(
        (name,),
        axis=goal.axis,
        points=goal.points,
        tolerance_deg=goal.tolerance_deg,
        rest=goal.rest,
        keep=(name,),
    )
    if progress(turned, start, end) < DONE or (
        goal.held and not contacts.held(name)[-1]
    ):
        return False
    if goal.joint is not None:
        far = PLACE_M if end.joints[goal.joint].joint.kind == "slider" else PLACE_RAD
        return _left(goal, start, end) <= max(goal.tolerance, far)
    if goal.away is not None:
        return _length(end.position(name) - start.position(name)) >= goal.away
    return _apart(goal, end.position(name)) <= max(goal.tolerance, PLACE_M)


def _left(goal: Goal, start: State, end: State) -> float:
    """How far the goal's bodies are from where it wants them, on average, metres; or its joint, m or rad."""
    if goal.joint is not None:
        return float(np.abs(end.joint(goal.joint).position - (goal.to or 0.0)))
    if goal.away is not None:
        moved = [
            _length(end.position(name) - start.position(name)) for name in goal.bodies
        ]
        return float(np.mean([max(goal.away - way, 0.0) for way in moved]))
    return float(np.mean([_apart(goal, end.position(name)) for name in goal.bodies]))


def _apart(goal: Goal, position: Array) -> float:
    return _length([offset for offset in _offset(goal, position) if offset is not None])


def _length(vector: Array | tuple[float, ...] | list[float]) -> float:
    return float(np.linalg.norm(vector))


def _point(position: Array, digits: int = 4) -> Point:
    x, y, z = (round(float(number), digits) + 0.0 for number in position)
    return x, y, z


def _rounded(contact: Contact) -> Contact:
    return replace(
        contact,
        first_s=round(contact.first_s, 2),
        last_s=round(contact.last_s, 2),
        depth_m=round(contact.depth_m, 4) + 0.0,
    )
