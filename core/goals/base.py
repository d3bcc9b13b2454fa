"""Define what all kinds of goals share, and what follows from many goals."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import KW_ONLY, dataclass
from itertools import chain
from typing import Protocol

import numpy as np

from core.errors import UsageError, choices, refuse
from core.geometry import Array
from core.scene import FIXTURE, Body, Scene, Soft
from core.values.margins import Margin
from core.values.spans import Span
from core.values.states import State
from core.values.traces import TRACE_HZ, Trace

Coordinate = float | Span | None
Coordinates = tuple[Coordinate, Coordinate, Coordinate]
"""A place, m; a coordinate that is None is free."""

SLIP_M = 0.1  # what is right at the start counts as lost when it is so far off
SLIP_RAD = 0.5
SLIP_DEG = float(np.degrees(SLIP_RAD))
SLIP_SHARE = 0.2  # of a limit of height or area: what is so far off counts as lost
NEAR_M = 0.02  # observations call a body in place up to here, if the tolerance is less
NEAR_RAD = 0.1
STILL_M_S = 0.02  # what is slower is at rest
STILL_RAD_S = 0.2
REST_S = 0.3  # what is slower for so long is at rest: it does not only turn back
BREAKS = "of what breaks it"  # the unit of forces on what can break
DONE = 0.95  # a goal is fulfilled from this progress on, where instants are compared

FREE_BODY = "body that can move"
SOLID_BODY = "body that can be touched"
BREAKABLE = "thing that breaks"
NAMED = {
    "bodies": FREE_BODY,
    "keep": FREE_BODY,
    "untouched": SOLID_BODY,
    "at": "body",
    "by": SOLID_BODY,
    "facing": "body",
    "joint": "joint",
    "broken": BREAKABLE,
    "unbroken": BREAKABLE,
}
"""The fields of goals that name things of the scene, and which: see `list_names`."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """What goals are judged by, of one world or of many.

    Attributes:
        start: the state after settling, before the motion.
        end: the state after the motion.
        trace: what happened in between; None: nothing was recorded.
        goals: the task's, since one may come after another.
    """

    start: State
    end: State
    trace: Trace | None = None
    goals: Sequence[Goal] = ()

    @property
    def film(self) -> Trace:
        """The trace.

        Raises:
            ValueError: there is none.
        """
        if self.trace is None:
            raise ValueError(
                "the goals need a trace: declare reward(self, start, end, trace), and pass the trace on"
            )

        return self.trace

    def hold(self, body: str) -> Array:
        """Report at which instants a body is held: 1, or 0.5 where the robot only touches it, (..., T)."""
        return np.maximum(self.film.held(body), self.film.contact(body, "robot") / 2)

    def unrest(self, goal: Reach, body: str) -> Array:
        """Measure how many times as fast as what is at rest a body was within `REST_S`, at each instant, (..., T)."""
        values = goal.unrest(body, self.film.states)
        count = round(REST_S * TRACE_HZ)
        # Before the first instant it was as fast as there.
        begin = np.repeat(values[..., :1], count, axis=-1)
        longer = np.concatenate([begin, values], axis=-1)
        windows = np.lib.stride_tricks.sliding_window_view(longer, count + 1, axis=-1)
        return np.asarray(windows.max(axis=-1))

    def moved(self, body: str) -> Array:
        """Measure how far a body is from where it was at the start, m, (...)."""
        return length(self.end.position(body) - self.start.position(body))

    def ways(self, body: str) -> Array:
        """Measure how far a body is from where it was at the start at each instant, m, (..., T)."""
        begin = self.start.position(body)[..., None, :]
        return length(self.film.states.position(body) - begin)


@dataclass(frozen=True)
class Conduct:
    """What a trace says of bodies at its instants, or at its end: are they held, let go, and at rest?

    Attributes:
        evidence: with the trace.
        at_end: whether only its last instant counts, (...); else all do, (..., T).
    """

    evidence: Evidence
    at_end: bool = False

    def hold(self, body: str) -> Array:
        """Report how far the robot holds a body, see `Evidence.hold`."""
        return self._read(self.evidence.hold(body))

    def let_go(self, body: str) -> Array:
        """Report where neither the robot nor what it moves along touches a body: 1, else 0."""
        let_go = ~self.evidence.film.linked(body)
        return self._read(let_go.astype(np.float64))

    def unrest(self, goal: Reach, body: str, now: State) -> Array:
        """Measure how many times as fast as what is at rest a body was lately, and is ``now``."""
        speed = goal.unrest(body, now)
        if self.evidence.trace is None:
            return speed
        return np.maximum(speed, self._read(self.evidence.unrest(goal, body)))

    def strain(self, name: str) -> Array:
        """Find the largest force so far on what can break, as a share of what it bears."""
        return self._read(self.evidence.film.strain(name))

    def _read(self, values: Array) -> Array:
        return values[..., -1] if self.at_end else values


@dataclass(frozen=True)
class Measure:
    """A figure of a state that is to end at most at a limit, or at least.

    A cup that must end higher than 0.2 m::

        Measure("height of cup", height, 0.2, slip=0.1, unit="m", at_least=True)

    Attributes:
        name: what it is, for its margin, such as ``height of cup``.
        value: computes it from the states of one world or of many, (...).
        limit: where it is to end; a place without a tolerance has the limit 0.
        slip: how far beyond the limit counts as lost, where the figure is right at the start.
        unit: of all its numbers: m, rad, ...
        at_least: whether it must not end below the limit; else not above it.
        near: up to here observations call it good, where the limit is lower.
        far: so far below a limit that it must not exceed is safe; 0: where the figure is 0.
        whole: whether less than half counts until it is there. What was there at the start is lost once it is not.
    """

    name: str
    value: Callable[[State], Array]
    limit: float
    slip: float
    unit: str
    at_least: bool = False
    near: float = 0.0
    far: float = 0.0
    whole: bool = False

    @classmethod
    def within(
        cls,
        span: Span,
        name: str,
        value: Callable[[State], Array],
        unit: str,
        far: float,
    ) -> Iterator[Measure]:
        """Yield what a span asks of a figure; so ``far`` beyond an end counts as lost, and so far within as safe."""
        if not math.isinf(span.low):
            yield cls(name, value, span.low, far, unit, at_least=True)
        if not math.isinf(span.high):
            yield cls(name, value, span.high, far, unit, far=far)

    def left(self, state: State) -> Array:
        """Compute how far a state is beyond the limit, (...)."""
        value = self.value(state)

        beyond = value - self.limit
        if self.at_least:
            beyond = self.limit - value

        return np.maximum(beyond, 0.0)

    def lost(self, before: Array, left: Array) -> Array:
        """Compute which part of the way is ``left``, (...), of what was left ``before``, at the start; see `left`.

        Where nothing was, it is counted in slips.
        """
        part: Array = left / np.maximum(before, self.slip)
        if not self.whole:
            return part

        on_the_way = np.where(before > 0, (1 + part) / 2, 1.0)
        return np.where(left > 0, on_the_way, 0.0)

    def margin(self, end: State) -> Margin | None:
        """Return the margin of one world; None: nothing may be off, so that there is no room."""
        value = float(self.value(end))

        if self.at_least:
            return Margin.at_least(self.name, value, self.limit, self.unit, self.slip)
        if self.limit > 0 or self.far:
            return Margin.at_most(self.name, value, self.limit, self.unit, self.far)

        return None


class Goal(ABC):
    """Something that a task wants.

    Goals are hints for programs: the reward is the task's own, or `goals_reward`. A model is told of them in words, an
    observer says by them what became of a body, and a margin says how close it was.
    """

    @abstractmethod
    def share(self, evidence: Evidence) -> Array:
        """Compute how far it was fulfilled, 0..1, (...).

        Raises:
            ValueError: it needs a trace, and there is none.
        """

    @abstractmethod
    def margins(self, evidence: Evidence) -> list[Margin]:
        """Return how far one world stayed from its limits."""

    @property
    def needs_trace(self) -> bool:
        """Whether its share depends on what happened before the end, or on what touched."""
        return False

    @property
    def needs_peaks(self) -> bool:
        """Whether it limits a force, so that each step of the engine has to be recorded."""
        return False


@dataclass(frozen=True)
class Reach(Goal):
    """Bodies that must end in some way: at rest or held, wherever they are; its kinds say more.

    Of a cube that only has to be held: ``Reach(("cube",), held=True)``. A kind says what it measures of each body
    (`measures`), and where it wants them (`place_of`).

    Attributes:
        bodies: their names.
        any: whether one of the bodies is enough.
        enough: how many of them are, a whole number, or which share of them, up to 1.0; None: all are wanted.
        also: what else must hold of the same bodies at once; their names need not be repeated there.
        rest: they must end at rest, and have been so for `REST_S`, if there is a trace.
        held: the robot must carry them at the end: they touch it, and nothing that is fixed.
        released: the robot must not touch them at the end, nor anything that it touches through other bodies.
        by_s: how long the motion may take until the goal is fulfilled, s.
        ever: whether it is enough to fulfil it at some time; else it must be fulfilled at the end.
        after: the ``name``, or the number from 0, of a goal that must be fulfilled before this one is.
        weight: how much it counts where all goals do.
        name: see ``after``.
    """

    bodies: tuple[str, ...] = ()
    _: KW_ONLY
    any: bool = False
    enough: int | float | None = None
    also: tuple[Reach, ...] = ()
    rest: bool = False
    held: bool = False
    released: bool = False
    by_s: float | None = None
    ever: bool = False
    after: str | int | None = None
    weight: float = 1.0
    name: str = ""

    def __post_init__(self) -> None:
        fields = ("tolerance", "tolerance_deg", "away")  # that kinds have
        least = min(getattr(self, name, 0.0) for name in fields)
        ends = [self.rest, self.held, self.released]
        only_bodies = type(self) is Reach and not (any(ends) or self.also)
        asked = [(part.rest, part.held, part.released) for part in self.also]
        misplaced = np.greater(asked or ends, ends).any()

        refuse(
            "a goal's ",
            {
                "tolerances and ways must be 0 or more": least < 0,
                "enough must be above 0": self.enough is not None and self.enough <= 0,
                "enough must be a whole number of bodies, or a share of them up to 1.0": (
                    isinstance(self.enough, float) and self.enough > 1
                ),
                "any and enough both say how many; leave one of them out": (
                    self.any and self.enough is not None
                ),
                "weight must be above 0": not 0 < self.weight < np.inf,
                "by_s must be above 0": self.by_s is not None and not self.by_s > 0,
                "kind must say what is to be reached, or rest, held or released": only_bodies,
                "held and released say the opposite; leave one of them out": (
                    self.held and self.released
                ),
                "rest, held and released stand in the goal itself, not in also": bool(
                    misplaced
                ),
            },
        )

    # What a kind says:

    def measures(self, body: str, start: State) -> Iterable[Measure]:
        """Return what it asks of the end of a body; ``start`` is the state before the motion."""
        return ()

    def place_of(self, body: str, start: State) -> Array | None:
        """Return where it wants a body's frame, (..., 3) in the world, nan where it is free; None: it says no place."""
        return None

    def unrest(self, body: str, state: State) -> Array:
        """Measure how many times as fast as what is at rest a body is, (...)."""
        moved = state.placement(body)
        slides = length(moved.linear) / STILL_M_S
        turns = length(moved.angular) / STILL_RAD_S
        return np.maximum(slides, turns)

    def subjects(self, state: State) -> tuple[str, ...]:
        """Return the bodies that are looked at."""
        return self.bodies

    @property
    def subject(self) -> str:
        """What it is about, in words."""
        return (" or " if self.any else ", ").join(self.bodies)

    def label(self, number: int) -> str:
        """Return its name, or what it is about and its number among the goals."""
        what = ", ".join(self.bodies[:3]) or self.subject
        return self.name or f"{what} (goal {number})"

    # What follows from it:

    @property
    def parts(self) -> tuple[Reach, ...]:
        """The goal itself, and what it also wants."""
        return (self, *self.also)

    @property
    def needs_trace(self) -> bool:
        """Whether it asks for a time, or for what the robot touches."""
        in_time = self.by_s is not None or self.ever or self.after is not None
        return self.held or self.released or self.rest or in_time

    def all_measures(self, body: str, start: State) -> list[Measure]:
        """Return what its parts ask of a body."""
        return list(chain(*(part.measures(body, start) for part in self.parts)))

    def progress(
        self, start: State, now: State, conduct: Conduct | None = None
    ) -> Array:
        """Compute how far it is fulfilled in states, 0..1, (...), whatever it asks of time.

        ``conduct`` says whether the robot holds a body, and how it moved lately; None: that does not count. Nothing is
        fulfilled that names a fixture, where the design has none.
        """
        if needs_fixture(self) and start.fixture is None:
            return np.zeros(now.positions.shape[:-2])

        shares = []

        for body in self.subjects(now):
            reached = self._approach(body, start, now)

            if self.rest and conduct is None:
                reached = reached / np.maximum(self.unrest(body, now), 1.0)
            elif self.rest and conduct is not None:
                speed = conduct.unrest(self, body, now)
                reached = reached / np.maximum(speed, 1.0)
            if self.held and conduct is not None:
                reached = reached * conduct.hold(body)
            if self.released and conduct is not None:
                reached = reached * conduct.let_go(body)

            shares.append(reached)

        return self._average(shares)

    def _average(self, shares: Sequence[Array]) -> Array:
        """Average the shares (...) of the best of its things: of as many as are enough."""
        if not shares:
            raise ValueError("a goal to reach needs bodies")

        best = self.count_enough(len(shares))
        counted = np.array(shares)
        if best < len(shares):
            counted = np.sort(shares, axis=0)[-best:]
        return np.asarray(np.mean(counted, axis=0))

    def count_enough(self, bodies: int) -> int:
        """Return how many of so many bodies are enough."""
        if self.any:
            return 1
        if self.enough is None:
            return bodies
        if isinstance(self.enough, float):
            return math.ceil(round(self.enough * bodies, 9))
        return min(self.enough, bodies)

    def _approach(self, body: str, start: State, now: State) -> Array:
        """Compute which share of a body's way from its start is done, 0..1, (...).

        What is right at the start counts as lost from its measure's slip on.
        """
        shape = now.positions.shape[:-2]
        left = np.zeros(shape)
        before = np.zeros(shape)

        for measure in self.all_measures(body, start):
            first = np.broadcast_to(measure.left(start), shape)
            left = left + measure.lost(first, measure.left(now))
            before = before + measure.lost(first, first)

        share = left / np.where(before > 0, before, 1.0)
        return np.clip(1 - share, 0.0, 1.0)

    def progress_over_time(self, evidence: Evidence) -> Array:
        """Compute its progress at each instant of the trace, (..., T).

        Raises:
            ValueError: there is no trace.
        """
        start = evidence.start.each(lambda array: array[..., None, :, :])
        return self.progress(start, evidence.film.states, Conduct(evidence))

    def share(self, evidence: Evidence) -> Array:
        conduct = Conduct(evidence, at_end=True)
        reached = self.progress(evidence.start, evidence.end, conduct)
        if self.by_s is not None or self.ever:
            progress = self.progress_over_time(evidence)
            if self.by_s is not None:
                progress = progress[..., evidence.film.times <= self.by_s]

            best = progress.max(axis=-1)
            reached = best if self.ever else np.minimum(best, reached)

        if self.after is not None:
            reached = np.minimum(reached, self._share_before(self.after, evidence))
        return reached

    def _share_before(self, which: str | int, evidence: Evidence) -> Array:
        """Compute how far another goal was fulfilled before this one was for good, (...).

        Raises:
            ValueError: there is no such goal.
        """
        number = number_of(which, evidence.goals)
        if number is None:
            numbered = enumerate(evidence.goals)
            names = [goal.name or k for k, goal in numbered if isinstance(goal, Reach)]
            raise ValueError(
                f"a goal comes after {which!r}, which is no goal; there are: {', '.join(map(str, names))}"
            )

        other = evidence.goals[number]
        assert isinstance(other, Reach)
        first = other.progress_over_time(evidence)
        unfulfilled = self.progress_over_time(evidence) < DONE

        # Not fulfilled at or after an instant: what comes later can't be before this goal.
        backward = np.logical_or.accumulate(np.flip(unfulfilled, axis=-1), axis=-1)
        open_until = np.flip(backward, axis=-1)
        before = np.where(open_until, first, 0.0).max(axis=-1)
        return np.where(before >= DONE, 1.0, before)

    def is_in_place(self, body: str, start: State, end: State) -> bool:
        """Report whether a body of one world ends as it should, with the tolerance of an observer."""
        if self.rest and self.unrest(body, end) * DONE > 1:
            return False
        return all(
            measure.left(end) <= max(measure.near - measure.limit, 0.0)
            for measure in self.all_measures(body, start)
        )

    def margins(self, evidence: Evidence) -> list[Margin]:
        """Return those of one world; of several bodies, those of the worst that is needed."""
        end = evidence.end
        bodies = self.subjects(end)

        measures = [self.all_measures(body, evidence.start) for body in bodies]
        found = []

        for alike in zip(*measures, strict=True):
            margins = filter(None, [measure.margin(end) for measure in alike])
            best_first = sorted(margins, key=lambda margin: -margin.margin)

            if best_first:
                found.append(best_first[self.count_enough(len(best_first)) - 1])

        what = self.subject if len(bodies) == 1 else "bodies"

        if self.rest:
            conduct = Conduct(evidence, at_end=True)
            speeds = sorted(float(conduct.unrest(self, b, end)) for b in bodies)
            fastest = speeds[self.count_enough(len(speeds)) - 1]
            unit = "resting speeds"
            found.append(Margin.at_most(f"speed of {what}", fastest, 1.0, unit))

        if self.by_s is not None and evidence.trace is not None:
            times = evidence.trace.times
            fulfilled = times[self.progress_over_time(evidence) >= DONE]
            first = float(fulfilled.min(initial=max(times[-1], self.by_s)))
            found.append(
                Margin.at_most(f"time to fulfil {what}", first, self.by_s, "s")
            )

        return found


class Limit(Goal):
    """What must not happen, whichever goal is reached.

    Its share is what it leaves of the reward.
    """

    def breaches(self, evidence: Evidence) -> Iterator[tuple[float, str]]:
        """Yield what one world did against it, for observations: when, s, and what."""
        return iter(())


class Aim(Protocol):
    """A task, or what has its goals.

    ``every``: whether all goals to reach count; else one is enough.
    """

    @property
    def goals(self) -> Sequence[Goal]: ...

    @property
    def every(self) -> bool: ...


def goals_reward(
    task: Aim, start: State, end: State, trace: Trace | None = None
) -> Array:
    """Compute the reward, 0..1, that a task's goals stand for, of one world or of many, (...).

    The progress of a goal rises from 0 at the start to 1 where it is fulfilled, linearly with the distance that is left
    over. With ``every`` the mean of what is to be reached counts, by weight, else the best of it. It is multiplied by
    the share of each limit: 0 where the robot touched what it must not, and less where a body to keep moved.

    Raises:
        ValueError: the goals need a trace, and there is none; or a goal comes after one that is not there.
    """
    evidence = Evidence(start, end, trace, task.goals)
    wanted = reaches(task.goals)
    shares = [goal.share(evidence) for goal in wanted]

    reward = np.zeros(end.positions.shape[:-2])

    if shares and task.every:
        reward = np.average(shares, axis=0, weights=[goal.weight for goal in wanted])
    elif shares:
        reward = np.max(shares, axis=0)

    for limit in limits(task.goals):
        reward = reward * limit.share(evidence)
    return np.clip(reward, 0.0, 1.0)


def goals_shares(
    task: Aim, start: State, end: State, trace: Trace | None
) -> tuple[tuple[str, float], ...]:
    """Say how far one world fulfilled each of several goals that all count, 0..1.

    None where one goal is enough, or where they don't fit the scene: goals are a hint.
    """
    if not task.every or len(reaches(task.goals)) < 2:
        return ()

    evidence = Evidence(start, end, trace, task.goals)

    try:
        return tuple(
            (goal.label(number), float(goal.share(evidence)))
            for number, goal in enumerate(task.goals)
            if isinstance(goal, Reach)
        )
    except (AttributeError, KeyError, ValueError):
        return ()


def goals_margins(
    task: Aim, start: State, end: State, trace: Trace | None = None
) -> list[Margin]:
    """Say how far one world stayed from the limits of a task's goals.

    Of goals one of which is enough, these are the margins of the best: of that whose least margin is the largest.
    """
    evidence = Evidence(start, end, trace, task.goals)
    groups = [goal.margins(evidence) for goal in reaches(task.goals)]

    if not task.every:
        known = filter(None, groups)
        best = max(known, key=lambda group: min(m.margin for m in group), default=[])
        groups = [best]

    return [*limits_margins(task, start, end, trace), *chain(*groups)]


def limits_margins(
    task: Aim, start: State, end: State, trace: Trace | None = None
) -> list[Margin]:
    """Say how far one world stayed from the limits alone.

    This is for tasks that measure themselves what is reached (`core.task.Task.margins`).
    """
    evidence = Evidence(start, end, trace, task.goals)
    return list(chain(*(limit.margins(evidence) for limit in limits(task.goals))))


def reaches(goals: Iterable[Goal]) -> list[Reach]:
    """Return the goals that want something reached."""
    return [goal for goal in goals if isinstance(goal, Reach)]


def number_of(which: str | int | None, goals: Iterable[Goal]) -> int | None:
    """Find the number of a goal that wants something reached; None: there is no such goal.

    Args:
        which: its name, or its number, whatever its name, as `Reach.after` has it; None: no goal.
        goals: of a task.
    """
    for number, goal in enumerate(goals):
        if isinstance(goal, Reach) and which in (number, goal.name):
            return number

    return None


def limits(goals: Iterable[Goal]) -> list[Limit]:
    """Return the goals that forbid something."""
    return [goal for goal in goals if isinstance(goal, Limit)]


def list_names(what: str, scene: Scene) -> list[str]:
    """List the names that a scene has of one of the things of `NAMED`."""
    if what == "joint":
        return [joint.name for joint in scene.joints]
    if what == FREE_BODY:
        return [body.name for body in scene.free]
    if what == SOLID_BODY:
        return [body.name for body in scene.bodies if _is_solid(body)]
    if what == BREAKABLE:
        return [*scene.breakable]

    return [body.name for body in scene.bodies]


def _is_solid(body: Body) -> bool:
    """Report whether something can touch a body: a mark can't be touched, unless a design's fixture takes its place."""
    return bool(body.collisions) or isinstance(body, Soft) or body.name == FIXTURE


def check_names(goal: Goal, scene: Scene) -> None:
    """Refuse a goal that names what a scene lacks, or that is about no body.

    Raises:
        UsageError: names what is possible.
    """
    looks_at_bodies = isinstance(goal, Reach) and type(goal).subjects is Reach.subjects
    if looks_at_bodies and not getattr(goal, "bodies", ()):
        raise UsageError("a goal to reach needs bodies")

    for field, name in _find_named(goal):
        what = NAMED[field]
        possible = list_names(what, scene)
        if name not in possible:
            raise choices(what, name, possible)


def needs_fixture(goal: Goal) -> bool:
    """Report whether a goal names the fixture that a design brings (`core.design.Fixture`)."""
    return any(name == FIXTURE for _, name in _find_named(goal))


def _find_named(goal: Goal) -> Iterator[tuple[str, str]]:
    """Yield what a goal and its parts name in a scene: by which field of `NAMED`, and the name."""
    for part in getattr(goal, "parts", [goal]):
        for field in NAMED:
            names = getattr(part, field, None) or ()
            if isinstance(names, str):
                names = (names,)

            for name in names:
                yield field, name


def angle_between(first: Array, second: Array) -> Array:
    """Compute the angle between unit vectors (..., 3), rad, (...)."""
    along = (first * second).sum(axis=-1)
    angle: Array = np.arccos(np.clip(along, -1.0, 1.0))
    return angle


def length(vectors: Array) -> Array:
    """Compute the lengths (...) of vectors (..., 3)."""
    lengths: Array = np.linalg.norm(vectors, axis=-1)
    return lengths
