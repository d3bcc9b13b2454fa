"""Find which shapes of a scene's bodies touch, and measure how far they are apart."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from core.robot.solids import body_solids, closest, signed_distance
from core.scene import Scene
from plugins.tasks.file.doubts import bound

TOUCHES_M = 0.003
OVERLAP_M = 0.001  # what is more is a mistake
CONTACT_M = 0.0005  # the largest gap of what a rollout counts as contact

Shapes = tuple[str, int, str, int]
"""Two shapes: the name of a body, the number of its shape, and those of the other one."""


def find_gaps(scene: Scene, names: set[str]) -> dict[tuple[str, str], float]:
    """Find the pairs of bodies that touch, of which one has such a name, and the gaps between them, m."""
    found = dict[tuple[str, str], float]()
    for name, other in _pair_bodies(scene, names):
        gap = measure_gap(scene, name, other)
        if gap < TOUCHES_M:
            found[name, other] = gap

    return found


def find_overlaps(scene: Scene) -> Iterator[str]:
    """Yield a line for each pair of bodies that overlap, of which one can move and no joint connects them."""
    for pair, gap in find_gaps(scene, {body.name for body in scene.free}).items():
        if gap < -OVERLAP_M and frozenset(pair) not in scene.joined:
            mend = "move one, make one smaller, or leave a gap of 0.1 mm"
            yield f"{' and '.join(pair)} overlap by {-1000 * gap:.0f} mm; {mend}"


def measure_gap(scene: Scene, name: str, other: str) -> float:
    """Measure the signed distance of two bodies, m."""
    return closest(tuple(body_solids(scene[name])), tuple(body_solids(scene[other])))[0]


def pair_shapes(scene: Scene, names: set[str]) -> Iterator[Shapes]:
    """Yield each pair of shapes of two bodies that touch, of which one has such a name."""
    for name, other in find_gaps(scene, names):
        here = range(len(scene[name].collisions))
        there = range(len(scene[other].collisions))
        for number, count in itertools.product(here, there):
            yield name, number, other, count


def measure_shapes(scene: Scene, pairs: list[Shapes]) -> list[float]:
    """Measure the signed distance of each pair of shapes, m."""
    names = {name for pair in pairs for name in (pair[0], pair[2])}
    solids = {name: tuple(body_solids(scene[name])) for name in names}
    return [
        signed_distance(solids[name][number], solids[other][count])
        for name, number, other, count in pairs
    ]


def _pair_bodies(scene: Scene, names: set[str]) -> Iterator[tuple[str, str]]:
    boxes = {body.name: bound(body) for body in scene.bodies if body.collisions}
    for name, other in itertools.combinations(boxes, 2):
        low, high = boxes[name]
        bottom, top = boxes[other]
        are_near = (low < top + TOUCHES_M).all() and (bottom < high + TOUCHES_M).all()
        if are_near and names & {name, other}:
            yield name, other
