"""Define what is to be reached: the goals to which there is progress, and what follows from several of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import KW_ONLY, dataclass, fields, replace
from functools import partial
from itertools import chain
from typing import Any, ClassVar, Self

import numpy as np

from core.errors import refuse
from core.geometry import Array
from core.goals.evidence import Conduct, Evidence, length
from core.goals.goal import DONE, Goal
from core.goals.measures import Measure
from core.goals.sites import Site
from core.goals.terms import Terms
from core.goals.wants import Place, Want
from core.scene import Scene, Soft
from core.values.margins import Margin, find_least, least_first
from core.values.states import State

STILL_M_S = 0.02  # what is slower is at rest
STILL_RAD_S = 0.2
MANY = 3  # bodies that are named in short; of more it is said how many


@dataclass(frozen=True)
class Reach(Terms):
    """Bodies that must end in some way: at rest or held, wherever they are; its kinds say more.

    Of a cube that only has to be held: ``Reach(("cube",), held=True)``. A kind says what it measures of each body
    (`measures`), and where it wants them (`place_of`). How many, how and when are its `Terms`.

    Attributes:
        alone: whether no other kind may be joined to it.
        short: what is done to ``bodies``, beginning with a verb: a format of these and of ``goal``.
        from_start: whether it counts from where bodies start, so that a picture shows that.
        moves: whether its measures are how far a body itself has to get, m.
        offset: whether it asks how far off a place a body is, which reports say by itself.
        turns: whether it asks for a turn, which a soft body does not have.
    """

    _: KW_ONLY
    also: tuple[Reach, ...] = ()

    alone: ClassVar[bool] = False
    short: ClassVar[str] = ""
    from_start: ClassVar[bool] = False
    moves: ClassVar[bool] = False
    offset: ClassVar[bool] = False
    turns: ClassVar[bool] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        lengths = ("tolerance", "tolerance_deg", "away")  # that kinds have
        least = min(getattr(self, name, 0.0) for name in lengths)
        asks = any(self._list_ends()) or self.also
        refuse(
            "a goal's ",
            {
                "tolerances and ways must be 0 or more": least < 0,
                "kind must say what is to be reached, or rest, held, released or stands_on": (
                    type(self) is Reach and not asks
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
        if self.stands_on:
            return f"put {bodies} on {self.stands_on}"
        return f"lay down {bodies}" if self.rest else f"let go of {bodies}"

    # What follows from it:

    @property
    def parts(self) -> tuple[Reach, ...]:
        return (self, *self.also)

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
        if self.needs_fixture and start.fixture is None:
            return np.zeros(now.positions.shape[:-2])

        shares = []

        for body in self.subjects(now):
            reached = self._approach(body, start, now)

            if self.rest:
                speed = self._find_unrest(body, now, conduct)
                reached = reached / np.maximum(speed, 1.0)
            if self.held and conduct is not None:
                reached = reached * conduct.hold(body)
            if self.released and conduct is not None:
                reached = reached * conduct.let_go(body)
            if self.stands_on and conduct is not None:
                reached = reached * conduct.stands(body, self.stands_on)

            shares.append(reached)

        return self.average(shares)

    def _find_unrest(self, body: str, now: State, conduct: Conduct | None) -> Array:
        """Measure how many times as fast as what is at rest a body is, or was lately, (...)."""
        figure = partial(self.unrest, body)
        return figure(now) if conduct is None else conduct.highest(figure, now)

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
        conduct = Conduct(evidence, -1)
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
        others = numbered(evidence.goals)
        called = [
            goal for number, goal in others.items() if which in (number, goal.name)
        ]
        if not called:
            names = [goal.name or number for number, goal in others.items()]
            raise ValueError(
                f"a goal comes after {which!r}, which is no goal; there are: {', '.join(map(str, names))}"
            )

        other = called[0]
        first = other.progress_over_time(evidence)
        unfulfilled = self.progress_over_time(evidence) < DONE

        # Not fulfilled at or after an instant: what comes later can't be before this goal.
        backward = np.logical_or.accumulate(np.flip(unfulfilled, axis=-1), axis=-1)
        open_until = np.flip(backward, axis=-1)
        before = np.where(open_until, first, 0.0).max(axis=-1)
        return np.where(before >= DONE, 1.0, before)

    def is_in_place(self, body: str, start: State, end: State) -> bool:
        """Report whether a body of one world ends as it should; where the goal has no tolerance, with an observer's."""
        if self.rest and self.unrest(body, end) * DONE > 1:
            return False
        return all(
            measure.left(end) <= (0.0 if measure.limit else measure.near)
            for measure in self.all_measures(body, start)
        )

    def margins(self, evidence: Evidence) -> list[Margin]:
        now = evidence.end
        instant = -1
        if self.ever and evidence.trace is not None:
            instant = self._find_best(evidence)
            now = evidence.film.states[instant]

        found = self.margins_at(evidence, now, instant)

        if self.by_s is not None and evidence.trace is not None:
            times = evidence.trace.times
            fulfilled = times[self.progress_over_time(evidence) >= DONE]
            first = float(fulfilled.min(initial=max(times[-1], self.by_s)))
            what = f"time to fulfil {self._say_subjects(now)}"
            found.append(Margin.at_most(what, first, self.by_s, "s"))

        return found

    def margins_at(self, evidence: Evidence, now: State, instant: int) -> list[Margin]:
        """Return those of a state of one world, at an instant of the trace.

        Of the bodies with the most room, as many as are enough, these are the least.
        """
        conduct = Conduct(evidence, instant)
        groups = [
            self._list_margins(body, evidence.start, now, conduct)
            for body in self.subjects(now)
        ]
        groups.sort(key=find_least, reverse=True)
        needed = groups[: self.count_enough(len(groups))]
        return [least_first(alike)[0] for alike in zip(*needed, strict=True)]

    def _list_margins(
        self, body: str, start: State, now: State, conduct: Conduct
    ) -> list[Margin]:
        """Return those of a body of one world."""
        measures = self.all_measures(body, start)
        found = [*filter(None, (measure.margin(now) for measure in measures))]

        if self.rest:
            speed = float(self._find_unrest(body, now, conduct))
            what = f"speed of {self._say_subjects(now)}"
            found.append(Margin.at_most(what, speed, 1.0, "resting speeds"))

        return [replace(margin, subject=body) for margin in found]

    def _find_best(self, evidence: Evidence) -> int:
        """Find the instant at which it was fulfilled the most, in time."""
        progress = self.progress_over_time(evidence)
        if self.by_s is not None:
            progress = progress[evidence.film.times <= self.by_s]

        return int(progress.argmax())

    def _say_subjects(self, state: State) -> str:
        return self.subject if len(self.subjects(state)) == 1 else "bodies"

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
        asked = [*(part.words() for part in self.parts), *self.say_terms()]
        described = f"{self.say_subject()} {'; '.join(filter(None, asked))}"
        return f"{self.name}: {described}" if self.name else described

    def list_fields(self) -> dict[str, Any]:
        shared = {field.name for field in fields(Reach)}
        own = super().list_fields().items()
        return {name: value for name, value in own if name not in shared}

    def fit(self, site: Site) -> Self:
        also = tuple(part.resolve(site) for part in self.also)
        return replace(self, also=also)

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

        if self.held:
            yield from self._find_hung(site.scene)

        yield from super().find_faults(site)

    def _find_hung(self, scene: Scene) -> Iterator[str]:
        """Yield a line for each body that a joint to something fixed bears, whatever the robot does."""
        for name in self.subjects(scene.state()):
            hinge = scene.find_hinge(name)
            if hinge:
                yield (
                    f"{name} hangs from something fixed by the joint {hinge}, and can never be held by the robot "
                    "alone; leave held out"
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


def reaches(goals: Iterable[Goal]) -> list[Reach]:
    """Return the goals that want something reached."""
    return [goal for goal in goals if isinstance(goal, Reach)]


def numbered(goals: Iterable[object]) -> dict[int, Reach]:
    """Return the goals that want something reached, by their numbers among all."""
    return {
        number: goal for number, goal in enumerate(goals) if isinstance(goal, Reach)
    }


def find_wants(goals: Sequence[Goal], scene: Scene) -> list[Want]:
    """Return what a task's goals to reach want of bodies in a layout, with the numbers of the goals."""
    found = list[Want]()
    for number, goal in numbered(goals).items():
        found += [replace(want, number=number) for want in goal.wants(scene)]

    return found
