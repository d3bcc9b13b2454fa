"""Define what all kinds of goals share, and what follows from many goals."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, MISSING, dataclass, fields, replace
from itertools import chain
from typing import Any, ClassVar, Self

import numpy as np

from core.errors import UsageError, choices, refuse
from core.geometry import Array, Vector
from core.goals.keys import AboveZero, Enough, Key, Names
from core.goals.sites import FREE_BODY, Site, find_names, list_names
from core.goals.wants import Ban, Place, Want
from core.scene import FIXTURE, Scene, Soft
from core.values.joints import rotate
from core.values.margins import Margin
from core.values.spans import Span
from core.values.states import State
from core.values.tools import Fixture
from core.values.traces import TRACE_HZ, Trace

Given = Mapping[str, Any]
"""What an entry of a scene file's goals says."""

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
TOLERANCE = 0.01  # how far off a bare number of a scene file still is there, m or rad, where it has none
MANY = 3  # bodies that are named in short; of more it is said how many
NAMED = 4  # bodies that a description names, where there are more


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

    A kind of goal is a class that says all of itself: how far it is fulfilled, its words, what it names in a scene, the
    keys that a scene file has it by, what is wrong with it or seldom meant, and what it wants of who plans.

    Attributes:
        keys: those of a scene file by which an entry wants a goal of this kind, or says more of it. A kind has those of
            the kind that it is made from, too; so it has `names`.
        names: the fields that name things of a scene, and which sort of things: `FREE_BODY`, `SOLID_BODY`, ...
        asks: what it asks, for a prompt: a format of ``goal``; of one to reach what follows its bodies. A kind whose
            words depend on more has a method `words`.
    """

    keys: ClassVar[Mapping[str, Key]] = {}
    names: ClassVar[Mapping[str, str]] = {}
    asks: ClassVar[str] = ""

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        for said in ("keys", "names"):
            merged = dict[str, Any]()
            for kind in reversed(cls.__mro__):
                merged |= vars(kind).get(said, {})

            setattr(cls, said, merged)

    # What it measures:

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

    @property
    def parts(self) -> tuple[Goal, ...]:
        """The goal itself, and what it also wants."""
        return (self,)

    # Its words:

    def words(self) -> str:
        """Say what it asks, see ``asks``; by default its kind and its fields."""
        if self.asks:
            return self.asks.format(goal=self)

        shared = {field.name for field in fields(Reach)}
        said = [
            f"{name}={value!r}"
            for name, value in vars(self).items()
            if name not in shared
        ]
        return f"{type(self).__name__}({', '.join(said)})"

    def describe(self) -> str:
        """Describe it for a prompt."""
        return self.words()

    # How a scene file says it:

    @classmethod
    def prepare(cls, given: Given) -> Given:
        """Rewrite what an entry of a scene file says, before its keys are looked at.

        Raises:
            ValueError: it has no sense.
        """
        return given

    @classmethod
    def translate(cls, key: str, given: Given) -> Given:
        """Return the fields that an entry does not have by their names.

        Args:
            key: for which it wants a goal of this kind.
            given: the whole entry.
        Raises:
            ValueError: it has no sense.
        """
        return {}

    @classmethod
    def read(cls, key: str, given: Given) -> Self:
        """Make the goal that a key of a scene file's entry stands for; for arguments see `translate`.

        Raises:
            ValueError: something is missing, or has no sense.
        """
        values = {"tolerance": TOLERANCE, **given, **cls.translate(key, given)}
        taken = [field for field in fields(cls) if field.init]  # type: ignore[arg-type]
        for field in taken:
            needed = field.default is MISSING and field.default_factory is MISSING
            if needed and field.name not in values:
                raise ValueError(f"a goal with {key!r} needs {field.name!r}, too")

        return cls(**{f.name: values[f.name] for f in taken if f.name in values})

    # In a scene:

    def list_named(self) -> Iterator[tuple[str, str]]:
        """Yield what the goal and its parts name in a scene: which sort of thing, and its name."""
        for part in self.parts:
            for field, what in part.names.items():
                named = getattr(part, field) or ()
                if isinstance(named, str):
                    named = (named,)

                for name in named:
                    yield what, name

    def resolve(self, site: Site) -> Self:
        """Return the goal with the names that its patterns fit, and what it needs to know of a scene.

        Raises:
            UsageError: it names what is not there, can never be met, or asks nothing.
        """
        found = self.fit(site)
        for fault in found.find_faults(site):
            raise UsageError(fault)

        return found

    def fit(self, site: Site) -> Self:
        """Return it with the names that its patterns fit; kinds add what they need to know.

        Raises:
            UsageError: it names what is not there.
        """
        found = {}
        for field, what in self.names.items():
            patterns = getattr(self, field)
            if isinstance(patterns, tuple):
                found[field] = find_names(patterns, list_names(what, site.scene))

        fitted: Self = replace(self, **found)  # type: ignore[type-var]
        check_names(fitted, site.scene)
        return fitted

    def find_faults(self, site: Site) -> Iterator[str]:
        """Yield why it can never be met in a scene, or asks nothing."""
        yield from ()

    def find_fixture_fault(self, fixture: Fixture) -> str:
        """Say why it can't be met with what a design adds to the scene; empty: it can."""
        return ""

    def find_doubts(self, where: str, scene: Scene) -> Iterator[str]:
        """Yield a line for what is possible, and seldom meant; ``where`` names the goal."""
        yield from ()


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
        of_bodies: whether the kind is about ``bodies``; else other fields say what it is about.
        alone: whether no other kind may be joined to it.
        short: what is done to ``bodies``, beginning with a verb: a format of these and of ``goal``.
        from_start: whether it counts from where bodies start, so that a picture shows that.
        moves: whether its measures are how far a body itself has to get, m.
        offset: whether it asks how far off a place a body is, which reports say by itself.
        turns: whether it asks for a turn, which a soft body does not have.
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

    keys: ClassVar = {
        "bodies": Key(Names, 'Their names, or patterns such as "grain*"'),
        "any": Key(bool, "Whether one of the bodies is enough"),
        "enough": Key(
            Enough,
            "How many of the bodies are enough, a whole number such as 3, or which share of them, with a point such as "
            "0.8 or 1.0",
        ),
        "also": Key(
            Any,
            "What else must hold of the same bodies at once, as further keys say it, too",
        ),
        "rest": Key(bool, "Whether they must end at rest"),
        "held": Key(
            bool,
            "Whether they must end in the robot's hand, touching nothing fixed",
        ),
        "released": Key(bool, "Whether they must end touched by no part of the robot"),
        "by_s": Key(
            AboveZero,
            "Until when it must be reached, s from the beginning of the motion",
        ),
        "ever": Key(bool, "Whether it is enough to reach it at any time"),
        "after": Key(
            str | int,
            "The goal that must be reached before this one is, by number from 0 or by name",
        ),
        "weight": Key(AboveZero, "How much it counts beside others"),
        "name": Key(str, "By which other goals and reports call it"),
        "throughout": Key(
            bool,
            "Whether it must hold all the time, from before the robot moves; of what holds only later leave it out",
        ),
    }
    names: ClassVar = {"bodies": FREE_BODY}
    of_bodies: ClassVar[bool] = True
    alone: ClassVar[bool] = False
    short: ClassVar[str] = ""
    from_start: ClassVar[bool] = False
    moves: ClassVar[bool] = False
    offset: ClassVar[bool] = False
    turns: ClassVar[bool] = False

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

    @property
    def reference(self) -> str | None:
        """The body or mark by which it says a place or a direction; None: the world."""
        return getattr(self, "at", None)

    @property
    def soft_nodes(self) -> tuple[int, ...]:
        """The nodes that bodies must have for it, which are soft then; empty: they may be rigid."""
        node: int | None = getattr(self, "node", None)
        return () if node is None else (node,)

    @property
    def breaks(self) -> tuple[str, ...]:
        """What it wants to break."""
        return ()

    def tolerance_m(self, scene: Scene) -> float:
        """Return how far off its bodies may be, m; 0: it does not say, or allows nothing."""
        return float(getattr(self, "tolerance", 0.0))

    def aim_of(self, body: str, start: State) -> Array | None:
        """Return where a program may bring a body to fulfil it, as `place_of` does."""
        return self.place_of(body, start)

    def add_want(self, want: Want, scene: Scene) -> Want:
        """Return what is wanted of bodies with what this kind asks, but the place, which is there.

        By default a kind that says no place says nothing: its name is among ``unsaid``.
        """
        if type(self) is Reach:
            return want

        want = replace(want, reference=self.reference or want.reference)
        if self.aim_of(want.bodies[0], scene.state()) is None:
            return replace(want, unsaid=(*want.unsaid, type(self).__name__))

        return want

    def do(self, bodies: str) -> str:
        """Say in short what is done to bodies, see ``short``; by default its kind."""
        if self.short:
            return self.short.format(goal=self, bodies=bodies)
        if type(self) is not Reach:
            return f"fulfil {type(self).__name__} of {bodies}"
        if self.held:
            return f"hold {bodies}"
        return f"lay down {bodies}" if self.rest else f"let go of {bodies}"

    def label(self, number: int) -> str:
        """Return its name, or what it is about and its number among the goals."""
        what = ", ".join(self.bodies[:3]) or self.subject
        return self.name or f"{what} (goal {number})"

    # What follows from it:

    @property
    def parts(self) -> tuple[Reach, ...]:
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
            others = numbered(evidence.goals)
            names = [goal.name or count for count, goal in others.items()]
            raise ValueError(
                f"a goal comes after {which!r}, which is no goal; there are: {', '.join(map(str, names))}"
            )

        other = numbered(evidence.goals)[number]
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

    # In words, in a scene, and for who plans:

    def in_short(self) -> str:
        """Say in short what it wants, beginning with a verb."""
        bodies = ", ".join(self.bodies)
        if len(self.bodies) > MANY:
            bodies = f"{len(self.bodies)} bodies"

        says = [part for part in self.parts if type(part) is not Reach]
        return (says or [self])[0].do(bodies)

    def words(self) -> str:
        return super().words() if type(self) is not Reach else ""

    def describe(self) -> str:
        when = {
            self._say_enough(): self.enough is not None,
            "must end at rest": self.rest,
            "must end held by the robot, touching nothing fixed (half counts if it is only touched)": self.held,
            "must end released, touched by no part of the robot, nor by what touches it": self.released,
            f"by {self.by_s or 0:g} s after the motion begins": self.by_s is not None,
            "at any time, not at the end": self.ever,
            f"after goal {self.after}": self.after is not None,
            f"weight {self.weight:g}": self.weight != 1,
        }
        asked = [part.words() for part in self.parts]
        asked += [words for words, applies in when.items() if applies]
        described = f"{self._say_subject()} {'; '.join(filter(None, asked))}"
        return f"{self.name}: {described}" if self.name else described

    def _say_enough(self) -> str:
        """Say how many of the bodies are enough."""
        is_share = isinstance(self.enough, float)
        if self.enough == 1 and is_share:
            return "all of these bodies are needed"
        if self.enough == 1:
            return "one of these bodies is enough"

        enough = self.enough or 0
        share = f"{100 * enough:g} %" if is_share else f"{enough:g}"
        return f"of these bodies {share} are enough"

    def _say_subject(self) -> str:
        """Say what it is about; of many bodies the first, the last and how many."""
        if len(self.bodies) <= NAMED:
            return self.subject

        first, *_, last = self.bodies
        wanted = "any" if self.any else f"all {len(self.bodies)}"
        return f"{wanted} of {first} to {last}"

    def fit(self, site: Site) -> Self:
        also = tuple(part.resolve(site) for part in self.also)
        return Goal.fit(replace(self, also=also), site)

    def find_faults(self, site: Site) -> Iterator[str]:
        for name in self.bodies:
            body = site.scene[name]
            nodes = len(body.form.nodes) if isinstance(body, Soft) else 0
            wanted = self.soft_nodes
            if wanted and not 0 <= max(wanted) < nodes:
                what = "node and nodes (from 0), max_height_m and min_area_m2 are for soft bodies"
                yield f"{what}; {name!r} has {nodes} nodes"
            if self.turns and nodes:
                yield f"the soft body {name!r} has no axis; its nodes move"

        if isinstance(self.enough, int) and self.enough > len(self.bodies) > 0:
            yield (
                f"enough: {self.enough} is a number of bodies, and these are {len(self.bodies)}; for a share of them "
                "write it with a point, such as 0.8, and for all of them leave it out"
            )

    def wants(self, scene: Scene) -> list[Want]:
        """Return what is wanted of the bodies in a layout: one want for all that it wants at one place."""
        start = scene.state()
        groups = dict[Place | None, list[str]]()
        for body in self.subjects(start):
            groups.setdefault(self._find_aim(body, start), []).append(body)

        found = []
        for place, bodies in groups.items():
            want = Want(
                tuple(bodies),
                any=self.any,
                held=self.held,
                released=self.released,
                rest=self.rest,
                ever=self.ever,
                by_s=self.by_s,
                place=place,
            )
            for part in self.parts:
                want = part.add_want(want, scene)

            found.append(want)

        return found

    def _find_aim(self, body: str, start: State) -> Place | None:
        """Return where it, or what it also asks, wants a body; None: nowhere."""
        for part in self.parts:
            aim = part.aim_of(body, start)
            if aim is not None:
                x, y, z = (None if np.isnan(at) else float(at) for at in aim)
                return x, y, z

        return None


class Limit(Goal):
    """What must not happen, whichever goal is reached.

    Its share is what it leaves of the reward.
    """

    def breaches(self, evidence: Evidence) -> Iterator[tuple[float, str]]:
        """Yield what one world did against it, for observations: when, s, and what."""
        return iter(())

    def find_conflict(self, wanted: Reach, scene: Scene) -> str:
        """Say why it does not let a goal be reached; empty: it does."""
        return ""

    def bans(self, scene: Scene) -> Ban:
        """Return what it forbids in a layout; by default no more than its kind's name."""
        return Ban(unsaid=type(self).__name__)


def reaches(goals: Iterable[Goal]) -> list[Reach]:
    """Return the goals that want something reached."""
    return [goal for goal in goals if isinstance(goal, Reach)]


def numbered(goals: Iterable[Goal]) -> dict[int, Reach]:
    """Return the goals that want something reached, by their numbers among all."""
    return {
        number: goal for number, goal in enumerate(goals) if isinstance(goal, Reach)
    }


def number_of(which: str | int | None, goals: Iterable[Goal]) -> int | None:
    """Find the number of a goal that wants something reached; None: there is no such goal.

    Args:
        which: its name, or its number, whatever its name, as `Reach.after` has it; None: no goal.
        goals: of a task.
    """
    for number, goal in numbered(goals).items():
        if which in (number, goal.name):
            return number

    return None


def limits(goals: Iterable[Goal]) -> list[Limit]:
    """Return the goals that forbid something."""
    return [goal for goal in goals if isinstance(goal, Limit)]


def find_wants(goals: Sequence[Goal], scene: Scene) -> list[Want]:
    """Return what a task's goals to reach want of bodies in a layout, with the numbers of the goals."""
    found = list[Want]()
    for number, goal in numbered(goals).items():
        after = number_of(goal.after, goals)
        wants = goal.wants(scene)
        found += [replace(want, number=number, after=after) for want in wants]

    return found


def find_bans(goals: Iterable[Goal], scene: Scene) -> list[Ban]:
    """Return what a task's limits forbid in a layout."""
    return [limit.bans(scene) for limit in limits(goals)]


def check_names(goal: Goal, scene: Scene) -> None:
    """Refuse a goal that names what a scene lacks, or that is about no body.

    Raises:
        UsageError: names what is possible.
    """
    if isinstance(goal, Reach) and goal.of_bodies and not goal.bodies:
        raise UsageError("a goal to reach needs bodies")

    for what, name in goal.list_named():
        possible = list_names(what, scene)
        if name not in possible:
            raise choices(what, name, possible)


def needs_fixture(goal: Goal) -> bool:
    """Report whether a goal names the fixture that a design brings (`core.design.Fixture`)."""
    return any(name == FIXTURE for _, name in goal.list_named())


def needs_some(goal: Reach, things: int, forbidden: int) -> bool:
    """Report whether a goal needs one of the forbidden things: the others are not enough."""
    return forbidden > 0 and goal.count_enough(things) > things - forbidden


def measure_angle(
    body: str, axis: Vector, towards: Callable[[State], Array]
) -> Callable[[State], Array]:
    """Make what measures the angle between an axis of a body's frame and unit vectors (..., 3), rad, (...)."""
    own = np.divide(axis, np.linalg.norm(axis))

    def angle(state: State) -> Array:
        now = rotate(state.quaternion(body), own)
        along = (now * towards(state)).sum(axis=-1)
        return np.asarray(np.arccos(np.clip(along, -1.0, 1.0)))

    return angle


def vector(numbers: Iterable[Coordinate], digits: int = 6) -> str:
    """Write a place or a direction; a coordinate that is None is free."""
    said = []
    for axis, number in zip("xyz", numbers, strict=True):
        if number is None:
            said.append(f"any {axis}")
        elif isinstance(number, Span):
            said.append(str(number))
        else:
            said.append(f"{round(number, digits):g}")

    return f"({', '.join(said)})"


def frame(at: str | None) -> str:
    """Say in whose frame a place or a direction is."""
    return "" if at is None else f" in the frame of {at}"


def length(vectors: Array) -> Array:
    """Compute the lengths (...) of vectors (..., 3)."""
    lengths: Array = np.linalg.norm(vectors, axis=-1)
    return lengths
