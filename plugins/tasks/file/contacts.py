"""Find which shapes of a scene's bodies touch, and measure how far they are apart."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from core.geometry import Array, Pose, Sphere
from core.goals import Reach
from core.robot.solids import (
    Solid,
    body_solids,
    closest,
    contact,
    shape_solid,
    signed_distance,
    solids_of,
)
from core.scene import Scene
from core.solids.standing import OVERLAP_M, pair_bodies

CONTACT_M = 0.0005  # the largest gap of what a rollout counts as contact
NEAR_M = 0.02  # what is farther apart does not meet while a scene is fitted
_NEAREST = 8  # shapes of two bodies that are looked at

Shapes = tuple[str, int, str, int]
"""Two shapes: the name of a body, the number of its shape, and those of the other one."""


class Meeting(NamedTuple):
    """Two shapes that are near each other.

    Attributes:
        pair: the two.
        gap_m: between them; below 0 they overlap.
        normal: (3,) the direction from the first to the second where they are closest.
    """

    pair: Shapes
    gap_m: float
    normal: Array


def find_buried(goal: Reach, scene: Scene) -> Iterator[str]:
    """Yield a line for each body that is to end inside of what is fixed, however it turns.

    A body of one shape is looked at by the largest ball around its middle; others may be around what is there.
    """
    for want in goal.wants(scene):
        if want.tolerance is None or None in (want.place or (None,)):
            continue

        place = np.array(want.place, dtype=float)
        for name in want.bodies:
            body = scene[name]
            if len(body.collisions) != 1:
                continue

            _, sides = body.collisions[0].shape.bounds
            ball = solids_of(name, Sphere(float(min(sides)) / 2), Pose(place))
            for other in scene.bodies:
                if not (other.fixed and other.collisions):
                    continue

                gap, _, _ = closest(ball, tuple(body_solids(other)))
                if -gap > want.tolerance + OVERLAP_M:
                    depth = f"{-1000 * gap:.0f} mm inside {other.name}"
                    yield f"{name} is to end {depth}; a place is that of its middle"


def find_meetings(scene: Scene, names: set[str]) -> Iterator[Meeting]:
    """Yield the nearest shapes of each two bodies that are near each other, of which one has such a name."""
    for name, other in pair_bodies(scene, names, NEAR_M):
        here = enumerate(body_solids(scene[name]))
        there = enumerate(body_solids(scene[other]))
        met = list[Meeting]()
        for (number, solid), (count, second) in itertools.product(here, there):
            gap, _, normal = contact(solid, second)
            if gap < NEAR_M:
                met.append(Meeting((name, number, other, count), gap, normal))

        yield from sorted(met, key=lambda meeting: meeting.gap_m)[:_NEAREST]


def measure_shapes(scene: Scene, pairs: Sequence[Shapes]) -> list[float]:
    """Measure the signed distance of each pair of shapes, m; no other shape is built."""

    def place(name: str, number: int) -> Solid:
        body = scene[name]
        return shape_solid(body, body.collisions[number])

    return [
        signed_distance(place(name, number), place(other, count))
        for name, number, other, count in pairs
    ]
