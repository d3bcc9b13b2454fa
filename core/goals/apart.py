"""A goal: bodies far from, or near, each other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from core.geometry import Array
from core.goals.base import SLIP_M, Measure, Reach
from core.values.spans import Span
from core.values.states import State


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
