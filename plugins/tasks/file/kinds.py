"""The kinds of goals that only scene files have; `plugins.tasks.file.goals` says by which key."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from core.design import Fixture
from core.geometry import Array, Vector
from core.goals import SLIP_DEG, SLIP_M, Evidence, Limit, Measure, Reach, Span
from core.scene import FIXTURE, Body
from core.values.joints import inverse, multiply, rotate, rotate_back
from core.values.margins import Margin
from core.values.states import State
from plugins.tasks.file.hollows import Hollow, find_fixture_hollow

SLIP_SHARE = 0.2  # of a limit of height or area: what is so far off counts as lost


@dataclass(frozen=True, kw_only=True)
class TurnedBy(Reach):
    """Bodies that must end turned from their start by an angle within a span, degrees, about whatever axis."""

    turned_deg: Span

    def measures(self, body: str, start: State) -> Iterator[Measure]:
        before = inverse(start.quaternion(body))

        def angle(state: State) -> Array:
            turn = multiply(state.quaternion(body), before)
            half = np.arccos(np.clip(np.abs(turn[..., 0]), 0.0, 1.0))
            return np.asarray(np.degrees(2 * half))

        name = f"turn of {body}"
        yield from Measure.within(self.turned_deg, name, angle, "deg", SLIP_DEG)


@dataclass(frozen=True, kw_only=True)
class Apart(Reach):
    """Bodies each of which must end so far from the nearest other of them; or two nodes of soft ones from each other.

    Attributes:
        apart: of the distance between their middles, m.
        nodes: the two nodes of each soft body, where its own length is meant; empty: the bodies' distance.

    Raises:
        ValueError: there is one body alone, or the nodes are not two.
    """

    apart: Span
    nodes: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.nodes and len(self.nodes) != 2:
            raise ValueError("a goal's nodes are two: the ends of what is measured")

    def measures(self, body: str, start: State) -> Iterator[Measure]:
        def distance(state: State) -> Array:
            if self.nodes:
                first, last = (state.position(body, node) for node in self.nodes)
                length: Array = np.linalg.norm(first - last, axis=-1)
                return length

            others = [
                np.linalg.norm(state.position(body) - state.position(other), axis=-1)
                for other in self.bodies
                if other != body
            ]
            nearest: Array = np.min(others, axis=0)
            return nearest

        name = f"nodes of {body} apart" if self.nodes else f"{body} apart"
        yield from Measure.within(self.apart, name, distance, "m", SLIP_M)


@dataclass(frozen=True, kw_only=True)
class Flattened(Reach):
    """Soft bodies that must end at most ``max_height_m`` high, from their lowest node to their highest."""

    max_height_m: float

    def measures(self, body: str, start: State) -> Sequence[Measure]:
        def height(state: State) -> Array:
            return state.extent(body)[..., 2]

        slip = SLIP_SHARE * self.max_height_m
        return [Measure(f"height of {body}", height, self.max_height_m, slip, "m")]


@dataclass(frozen=True, kw_only=True)
class Spread(Reach):
    """Soft bodies each of which must cover at least ``min_area_m2`` at the end, as seen from above."""

    min_area_m2: float

    def measures(self, body: str, start: State) -> Sequence[Measure]:
        def area(state: State) -> Array:
            return state.covered_area(body)

        least = self.min_area_m2
        name = f"area of {body}"
        return [Measure(name, area, least, SLIP_SHARE * least, "m^2", at_least=True)]


@dataclass(frozen=True, kw_only=True)
class Inside(Reach):
    """Bodies whose middles must end in the hollow of a body, or in the space of a mark; soft ones with all their nodes.

    On the way less than half is earned, by how long the way in still is: off the opening, above it, and through it. A
    body that lies at the foot of a bottle has to get up to its neck.

    Attributes:
        inside: the name of the body or mark.
        hollow: the space, in its frame; it moves with it. That of a design's fixture is found where there is one.
        around: what is fixed beside the fixture, and closes it.
        feet: by body, how far its frame is above its lowest point at the start, m.
        down: where gravity draws, (3,) in the world.
    """

    inside: str
    hollow: Hollow = field(default_factory=Hollow, repr=False, compare=False)
    around: Sequence[Body] = field(default=(), repr=False, compare=False)
    feet: Mapping[str, float] = field(default_factory=dict, repr=False, compare=False)
    down: Vector = field(default=(0.0, 0.0, -1.0), repr=False, compare=False)

    @property
    def at(self) -> str:
        """What the place is given by."""
        return self.inside

    def can_enter(self, fixture: Fixture) -> bool:
        """Report whether there is a space for bodies with a design's fixture in the scene."""
        if self.inside != FIXTURE:
            return True

        return find_fixture_hollow(fixture, tuple(self.around)) is not None

    def _find_hollow(self, start: State) -> Hollow:
        """Return the space in the layout that begins so; of a design's fixture without one it is empty."""
        if self.inside != FIXTURE or start.fixture is None:
            return self.hollow

        return find_fixture_hollow(start.fixture, tuple(self.around)) or self.hollow

    def measures(self, body: str, start: State) -> Iterator[Measure]:
        hollow = self._find_hollow(start)

        def room(state: State) -> Array:
            if body in state.soft:
                rooms = hollow.room(state.nodes(body, self.inside))
                return np.asarray(rooms.min(axis=-1))

            return hollow.room(state.relative(body, self.inside))

        name = f"{body} inside {self.inside}, from its wall"
        yield Measure(name, room, 0.0, SLIP_M, "m", at_least=True, whole=True)

    def place_of(self, body: str, start: State) -> Array:
        """Return where a body's frame is when it rests in the hollow, below its middle as gravity draws."""
        frame = start.quaternion(self.inside)
        local = rotate_back(frame, np.array(self.down))
        # Worlds of one layout have it alike.
        down = local.reshape(-1, 3)[0]
        hollow = self._find_hollow(start)
        place = hollow.rest(down, self.feet.get(body, 0.0))
        return start.position(self.inside) + rotate(frame, place)


@dataclass(frozen=True)
class Throughout(Limit):
    """What must hold all the time: what bodies are asked for at the end, from the start on.

    What it leaves of a reward is the least progress of ``what`` over time: 0 where it was lost.
    """

    what: Reach

    @property
    def parts(self) -> tuple[Reach, ...]:
        """What it asks for."""
        return self.what.parts

    @property
    def needs_trace(self) -> bool:
        """It does: states over time are in it."""
        return True

    def share(self, evidence: Evidence) -> Array:
        return np.asarray(self.what.progress_over_time(evidence).min(axis=-1))

    def margins(self, evidence: Evidence) -> list[Margin]:
        instant = int(self.what.progress_over_time(evidence).argmin())
        worst = evidence.film.states[instant]
        return self.what.margins(replace(evidence, end=worst))
