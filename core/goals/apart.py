"""A goal: bodies far from, or near, each other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from core.geometry import Array
from core.goals.keys import Key, Least
from core.goals.measures import SLIP_M, Measure
from core.goals.reaching import Reach
from core.goals.sites import Site
from core.values.spans import Span
from core.values.states import State

FAR_M = 0.3  # plans aim by a tenth of it within a span of distances


@dataclass(frozen=True, kw_only=True)
class Apart(Reach):
    """Bodies that must each end at a distance from the nearest other one; or two nodes of soft bodies.

    Attributes:
        apart: a `Span` of the distance between their middles, m.
        nodes: two nodes of each soft body, whose distance counts instead; empty: the distance between bodies.

    Raises:
        ValueError: there is one body alone, or the nodes are not two.
    """

    apart: Span
    nodes: tuple[int, ...] = ()

    keys: ClassVar = {
        "apart": Key(Least, "How far from each other they must end, m", head=True),
        "nodes": Key(
            tuple[int, ...], "Two nodes of a soft body, whose distance is meant"
        ),
    }
    asks = (
        "{% if goal.nodes %}its nodes {{ goal.nodes[0] }} and {{ goal.nodes[1] }} must end {{ goal.apart }} m from "
        "each other{% else %}each must end {{ goal.apart }} m from the nearest other of these{% endif %}"
    )
    short = "bring {{ bodies }} to be {{ goal.apart }} m apart"

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

    @property
    def soft_nodes(self) -> tuple[int, ...]:
        return self.nodes

    def aim_of(self, body: str, start: State) -> Array | None:
        """Return where a body gets if all go from the first one, or toward it, by the same factor; that one stays."""
        if self.nodes:
            return None

        places = np.array([start.position(name) for name in self.bodies])
        gaps = np.linalg.norm(places[:, None] - places, axis=-1)
        np.fill_diagonal(gaps, np.inf)
        nearest = float(gaps.min())

        factor = self.apart.aim(nearest, FAR_M) / max(nearest, 1e-6)
        place = places[0] + factor * (start.position(body) - places[0])
        return np.array([place[0], place[1], np.nan])

    def find_faults(self, site: Site) -> Iterator[str]:
        if len(self.bodies) < 2 and not self.nodes:
            yield "apart needs two bodies, or nodes: [0, 9] of a soft one"

        yield from super().find_faults(site)
