"""A goal: bodies at a place."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain

import numpy as np

from core.geometry import Array
from core.goals.base import NEAR_M, SLIP_M, Coordinates, Measure, Reach, length
from core.values.joints import rotate, rotate_back
from core.values.spans import Span
from core.values.states import State


@dataclass(frozen=True, kw_only=True)
class Placed(Reach):
    """Bodies that must end at a place: the distance to it counts.

    A plug that must end 1 cm above the frame of its socket, wherever that stands::

        Placed(("plug",), place=(0.0, 0.0, 0.01), at="socket", tolerance=0.003)

    Where a coordinate is a `Span`, or all count from the start, each counts on its own. A lamp to raise by 0.1 m::

        Placed(("lamp",), place=(None, None, Span(low=0.1)), relative=True)

    Attributes:
        place: where, (x, y, z) in metres; None: a coordinate is free.
        places: instead of a place, one for each of the bodies.
        at: the body or mark in whose frame, as it stands in the layout, the place is; None: in the world. If it may be
            turned, give both x and y or neither.
        relative: whether the place counts from where each body starts, along the axes of that frame.
        tolerance: how far off still counts as there, m; of a span nothing is added.
        node: of soft bodies, the number of the node whose place counts; None: the centre of mass.

    Raises:
        ValueError: there is neither a place, nor one for each body.
    """

    place: Coordinates | None = None
    places: tuple[Coordinates, ...] = ()
    at: str | None = None
    relative: bool = False
    tolerance: float = 0.0
    node: int | None = None

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
