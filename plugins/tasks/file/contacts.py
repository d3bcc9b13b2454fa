"""Find which shapes of a scene's bodies touch, and measure how far they are apart."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from core.geometry import Array, Pose, Sphere
from core.goals import Reach
from core.robot.solids import (
    Obstacles,
    Solid,
    body_solids,
    closest,
    contact,
    shape_solid,
    signed_distance,
    solids_of,
)
from core.scene import Scene
from plugins.tasks.file.doubts import bound

TOUCHES_M = 0.003
OVERLAP_M = 0.001  # what is more is a mistake
MOST_OVERLAPS = 5  # pairs that are named
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


def find_gaps(scene: Scene, names: set[str]) -> dict[tuple[str, str], float]:
    """Find the pairs of bodies that touch, of which one has such a name, and the gaps between them, m."""
    found = dict[tuple[str, str], float]()
    for name, other in _pair_bodies(scene, names):
        gap = measure_gap(scene, name, other)
        if gap < TOUCHES_M:
            found[name, other] = gap

    return found


def find_overlaps(scene: Scene) -> Iterator[str]:
    """Yield a line for each pair of bodies that overlap, of which one can move and no joint connects them.

    Of many pairs, such as those of repeated bodies, the deepest are named, and the others counted.
    """
    gaps = find_gaps(scene, {body.name for body in scene.free})
    deep = [
        (gap, pair)
        for pair, gap in gaps.items()
        if gap < -OVERLAP_M and frozenset(pair) not in scene.joined
    ]
    for gap, pair in sorted(deep)[:MOST_OVERLAPS]:
        mend = "move one, make one smaller, or leave a gap of 0.1 mm"
        yield f"{' and '.join(pair)} overlap by {-1000 * gap:.0f} mm; {mend}"

    left = len(deep) - MOST_OVERLAPS
    if left > 0:
        yield f"{left} more pairs of bodies overlap"


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


def measure_gap(scene: Scene, name: str, other: str) -> float:
    """Measure the signed distance of two bodies, m."""
    return closest(tuple(body_solids(scene[name])), tuple(body_solids(scene[other])))[0]


def find_meetings(scene: Scene, names: set[str]) -> Iterator[Meeting]:
    """Yield the nearest shapes of each two bodies that are near each other, of which one has such a name."""
    for name, other in _pair_bodies(scene, names, NEAR_M):
        here = Obstacles(body_solids(scene[name]))
        there = Obstacles(body_solids(scene[other]))
        met = list[Meeting]()
        for number, count in _pair_boxes(here, there):
            gap, _, normal = contact(here.solids[number], there.solids[count])
            if gap < NEAR_M:
                met.append(Meeting((name, number, other, count), gap, normal))

        yield from sorted(met, key=lambda meeting: meeting.gap_m)[:_NEAREST]


def measure_shapes(scene: Scene, pairs: Sequence[Shapes]) -> list[float]:
    """Measure the signed distance of each pair of shapes, m; no other shape is built."""
    solids = dict[tuple[str, int], Solid]()
    for name, number, other, count in pairs:
        for key in ((name, number), (other, count)):
            if key not in solids:
                body = scene[key[0]]
                solids[key] = shape_solid(body, body.collisions[key[1]])

    return [
        signed_distance(solids[name, number], solids[other, count])
        for name, number, other, count in pairs
    ]


def _pair_boxes(here: Obstacles, there: Obstacles) -> Iterator[tuple[int, int]]:
    """Yield the numbers of each two shapes of two bodies whose bounding boxes are near each other."""
    apart = np.abs(here.centers[:, None] - there.centers)
    are_near = apart < here.halves[:, None] + there.halves + NEAR_M
    for number, count in np.argwhere(are_near.all(axis=2)):
        yield int(number), int(count)


def _pair_bodies(
    scene: Scene, names: set[str], margin: float = TOUCHES_M
) -> Iterator[tuple[str, str]]:
    """Yield pairs of bodies whose bounding boxes are nearer than a margin, m, of which one has such a name."""
    boxes = {body.name: bound(body) for body in scene.bodies if body.collisions}
    for name, other in itertools.combinations(boxes, 2):
        low, high = boxes[name]
        bottom, top = boxes[other]
        are_near = (low < top + margin).all() and (bottom < high + margin).all()
        if are_near and names & {name, other}:
            yield name, other
