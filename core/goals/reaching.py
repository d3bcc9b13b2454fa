"""Define what is to be reached: the goals to which there is progress, and what follows from several of them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import KW_ONLY, dataclass, fields, replace
from functools import partial
from itertools import chain
from typing import Any, ClassVar, Self

import numpy as np

from core.errors import UsageError, refuse
from core.geometry import Array
from core.goals.evidence import Conduct, Evidence, length
from core.goals.goal import DONE, Goal
from core.goals.keys import AboveZero, Enough, Key, Names
from core.goals.measures import Measure
from core.goals.sites import FREE_BODY, SOLID_BODY, Site
from core.goals.wants import Place, Want
from core.scene import Scene, Soft
from core.values.margins import Margin, find_least, least_first
from core.values.states import State

STILL_M_S = 0.02  # what is slower is at rest
STILL_RAD_S = 0.2
DESCRIPTION = """\
{% set terms %}
{% if goal.enough is none %}
{% elif goal.enough is float and goal.enough == 1 %}; all of these bodies are needed
{%- elif goal.enough == 1 %}; one of these bodies is enough
{%- elif goal.enough is float %}; of these bodies {{ (100 * goal.enough) | g }} % are enough
{%- else %}; of these bodies {{ goal.enough | g }} are enough
{%- endif %}
{% if goal.rest %}; must end at rest{% endif %}
{% if goal.held %}; must end held by the robot, touching nothing fixed (half counts if it is only touched){% endif %}
{% if goal.released %}; must end released, touched by no part of the robot, nor by what touches it{% endif %}
{% if goal.stands_on %}; must end standing on {{ goal.stands_on }}{% endif %}
{% if goal.by_s %}; by {{ goal.by_s | g }} s after the motion begins{% endif %}
{% if goal.ever %}; at any time, not at the end{% endif %}
{% if goal.after is not none %}; after goal {{ goal.after }}{% endif %}
{% if goal.weight != 1 %}; weight {{ goal.weight | g }}{% endif %}
{% endset %}
{% if goal.name %}{{ goal.name }}: {% endif %}
{% if goal.bodies | length <= 4 %}{{ goal.subject }}
{%- elif goal.any %}any of {{ goal.bodies[0] }} to {{ goal.bodies[-1] }}
{%- else %}all {{ goal.bodies | length }} of {{ goal.bodies[0] }} to {{ goal.bodies[-1] }}
{%- endif %}
 {{ (asked ~ terms).removeprefix("; ") }}
"""
"""What a goal is about, what it asks of each, and of how many, how and when."""

MANY = 3  # bodies that are named in short; of more it is said how many


@dataclass(frozen=True)
class Reach(Goal):
    """Bodies that must end in some way: at rest or held, wherever they are; its kinds say more.

    Of a cube that only has to be held: ``Reach(("cube",), held=True)``. A kind says what it measures of each body
    (`measures`), and where it wants them (`place_of`).

    Attributes:
        bodies: their names; in a scene file also patterns, such as "grain*".
        any: whether one of the bodies is enough.
        enough: how many bodies are enough, a whole number such as 3, or a share such as 0.8 or 1.0; None: all of them.
        also: further goals that the same bodies must meet at once, without their names.
        rest: whether they must end at rest, and with a trace have rested for 0.3 s.
        held: whether the robot alone must bear them at the end.
        released: whether the robot must have let go of them at the end.
        stands_on: the body that must bear them at the end; None: any.
        by_s: the time by which the goal must be met, s from the start of the motion.
        ever: whether meeting the goal at any time is enough; otherwise it must be met at the end.
        after: the ``name`` or number (from 0) of a goal that must be met before this one.
        weight: how much the goal counts if all goals do.
        name: what other goals and reports call it.
        of_bodies: whether the kind is about ``bodies``; else other fields say what it is about.
        alone: whether no other kind may be joined to it.
        short: what is done to ``bodies``, beginning with a verb: a template of these and of ``goal``.
        from_start: whether it counts from where bodies start, so that a picture shows that.
        moves: whether its measures are how far a body itself has to get, m.
        offset: whether it asks how far off a place a body is, which reports say by itself.
        turns: whether it asks for a turn, which a soft body does not have.
    """

    bodies: Names = ()
    _: KW_ONLY
    any: bool = False
    enough: int | float | None = None
    also: tuple[Reach, ...] = ()
    rest: bool = False
    held: bool = False
    released: bool = False
    stands_on: str | None = None
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
        "stands_on": Key(
            str, "The body on which they must stand at the end, such as fixture"
        ),
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
            "Whether it must hold all the time, also before the robot moves; leave it out if it holds only later",
        ),
    }
    names: ClassVar = {"bodies": FREE_BODY, "stands_on": SOLID_BODY}
    of_bodies: ClassVar[bool] = True
    alone: ClassVar[bool] = False
    short: ClassVar[str] = (
        "{% if goal.held %}hold {{ bodies }}{% elif goal.stands_on %}put {{ bodies }} on {{ goal.stands_on }}"
        "{% elif goal.rest %}lay down {{ bodies }}{% else %}let go of {{ bodies }}{% endif %}"
    )
    from_start: ClassVar[bool] = False
    moves: ClassVar[bool] = False
    offset: ClassVar[bool] = False
    turns: ClassVar[bool] = False

    def __post_init__(self) -> None:
        ends = self._list_ends()
        asked = [part._list_ends() for part in self.also]
        misplaced = np.greater(asked or ends, ends).any()
        lengths = ("tolerance", "tolerance_deg", "away")  # that kinds have
        least = min(getattr(self, name, 0.0) for name in lengths)

        refuse(
            "a goal's ",
            {
                "enough must be above 0": self.enough is not None and self.enough <= 0,
                "enough must be a whole number of bodies, or a share of them up to 1.0": (
                    isinstance(self.enough, float) and self.enough > 1
                ),
                "any and enough both say how many; leave one of them out": (
                    self.any and self.enough is not None
                ),
                "weight must be above 0": not 0 < self.weight < np.inf,
                "by_s must be above 0": self.by_s is not None and not self.by_s > 0,
                "held and released say the opposite; leave one of them out": (
                    self.held and self.released
                ),
                "rest, held, released and stands_on stand in the goal itself, not in also": misplaced,
                "tolerances and ways must be 0 or more": least < 0,
                "kind must say what is to be reached, or rest, held, released or stands_on": (
                    type(self) is Reach and not any(ends) and not self.also
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

    def subjects(self, state: State) -> Names:
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
    def breaks(self) -> Names:
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
        if type(self) is not Reach and self.short == Reach.short:
            return f"fulfil {type(self).__name__} of {bodies}"

        from core.support.templates import fill_text  # imports Jinja

        return fill_text(self.short, goal=self, bodies=bodies)

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
        fulfilled that names a fixture, where the design has none, nor what the scene itself prevents.
        """
        lacks_fixture = self.needs_fixture and start.fixture is None
        if lacks_fixture or (start.hindered and self in start.hindered):
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

    # How many, how and when:

    @property
    def subject(self) -> str:
        """What it is about, in words."""
        return (" or " if self.any else ", ").join(self.bodies)

    def label(self, number: int) -> str:
        """Return its name, or what it is about and its number among the goals."""
        what = ", ".join(self.bodies[:3]) or self.subject
        return self.name or f"{what} (goal {number})"

    @property
    def needs_trace(self) -> bool:
        """Whether it asks for a time, or for what the robot touches."""
        in_time = self.by_s is not None or self.ever or self.after is not None
        return any(self._list_ends()) or in_time

    def _list_ends(self) -> list[bool]:
        """List whether each thing is asked for at the end, wherever bodies are."""
        return [self.rest, self.held, self.released, self.stands_on is not None]

    def average(self, shares: Sequence[Array]) -> Array:
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

    def needs_some(self, things: int, forbidden: int) -> bool:
        """Report whether it needs one of the forbidden things: the others are not enough."""
        return forbidden > 0 and self.count_enough(things) > things - forbidden

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
        from core.support.templates import fill_text  # imports Jinja

        asked = "; ".join(filter(None, (part.words() for part in self.parts)))
        return fill_text(DESCRIPTION, goal=self, asked=asked)

    def list_fields(self) -> dict[str, Any]:
        shared = {field.name for field in fields(Reach)}
        own = super().list_fields().items()
        return {name: value for name, value in own if name not in shared}

    def fit(self, site: Site) -> Self:
        also = tuple(part.resolve(site) for part in self.also)
        return replace(self, also=also)

    def check_names(self, scene: Scene) -> None:
        if self.of_bodies and not self.bodies:
            raise UsageError("a goal to reach needs bodies, a list of names")

        super().check_names(scene)

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

        if isinstance(self.enough, int) and self.enough > len(self.bodies) > 0:
            yield (
                f"enough: {self.enough} is a number of bodies, and these are {len(self.bodies)}; for a share of them "
                "write it with a point, such as 0.8, and for all of them leave it out"
            )

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
