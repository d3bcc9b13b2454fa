"""A goal: bodies at a place."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain
from typing import ClassVar

import numpy as np

from core.geometry import Array, step_lengths
from core.goals.evidence import length
from core.goals.goal import Given
from core.goals.keys import AT, NODE, TOLERANCE, Bounds, Key, Least, Place
from core.goals.measures import NEAR_M, SLIP_M, Measure
from core.goals.phrases import Coordinates
from core.goals.reaching import Reach
from core.goals.sites import ANY_BODY, Site
from core.goals.wants import Want
from core.scene import FIXTURE, Scene
from core.values.joints import rotate, rotate_back
from core.values.spans import Span
from core.values.states import State
from core.values.tools import Fixture

STEPS = 40  # places of a joint that are looked at
ROUNDING_M = 1e-6


@dataclass(frozen=True, kw_only=True)
class Placed(Reach):
    """Bodies that must end at a place; the distance to it counts.

    A plug that must end 1 cm above the frame of its socket, wherever that stands::

        Placed(("plug",), place=(0.0, 0.0, 0.01), at="socket", tolerance=0.003)

    Where a coordinate is a `Span`, or all count from the start, each counts on its own. A lamp to raise by 0.1 m::

        Placed(("lamp",), place=(None, None, Span(low=0.1)), relative=True)

    Attributes:
        place: (x, y, z) in metres; None leaves a coordinate free.
        places: instead of ``place``, one for each body.
        at: the body or mark whose frame in the layout the place refers to; None: the world. If it may be turned, give
            both x and y or neither.
        relative: whether the place counts from where each body starts, along the axes of that frame.
        tolerance: how far off still counts as there, m; a span has none.
        node: of soft bodies, the number of the node that counts; None: the centre of mass.

    Raises:
        ValueError: there is neither a place, nor one for each body.
    """

    place: Coordinates | None = None
    places: tuple[Coordinates, ...] = ()
    at: str | None = None
    relative: bool = False
    tolerance: float = 0.0
    node: int | None = None

    keys: ClassVar = {
        "place": Key(
            Bounds,
            'Coordinates x, y and z, m; null is free, and "> 0.3", "< 0.3" and [0.2, 0.4] are at least, at most and '
            "between",
            way=True,
        ),
        "places": Key(tuple[Place, ...], "A place for each of the bodies", way=True),
        "moved": Key(
            Bounds,
            "How far from the start they must end along x, y and z, m",
            head=True,
        ),
        "raised": Key(
            Least, "How much higher than at the start they must end, m", head=True
        ),
        "at": AT,
        "tolerance": TOLERANCE,
        "node": NODE,
    }
    asks = (
        "{% if goal.node is not none %}(node {{ goal.node }} of its nodes, from 0) {% endif %}"
        "must {% if goal.relative %}move from its start{% else %}get to{% endif %}"
        "{% if goal.places %}{% for place in goal.places %}{% if not loop.first %},{% endif %} {{ vector(place) }}"
        "{% endfor %} in the frame of {{ goal.at or 'the world' }}, one each, within {{ goal.tolerance | g }}"
        "{% elif goal.spans %}{% for axis, span in goal.spans.items() %}{% if not loop.first %},{% endif %} {{ axis }} "
        "{% if goal.relative %}by {% endif %}{{ span }} m{% endfor %}{{ frame(goal.at) }}"
        "{% else %} {{ vector(goal.place) }}{{ frame(goal.at) }}"
        "{% if goal.tolerance %} (within {{ goal.tolerance | g }}){% endif %}{% endif %}"
    )
    short = (
        "{% if goal.relative %}move {{ bodies }}{% else %}bring {{ bodies }} to its place"
        "{% if goal.at %} at {{ goal.at }}{% endif %}{% endif %}"
    )
    names: ClassVar = {"at": ANY_BODY}
    moves = True
    offset = True

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.place is None and len(self.places) != len(self.bodies):
            raise ValueError(
                f"a goal needs a place, or places: one for each of its {len(self.bodies)} bodies"
            )

        wanted = chain(*self.places)
        if self.places and (self.relative or any(isinstance(w, Span) for w in wanted)):
            raise ValueError(
                "a goal's places have numbers, and don't count from the start; make a goal for each body"
            )

    def _choose_place(self, body: str) -> Coordinates:
        """Return the place of a body."""
        return self.place or self.places[self.bodies.index(body)]

    @property
    def spans(self) -> dict[str, Span]:
        """The spans in which coordinates must end, by x, y and z; empty where the distance counts."""
        place = self.place or ()
        if not (self.relative or any(isinstance(wanted, Span) for wanted in place)):
            return {}

        return {
            axis: Span.about(wanted, self.tolerance)
            for axis, wanted in zip("xyz", place, strict=True)
            if wanted is not None
        }

    def measures(self, body: str, start: State) -> Iterator[Measure]:
        for axis, span in self.spans.items():

            def value(state: State, number: int = "xyz".index(axis)) -> Array:
                return self._see(body, start, state)[..., number]

            what = "way along " if self.relative else ""
            name = f"{what}{axis} of {body}"
            yield from Measure.within(span, name, value, "m", SLIP_M)

        if self.spans:
            return

        there = self.place_of(body, start)

        def distance(state: State) -> Array:
            off = state.position(body, self.node) - there
            return length(np.where(np.isnan(off), 0.0, off))

        name = f"{body} off its place"
        yield Measure(name, distance, self.tolerance, SLIP_M, "m", near=NEAR_M)

    def place_of(self, body: str, start: State) -> Array:
        if self.spans:
            return self._aim(body, start)

        place = self._choose_place(body)
        there = np.array([wanted or 0.0 for wanted in place])
        if self.at is not None:
            turned = rotate(start.quaternion(self.at), there)
            there = start.position(self.at) + turned

        free = [wanted is None for wanted in place]
        return np.where(free, np.nan, there)

    def _aim(self, body: str, start: State) -> Array:
        """Return a place well within all spans, (..., 3) in the world, nan where it is free."""
        seen = self._see(body, start, start)
        wanted = np.full(seen.shape, np.nan)
        if self.at is not None:  # a frame that may be turned needs all three
            wanted = seen.copy()

        for axis, span in self.spans.items():
            number = "xyz".index(axis)
            aim = np.vectorize(span.aim)
            wanted[..., number] = aim(seen[..., number], SLIP_M)

        if self.relative:
            wanted = wanted + self._turn_back(start.position(body, self.node), start)
        if self.at is None:
            return wanted

        return start.position(self.at) + rotate(start.quaternion(self.at), wanted)

    def _see(self, body: str, start: State, state: State) -> Array:
        """Return the coordinates that spans are about, (..., 3)."""
        position = state.position(body, self.node)
        if self.relative:
            position = position - start.position(body, self.node)
        elif self.at is not None:
            position = position - start.position(self.at)

        return self._turn_back(position, start)

    def _turn_back(self, vectors: Array, start: State) -> Array:
        """Turn vectors (..., 3) of the world into the frame of the place."""
        if self.at is None:
            return vectors
        return rotate_back(start.quaternion(self.at), vectors)

    @classmethod
    def translate(cls, key: str, given: Given) -> Given:
        if key not in ("moved", "raised"):
            return {}

        way = given[key] if key == "moved" else (None, None, given[key])
        return {"place": way, "places": (), "relative": True}

    def add_want(self, want: Want, scene: Scene) -> Want:
        want = super().add_want(want, scene)
        if any(isinstance(wanted, Span) for wanted in self.place or ()):
            return want

        return replace(want, tolerance=self.tolerance)

    def find_faults(self, site: Site) -> Iterator[str]:
        yield from super().find_faults(site)
        for place in self.places or (self.place or (),):
            if all(wanted is None for wanted in place):
                yield (
                    "a place or a way with null for all of x, y and z asks nothing; give one of them, such as [0.6, "
                    "null, null]"
                )

    def find_fixture_fault(self, fixture: Fixture) -> str:
        """A design does not choose a frame beside its fixture, in which its goal would be reached at once."""
        if self.at != FIXTURE:
            return ""

        low, high = fixture.bounds
        beside = np.maximum(low, -high).max()
        if beside <= ROUNDING_M:
            return ""

        return (
            f"a goal is measured from its pose, which is {1000 * beside:.0f} mm beside the box around its components; "
            "put the pose where they are, for example at the middle of their foot"
        )

    def find_warnings(self, where: str, scene: Scene) -> Iterator[str]:
        at = self.at
        if at is not None and at not in self.bodies:
            moves = not scene[at].fixed or scene[at].carrier is not None
            if moves:
                yield (
                    f"{where} is given at {at} where that begins, and stays there when it moves; a mark with a shape "
                    f"at {at} moves along, for inside: MARK"
                )

        for body in self.bodies:
            yield from self._warn_of_guide(where, body, scene)

    def _warn_of_guide(self, where: str, body: str, scene: Scene) -> Iterator[str]:
        """Yield a line where the joint that a body hangs from does not let it get to its place."""
        guides = [joint for joint in scene.ordered_joints if joint.joint.body == body]
        if not guides or not guides[0].joint.limited:
            return

        joint = guides[0].joint
        if joint.parent is not None and not scene[joint.parent].fixed:
            return

        start = scene.state()
        values = np.linspace(joint.lower, joint.upper, STEPS + 1)
        moved = [scene.with_starts({joint.name: value}).state() for value in values]
        states = State.stack(moved)

        step = float(step_lengths(states.position(body)).max())
        lefts = [measure.left(states) for measure in self.measures(body, start)]
        nearest = float(np.max(lefts, axis=0).min())
        if nearest > step:
            yield (
                f"{where}: joint {joint.name} brings {body} no nearer than {1000 * nearest:.0f} mm to where it is to "
                "be"
            )
