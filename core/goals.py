"""Define a task's goals in a form that programs can read, and the reward that follows from them.

Plugins import it from `core.scene`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Protocol

import numpy as np

from core.geometry import Array, Pose, Vector
from core.values.joints import Layout, Placement, rotate
from core.values.margins import Margin
from core.values.states import State, Trace

Place = tuple[float | None, float | None, float | None]

SLIP_M, SLIP_RAD = (
    0.1,
    0.5,
)  # what is right at the start counts as lost when it is so far off
SLIP_SHARE = 0.2  # likewise, of a limit of height or area
STILL_M_S, STILL_RAD_S = 0.02, 0.2  # at rest
KEPT_M, STRAYED_M = (
    0.02,
    0.1,
)  # a body to keep may move so far; from here on nothing is earned
DONE = 0.95  # a goal is fulfilled from this progress on, where one instant is compared with another


@dataclass(frozen=True)
class Goal:
    """A task's goal in a form that programs can read: which bodies to move, and where.

    At most one of ``place``, ``places``, ``away`` and ``joint`` says how far there is to go. ``place`` is where
    ``bodies`` must end (metres, world frame; None: that coordinate is free) within ``tolerance`` metres; ``places`` has
    one for each body; ``away`` is how far each must end from its start, in any direction; and ``joint`` must end at the
    position ``to`` (m, or rad) within ``tolerance``. With ``at``, places and ``points`` are in the frame of that body
    or mark, as it stands in the layout; if it may be turned, give both x and y or neither. With ``any`` one of the
    bodies is enough. Goals are hints for programs: the reward is the task's own, or what `goals_reward` makes of them.

    Attributes:
        node: of soft bodies, the number of the node whose place counts; None: the centre of mass.
        max_height_m: how high soft bodies may be at the end, from their lowest node to their highest; 0: any height.
        min_area_m2: the area that each must cover at the end, as seen from above; 0: any.
        keep: bodies to leave in place.
        axis: an axis (3,) of the bodies' frames that must end along ``points`` (3,), within ``tolerance_deg`` degrees.
        rest: the bodies must end at rest, or the joint.
        held: the robot must carry the bodies at the end: they touch it, and nothing that is fixed.
        by_s: how long the motion may take until the goal is fulfilled, s.
        ever: whether it is enough to fulfil it at some time; else it must be fulfilled at the end.
        after: the ``name``, or the number from 0, of a goal that must be fulfilled before this one is.
        untouched: bodies that the robot must not touch, or with ``max_force_n`` above 0, not press harder, N.
        weight: how much it counts where all goals do.
        name: see ``after``.

    Raises:
        ValueError: there is nothing to reach, two ways to go, or a number that can't be.
    """

    bodies: tuple[str, ...] = ()
    place: Place | None = None
    away: float | None = None
    tolerance: float = 0.0
    any: bool = False
    keep: tuple[str, ...] = ()
    at: str | None = None
    places: tuple[Place, ...] = ()
    joint: str | None = None
    to: float | None = None
    axis: Vector | None = None
    points: Vector = (0.0, 0.0, 1.0)
    tolerance_deg: float = 10.0
    rest: bool = False
    held: bool = False
    by_s: float | None = None
    ever: bool = False
    after: str | int | None = None
    untouched: tuple[str, ...] = ()
    max_force_n: float = 0.0
    weight: float = 1.0
    name: str = ""
    node: int | None = None
    max_height_m: float = 0.0
    min_area_m2: float = 0.0

    def __post_init__(self) -> None:
        ways = (
            (self.place is not None or self.joint is not None)
            + (self.away is not None)
            + bool(self.places)
        )
        shape = (self.max_height_m, self.min_area_m2)
        wanted = (
            self.axis is not None,
            self.rest,
            self.held,
            self.untouched,
            self.keep,
            *shape,
        )
        if (
            ways > 1
            or not (ways or any(wanted))
            or (self.joint is None) != (self.to is None)
        ):
            raise ValueError(
                "a goal needs either place or away (the distance from the start), or places, or joint and to, not two "
                "of these; or one of axis, rest, held, max_height_m, min_area_m2, untouched and keep"
            )
        if self.joint is not None and self.at is not None:
            raise ValueError(
                "a goal with a joint has no at: its position is the joint's own"
            )
        if self.places and len(self.places) != len(self.bodies):
            raise ValueError(
                f"a goal's places need one for each of its {len(self.bodies)} bodies"
            )
        if self.axis is not None and not (
            np.linalg.norm(self.axis) > 0 and np.linalg.norm(self.points) > 0
        ):
            raise ValueError("a goal's axis and points need a length")
        if (
            min(self.tolerance, self.tolerance_deg, self.max_force_n, *shape) < 0
            or not 0 < self.weight < np.inf
        ):
            raise ValueError(
                "a goal's tolerances and limits must be 0 or more, its weight above 0"
            )
        if self.by_s is not None and not self.by_s > 0:
            raise ValueError(f"a goal's by_s must be above 0, got {self.by_s}")

    @property
    def moves(self) -> bool:
        """Whether there is something to reach; else it only says what to leave alone."""
        return bool(self.joint or self.bodies)

    def within(self, scene: Layout) -> Goal:
        """Return the goal in a layout: with ``place``, ``places`` and ``points`` in the world.

        A ``joint`` gives its body, and the place where the body's frame must get.

        Raises:
            KeyError: there is no body ``at``, or no such joint.
        """
        if self.joint is not None and self.place is None:
            placed = scene.placed_joints[self.joint]
            if placed.joint.kind == "ball":
                return replace(self, bodies=(placed.joint.body,))
            parent = (
                scene[placed.joint.parent].pose
                if placed.joint.parent is not None
                else Pose()
            )
            moved = placed.carry(
                np.asarray(self.to), np.zeros(()), Placement.at_rest(parent)
            ).position
            return replace(
                self,
                bodies=(placed.joint.body,),
                place=(float(moved[0]), float(moved[1]), float(moved[2])),
            )
        if self.at is None:
            return self
        frame = scene[self.at].pose
        there = None if self.place is None else _in_world(frame, self.place)
        points = (
            tuple(float(p) for p in frame.rotation.apply(self.points))
            if self.axis is not None
            else self.points
        )
        return replace(
            self,
            place=there,
            places=tuple(_in_world(frame, p) for p in self.places),
            points=points,
            at=None,
        )

    def spread(self) -> tuple[Goal, ...]:
        """Split a goal with ``places`` into one with a ``place`` for each body."""
        if not self.places:
            return (self,)
        pairs = zip(self.bodies, self.places, strict=True)
        return tuple(
            replace(self, bodies=(body,), place=place, places=())
            for body, place in pairs
        )


class Aim(Protocol):
    """A task, or what has its goals."""

    @property
    def goals(self) -> Sequence[Goal]: ...

    @property
    def every(self) -> bool: ...


def _in_world(frame: Pose, place: Place) -> Place:
    there = frame.apply([0.0 if wanted is None else wanted for wanted in place])
    x, y, z = (
        None if w is None else float(p) for w, p in zip(place, there, strict=True)
    )
    return x, y, z


def needs_trace(goals: Sequence[Goal]) -> bool:
    """Report whether the reward of goals needs to know what happened before the end, or what touched."""
    return any(
        g.held or g.ever or g.by_s is not None or g.after is not None or g.untouched
        for g in goals
    )


def goals_reward(
    task: Aim, start: State, end: State, trace: Trace | None = None
) -> Array:
    """Compute the reward, 0..1, that a task's goals stand for, of one world or of many, (...).

    The progress of a goal rises from 0 at the start to 1 where it is fulfilled, linearly with the distance that is left
    over. With ``every`` the goals' mean counts, by weight, else the best of
    them. It is 0 where the robot touched what it must not, and less where a body to keep moved.

    Raises:
        ValueError: the goals need a trace, and there is none; or a goal comes after one that is not there.
    """
    if trace is None and needs_trace(task.goals):
        raise ValueError(
            "the goals need a trace: declare reward(self, start, end, trace), and pass the trace on"
        )
    judge = _Judge(tuple(task.goals), start, trace)
    factors = [_left_alone(goal, start, end, trace) for goal in task.goals]
    earned = [judge.earned(goal, end) for goal in task.goals if goal.moves]
    shape, moving = end.positions.shape[:-2], [goal.moves for goal in task.goals]
    guards = [
        factor
        for factor, moves in zip(factors, moving, strict=True)
        if task.every or not moves
    ]
    total = np.zeros(shape)
    if task.every and earned:
        total = np.average(
            earned, axis=0, weights=[goal.weight for goal in task.goals if goal.moves]
        )
    elif earned:
        own = [factor for factor, moves in zip(factors, moving, strict=True) if moves]
        total = np.max(
            [one * factor for one, factor in zip(earned, own, strict=True)], axis=0
        )
    return np.clip(reduce(np.multiply, guards, total), 0.0, 1.0)


def goals_shares(
    task: Aim, start: State, end: State, trace: Trace | None = None
) -> tuple[tuple[str, float], ...]:
    """Say how far one world fulfilled each of several goals that all count, 0..1; none where one goal is enough."""
    moving = [(number, goal) for number, goal in enumerate(task.goals) if goal.moves]
    if not task.every or len(moving) < 2:
        return ()
    judge = _Judge(tuple(task.goals), start, trace)
    return tuple(
        (
            goal.name or f"{goal.joint or ' '.join(goal.bodies[:3])} (goal {number})",
            float(judge.earned(goal, end)),
        )
        for number, goal in moving
    )


@dataclass(frozen=True, eq=False)
class _Judge:
    """The goals, and what they are judged by."""

    goals: tuple[Goal, ...]
    start: State
    trace: Trace | None

    def earned(self, goal: Goal, end: State) -> Array:
        """Compute the progress of a goal, (...), with all that it asks of time."""
        reached = progress(
            goal, self.start, end, lambda name: self._hold(name)[..., -1]
        )
        if goal.by_s is not None or goal.ever:
            in_time = self.film.times <= (np.inf if goal.by_s is None else goal.by_s)
            best = self.over_time(goal)[..., in_time].max(axis=-1)
            reached = best if goal.ever else np.minimum(best, reached)
        if goal.after is not None:
            first, this = self.over_time(self._named(goal.after)), self.over_time(goal)
            # Not fulfilled at or after an instant: what comes later can't be before this goal.
            open_ = np.flip(
                np.logical_or.accumulate(np.flip(this < DONE, axis=-1), axis=-1),
                axis=-1,
            )
            before = np.where(open_, first, 0.0).max(axis=-1)
            reached = np.minimum(reached, np.where(before >= DONE, 1.0, before))
        return reached

    def margins(self, goal: Goal, end: State) -> Iterator[Margin]:
        """Yield the margins of one world to what a goal asks of speed and time, of several bodies that of the worst."""
        bodies = goal.bodies or (self.start.joints[goal.joint or ""].joint.body,)
        what = goal.joint or (
            bodies[0] if len(bodies) == 1 else "any body" if goal.any else "bodies"
        )
        if goal.rest:
            speeds = [float(_unrest(goal, name, end)) for name in bodies]
            yield Margin.at_most(
                f"speed of {what}",
                min(speeds) if goal.any else max(speeds),
                1.0,
                "resting speeds",
            )
        if goal.by_s is not None and self.trace is not None:
            done, late = (
                self.film.times[self.over_time(goal) >= DONE],
                max(float(self.film.times[-1]), goal.by_s),
            )
            yield Margin.at_most(
                f"time to fulfil {what}", float(done.min(initial=late)), goal.by_s, "s"
            )

    def over_time(self, goal: Goal) -> Array:
        """Compute the progress of a goal at each instant of the trace, (..., T)."""
        start = self.start.each(lambda array: array[..., None, :, :])
        return progress(goal, start, self.film.states, self._hold)

    @property
    def film(self) -> Trace:
        assert self.trace is not None
        return self.trace

    def _hold(self, name: str) -> Array:
        """Report at which instants a body is held: 1, or 0.5 where the robot only touches it, (..., T)."""
        return np.maximum(self.film.held(name), self.film.contact(name, "robot") / 2)

    def _named(self, which: str | int) -> Goal:
        if isinstance(which, int) and 0 <= which < len(self.goals):
            return self.goals[which]
        for goal in self.goals:
            if goal.name and goal.name == which:
                return goal
        names = ", ".join(
            goal.name or str(number) for number, goal in enumerate(self.goals)
        )
        raise ValueError(
            f"a goal comes after {which!r}, which is no goal; there are: {names}"
        )


def goals_margins(
    task: Aim, start: State, end: State, trace: Trace | None = None
) -> list[Margin]:
    """Say how far one world stayed from the limits of a task's goals.

    Of a goal's bodies the one with the least margin counts, or with ``any`` the one with the greatest; of goals one of
    which is enough, that whose least margin is the greatest.
    """
    found = [
        margin for goal in task.goals for margin in _guards(goal, start, end, trace)
    ]
    judge = _Judge(tuple(task.goals), start, trace)
    every = (
        [*_reached(goal, start, end), *judge.margins(goal, end)]
        for goal in task.goals
        if goal.moves
    )
    reached = [margins for margins in every if margins]
    if not task.every and reached:
        reached = [max(reached, key=lambda margins: min(m.margin for m in margins))]
    return [*found, *(margin for margins in reached for margin in margins)]


def _guards(
    goal: Goal, start: State, end: State, trace: Trace | None
) -> Iterator[Margin]:
    """Yield the margins of what a goal wants left alone."""
    for name in goal.keep:
        yield Margin.at_most(
            f"{name} moved",
            float(_length(end.position(name) - start.position(name))),
            KEPT_M,
            "m",
        )
    for name in goal.untouched if trace is not None else ():
        assert trace is not None
        if not goal.max_force_n and (gap := trace.clearances.get(name)) is not None:
            yield Margin.clearance(
                name, 0.0 if trace.touched(name, "robot") else float(gap)
            )
        elif goal.max_force_n and trace.forces is not None:
            yield Margin.at_most(
                f"force on {name}",
                float(trace.force_n(name, "robot")),
                goal.max_force_n,
                "N",
            )


def _reached(goal: Goal, start: State, end: State) -> list[Margin]:
    """Return the margins of the end of what a goal moves: of each thing that is asked, that of one body."""
    bodies = goal.bodies or (start.joints[goal.joint or ""].joint.body,)
    each = [
        [asked.margin(end) for asked in _asked(goal, n, name, start)]
        for n, name in enumerate(bodies)
    ]
    known = [
        [margin for margin in alike if margin is not None]
        for alike in zip(*each, strict=True)
    ]
    one = max if goal.any else min
    return [one(alike, key=lambda margin: margin.margin) for alike in known if alike]


def progress(
    goal: Goal, start: State, now: State, held: Callable[[str], Array] | None = None
) -> Array:
    """Compute how far a goal is fulfilled in states, 0..1, (...), whatever it asks of time and of contacts.

    ``held`` says how far the robot holds a body; None: that does not count.
    """
    shape = now.positions.shape[:-2]
    each = []
    for number, name in enumerate(
        goal.bodies or (now.joints[goal.joint or ""].joint.body,)
    ):
        left, before = np.zeros(shape), np.zeros(shape)
        for asked in _asked(goal, number, name, start):
            first = np.broadcast_to(asked.left(start), shape)
            scale = np.maximum(first, asked.slip)
            left, before = left + asked.left(now) / scale, before + first / scale
        reached = np.clip(1 - left / np.where(before > 0, before, 1.0), 0.0, 1.0)
        if goal.rest:
            reached = reached / np.maximum(_unrest(goal, name, now), 1.0)
        if goal.held and held is not None:
            reached = reached * held(name)
        each.append(reached)
    found: Array = np.max(each, axis=0) if goal.any else np.mean(each, axis=0)
    return found


@dataclass(frozen=True)
class _Asked:
    """One thing that is asked of a body: that a measure of a state is at most ``most``, in m, or rad.

    ``slip`` is how much beyond counts as lost. A way that must be gone is measured as a negative one.
    """

    name: str
    measure: Callable[[State], Array]
    most: float
    slip: float
    unit: str

    def left(self, state: State) -> Array:
        return np.maximum(self.measure(state) - self.most, 0.0)

    def margin(self, end: State) -> Margin | None:
        """Return the margin of one world; None: nothing may be off, so that there is no room."""
        value = float(self.measure(end))
        if self.most < 0:
            return Margin.at_least(self.name, -value, -self.most, self.unit, self.slip)
        return (
            Margin.at_most(self.name, value, self.most, self.unit)
            if self.most > 0
            else None
        )


def _asked(goal: Goal, number: int, name: str, start: State) -> Iterator[_Asked]:
    """Yield each thing that is asked of the end of a body."""
    place, node = goal.places[number] if goal.places else goal.place, goal.node
    if goal.joint is not None:
        joint, to = goal.joint, goal.to or 0.0
        slip, unit = (
            (SLIP_M, "m")
            if start.joints[joint].joint.kind == "slider"
            else (SLIP_RAD, "rad")
        )
        off = f"{joint} off its position"
        yield _Asked(
            off,
            lambda state: np.abs(state.joint(joint).position - to),
            goal.tolerance,
            slip,
            unit,
        )
    elif place is not None:
        there = np.array([0.0 if wanted is None else wanted for wanted in place])
        there = (
            there
            if goal.at is None
            else start.position(goal.at) + rotate(start.quaternion(goal.at), there)
        )
        free = np.array([float(wanted is not None) for wanted in place])
        off, near = f"{name} off its place", goal.tolerance
        yield _Asked(
            off,
            lambda state: _length((state.position(name, node) - there) * free),
            near,
            SLIP_M,
            "m",
        )
    elif goal.away is not None:
        begin, way = start.position(name, node), f"way of {name}"
        yield _Asked(
            way,
            lambda state: -_length(state.position(name, node) - begin),
            -goal.away,
            SLIP_M,
            "m",
        )
    if high := goal.max_height_m:
        yield _Asked(
            f"height of {name}",
            lambda state: state.extent(name)[..., 2],
            high,
            SLIP_SHARE * high,
            "m",
        )
    if area := goal.min_area_m2:
        yield _Asked(
            f"area of {name}",
            lambda state: -state.covered_area(name),
            -area,
            SLIP_SHARE * area,
            "m^2",
        )
    if goal.axis is not None:
        axis = np.divide(goal.axis, np.linalg.norm(goal.axis))
        points = np.divide(goal.points, np.linalg.norm(goal.points))
        points = (
            points if goal.at is None else rotate(start.quaternion(goal.at), points)
        )

        def angle(state: State) -> Array:
            along = (rotate(state.quaternion(name), axis) * points).sum(axis=-1)
            between: Array = np.arccos(np.clip(along, -1.0, 1.0))
            return between

        yield _Asked(
            f"angle of {name}",
            angle,
            float(np.radians(goal.tolerance_deg)),
            SLIP_RAD,
            "rad",
        )


def _unrest(goal: Goal, name: str, state: State) -> Array:
    """Measure how many times as fast as what is at rest a body is, or a joint."""
    if goal.joint is not None:
        slider = state.joints[goal.joint].joint.kind == "slider"
        return np.abs(state.joint(goal.joint).speed) / (
            STILL_M_S if slider else STILL_RAD_S
        )
    moved = state.placement(name)
    return np.maximum(
        _length(moved.linear) / STILL_M_S, _length(moved.angular) / STILL_RAD_S
    )


def _left_alone(goal: Goal, start: State, end: State, trace: Trace | None) -> Array:
    """Compute the factor, 0..1, of what a goal wants left alone, (...)."""
    factor: Array = np.ones(end.positions.shape[:-2])
    for name in goal.keep:
        moved = _length(end.position(name) - start.position(name))
        factor = factor * np.clip((STRAYED_M - moved) / (STRAYED_M - KEPT_M), 0.0, 1.0)
    for name in goal.untouched:
        assert trace is not None
        pressed = (
            trace.force_n(name, "robot") > goal.max_force_n
            if goal.max_force_n
            else trace.touched(name, "robot")
        )
        factor = factor * ~pressed
    return factor


def _length(vectors: Array) -> Array:
    lengths: Array = np.linalg.norm(vectors, axis=-1)
    return lengths
