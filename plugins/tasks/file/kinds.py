"""The kinds of goals that only scene files have; `plugins.tasks.file.goals` says by which key."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from core.geometry import Array, Vector
from core.goals import (
    SLIP_M,
    SLIP_RAD,
    Coordinates,
    Evidence,
    JointAt,
    Limit,
    Measure,
    Placed,
    Reach,
    Turned,
)
from core.values.joints import inverse, multiply, rotate, rotate_back
from core.values.margins import Margin
from core.values.states import State
from plugins.tasks.file.hollows import Hollow
from plugins.tasks.file.spans import Span

SLIP_SHARE = 0.2  # of a limit of height or area: what is so far off counts as lost
SLIP_DEG = float(np.degrees(SLIP_RAD))


@dataclass(frozen=True, kw_only=True)
class Places(Reach):
    """Bodies that must end at ``places``, one for each; the rest is as for `Placed`.

    Raises:
        ValueError: there are not as many places as bodies.
    """

    places: tuple[Coordinates, ...]
    at: str | None = None
    tolerance: float = 0.0
    node: int | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.places) != len(self.bodies):
            raise ValueError(
                f"a goal's places need one for each of its {len(self.bodies)} bodies"
            )

    def measures(self, body: str, start: State) -> Sequence[Measure]:
        return self._placed(body).measures(body, start)

    def place_of(self, body: str, start: State) -> Array | None:
        return self._placed(body).place_of(body, start)

    def _placed(self, body: str) -> Placed:
        """Return the goal of one of the bodies."""
        place = self.places[self.bodies.index(body)]
        return Placed(place=place, at=self.at, tolerance=self.tolerance, node=self.node)


@dataclass(frozen=True, kw_only=True)
class Between(Reach):
    """Bodies that must end within a span of each coordinate that has one.

    Attributes:
        spans: of x, y and z; None: the coordinate is free.
        at: the body or mark in whose frame the coordinates are, as it stands in the layout; None: the world.
        relative: whether they count from where each body starts.
        node: of soft bodies, the node that counts; None: the centre of mass.
    """

    spans: tuple[Span | None, Span | None, Span | None]
    at: str | None = None
    relative: bool = False
    node: int | None = None

    def measures(self, body: str, start: State) -> Iterator[Measure]:
        for axis, span in enumerate(self.spans):
            if span is not None:

                def value(state: State, axis: int = axis) -> Array:
                    return self._seen(body, start, state)[..., axis]

                what = "way along " if self.relative else ""
                name = f"{what}{'xyz'[axis]} of {body}"
                yield from span.measures(name, value, "m", SLIP_M)

    def place_of(self, body: str, start: State) -> Array:
        seen = self._seen(body, start, start)
        wanted = np.full(seen.shape, np.nan)
        if self.at is not None:  # a frame that may be turned needs all three
            wanted = seen.copy()

        for axis, span in enumerate(self.spans):
            if span is not None:
                aim = np.vectorize(span.aim)
                wanted[..., axis] = aim(seen[..., axis], SLIP_M)

        if self.relative:
            wanted = wanted + self._turned_back(start.position(body, self.node), start)
        if self.at is None:
            return wanted

        return start.position(self.at) + rotate(start.quaternion(self.at), wanted)

    def _seen(self, body: str, start: State, state: State) -> Array:
        """Return the coordinates that count, (..., 3)."""
        position = state.position(body, self.node)
        if self.relative:
            position = position - start.position(body, self.node)
        elif self.at is not None:
            position = position - start.position(self.at)

        return self._turned_back(position, start)

    def _turned_back(self, vectors: Array, start: State) -> Array:
        if self.at is None:
            return vectors
        return rotate_back(start.quaternion(self.at), vectors)


@dataclass(frozen=True, kw_only=True)
class JointWithin(JointAt):
    """A joint that must end within a ``span``; ``to`` is what a program may aim for.

    Attributes:
        relative: whether the span counts from where the joint starts.
    """

    span: Span
    relative: bool = False

    def measures(self, body: str, start: State) -> Iterator[Measure]:
        def value(state: State) -> Array:
            position = state.joint(self.joint).position
            if self.relative:
                position = position - start.joint(self.joint).position

            return position

        unit = "rad"
        far = SLIP_RAD
        if self._slides(start):
            unit = "m"
            far = SLIP_M

        name = (
            f"change of {self.joint}" if self.relative else f"position of {self.joint}"
        )
        yield from self.span.measures(name, value, unit, far)


@dataclass(frozen=True, kw_only=True)
class Angled(Reach):
    """Bodies whose ``axis``, in their frames, must end at an angle to ``points`` within a span, in degrees.

    Attributes:
        axis: of each body's frame.
        points: in the world, or in the frame of the body or mark ``at``, as it stands in the layout.
        span: of the angle, degrees from 0 to 180.

    Raises:
        ValueError: one of the two has no length.
    """

    span: Span
    axis: Vector = (0.0, 0.0, 1.0)
    points: Vector = (0.0, 0.0, 1.0)
    at: str | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        self._pointing()

    def _pointing(self) -> Turned:
        """Return the goal of an axis that points the whole way."""
        return Turned(axis=self.axis, points=self.points, at=self.at)

    def measures(self, body: str, start: State) -> Iterator[Measure]:
        (pointing,) = self._pointing().measures(body, start)

        def angle(state: State) -> Array:
            return np.asarray(np.degrees(pointing.value(state)))

        yield from self.span.measures(f"angle of {body}", angle, "deg", SLIP_DEG)


@dataclass(frozen=True, kw_only=True)
class TurnedBy(Reach):
    """Bodies that must end turned from their start by an angle within a span, degrees, about whatever axis."""

    span: Span

    def measures(self, body: str, start: State) -> Iterator[Measure]:
        before = inverse(start.quaternion(body))

        def angle(state: State) -> Array:
            turn = multiply(state.quaternion(body), before)
            half = np.arccos(np.clip(np.abs(turn[..., 0]), 0.0, 1.0))
            return np.asarray(np.degrees(2 * half))

        yield from self.span.measures(f"turn of {body}", angle, "deg", SLIP_DEG)


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
        yield from self.apart.measures(name, distance, "m", SLIP_M)


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

    Nothing is earned on the way: a body that lies at the foot of a bottle is not in it by half.

    Attributes:
        inside: the name of the body or mark.
        hollow: the space, in its frame; it moves with it.
    """

    inside: str
    hollow: Hollow = field(default_factory=Hollow, repr=False, compare=False)

    @property
    def at(self) -> str:
        """What the place is given by."""
        return self.inside

    def measures(self, body: str, start: State) -> Iterator[Measure]:
        def room(state: State) -> Array:
            if body in state.soft:
                rooms = self.hollow.room(state.nodes(body, self.inside))
                return np.asarray(rooms.min(axis=-1))

            return self.hollow.room(state.relative(body, self.inside))

        name = f"{body} inside {self.inside}, from its wall"
        yield Measure(name, room, 0.0, SLIP_M, "m", at_least=True, whole=True)

    def place_of(self, body: str, start: State) -> Array:
        turned = rotate(start.quaternion(self.inside), self.hollow.middle)
        return start.position(self.inside) + turned


@dataclass(frozen=True)
class Throughout(Limit):
    """What must hold all the time: what bodies are asked for at the end, from the start on.

    What it leaves of a reward is the least progress of ``what`` over time: 0 where it was lost.
    """

    what: Reach

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
