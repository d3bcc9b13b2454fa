"""Look at how the bodies of a layout stand before anything moves: what overlaps, what falls, and what is left behind.

A layout that a variation draws is looked at as the nominal one is.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from core.geometry import Array, Pose, Vector
from core.robot.solids import body_solids, closest
from core.scene import Body, Scene, Soft, State
from core.task import Task
from core.values.layouts import NONE

TOUCHES_M = 0.003
OVERLAP_M = 0.001  # what is more is a mistake
FALLS_M = 0.002  # more than engines need to settle what rests
STAYS_M = 1e-6  # a body that moves less from layout to layout stays
LAYOUTS = 8  # that are looked at
_DEEPEST_M = 3.0  # of falls: where nothing is below, something else stops it
MOST_HZ = 10_000.0  # steps a second, however fast something is
_HALFWAY = 0.5  # through what is thin: farther in a step, it may come out behind
_MOST = 5  # pairs or bodies that are named

Box = tuple[Array, Array]
Pair = tuple[str, str]


class Fault(NamedTuple):
    """What is wrong with a layout: the bodies that it is about, and a line."""

    bodies: Pair
    text: str


def bound(body: Body) -> Box:
    """Bound a body's collision shapes in the world, or the nodes of a soft one with its thickness."""
    if isinstance(body, Soft):
        half = body.form.thickness / 2
        return body.placed.min(axis=0) - half, body.placed.max(axis=0) + half

    bounds = np.array([solid.bounds() for solid in body_solids(body)])
    middles = bounds[:, 0]
    halves = bounds[:, 1]
    return (middles - halves).min(axis=0), (middles + halves).max(axis=0)


def bound_upright(scene: Scene) -> dict[str, Box]:
    """Bound each body that collides as `bound`, turned so that gravity draws down."""
    upright = turn_upright(scene.gravity)
    return {
        body.name: bound(replace(body, pose=upright @ body.pose))
        for body in scene.bodies
        if body.collides
    }


def turn_upright(gravity: Vector) -> Pose:
    """Return the turn after which a scene's gravity points down."""
    if not any(gravity):
        return Pose()

    turn, _ = Rotation.align_vectors([[0.0, 0.0, -1.0]], [gravity])
    return Pose.from_rotation((0.0, 0.0, 0.0), turn)


def list_held(scene: Scene) -> set[str]:
    """List the bodies that need nothing to lie on: joined, bonded, pinned or thrown."""
    held = {joint.body for joint in scene.joints}
    held |= {bond.body for bond in scene.bonds}
    held |= {soft.name for soft in scene.softs if soft.pinned}
    return held | {body.name for body in scene.bodies if any(body.velocity)}


def measure_fall(name: str, boxes: Mapping[str, Box]) -> float:
    """Compute how far a body's box is above the next one below it, m; 0 where boxes overlap, inf: there is none."""
    low, _ = boxes[name]
    least = float("inf")
    for other, (_, top) in boxes.items():
        if other != name and _is_below(name, other, boxes):
            least = min(least, max(0.0, float(low[2] - top[2])))

    return least


def pair_bodies(
    scene: Scene, names: Collection[str], margin: float = TOUCHES_M
) -> Iterator[Pair]:
    """Yield pairs of bodies whose bounding boxes are nearer than a margin, m, of which one has such a name."""
    boxes = {body.name: bound(body) for body in scene.bodies if body.collisions}
    for name, other in itertools.combinations(boxes, 2):
        low, high = boxes[name]
        bottom, top = boxes[other]
        are_near = (low < top + margin).all() and (bottom < high + margin).all()
        if are_near and (name in names or other in names):
            yield name, other


def measure_gap(scene: Scene, name: str, other: str) -> float:
    """Measure the signed distance of two bodies, m."""
    return closest(tuple(body_solids(scene[name])), tuple(body_solids(scene[other])))[0]


def find_gaps(scene: Scene, names: Collection[str]) -> dict[Pair, float]:
    """Find the pairs of bodies that touch, of which one has such a name, and the gaps between them, m."""
    found = dict[Pair, float]()
    for name, other in pair_bodies(scene, names):
        gap = measure_gap(scene, name, other)
        if gap < TOUCHES_M:
            found[name, other] = gap

    return found


def find_faults(scene: Scene) -> Iterator[Fault]:
    """Yield what overlaps, the deepest first, and what begins in the air."""
    yield from find_overlaps(scene)
    yield from find_falls(scene)


def find_overlaps(scene: Scene) -> Iterator[Fault]:
    """Yield the pairs of bodies that overlap, of which one can move and no joint connects them, the deepest first."""
    gaps = find_gaps(scene, {body.name for body in scene.free})
    for pair, gap in sorted(gaps.items(), key=lambda item: item[1]):
        if gap < -OVERLAP_M and frozenset(pair) not in scene.joined:
            mend = "move one, make one smaller, or leave a gap of 0.1 mm"
            yield Fault(
                pair, f"{' and '.join(pair)} overlap by {-1000 * gap:.0f} mm; {mend}"
            )


def find_falls(scene: Scene) -> Iterator[Fault]:
    """Yield the bodies that begin in the air, and are neither held there nor thrown."""
    if not any(scene.gravity):
        return

    held = list_held(scene)
    boxes = bound_upright(scene)

    for body in scene.free:
        if body.name not in boxes or body.name in held:
            continue

        gap = measure_fall(body.name, boxes)
        if gap > FALLS_M:
            under = f"it falls by {1000 * gap:.3g} mm"
            if np.isinf(gap):
                under = "nothing stops it where gravity draws it"

            text = f"body {body.name} begins in the air: {under}; a position is that of its middle"
            yield Fault((body.name, ""), text)


def say_first(lines: Sequence[str], others: str) -> Iterator[str]:
    """Yield the first lines, and how many ``others`` there are, such as "pairs of bodies overlap"."""
    yield from lines[:_MOST]
    if len(lines) > _MOST:
        yield f"{len(lines) - _MOST} more {others}"


def find_left_behind(scene: Scene, nominal: Scene) -> Iterator[Fault]:
    """Yield the bodies that stay where they are in the nominal layout, while all that they touch there moves away."""
    names = [body.name for body in scene.free]
    partners: dict[str, list[str]] = {name: [] for name in names}
    for pair in find_gaps(nominal, names):
        for name, other in (pair, pair[::-1]):
            if name in partners:
                partners[name].append(other)

    for name, others in partners.items():
        moved = {other: _way(scene, nominal, other) for other in others}
        if not moved or _way(scene, nominal, name) > STAYS_M:
            continue

        if min(moved.values()) > TOUCHES_M:
            bearer = max(moved, key=lambda other: moved[other])
            text = f"{name} stays where it is while {bearer}, which it touches, moves by {1000 * moved[bearer]:.0f} mm"
            mend = f"vary both alike, or place it `at` {bearer}"
            yield Fault((name, bearer), f"{text}; {mend}")


def _way(scene: Scene, nominal: Scene, name: str) -> float:
    """Measure how far a body is from where the nominal layout has it, m."""
    way = scene[name].pose.position - nominal[name].pose.position
    return float(np.linalg.norm(way))


def find_layout_warnings(task: Task) -> Iterator[str]:
    """Yield a line for what is wrong with layouts that a task draws and right in its nominal one.

    `LAYOUTS` of them are looked at. What is wrong in several is said once.
    """
    if task.variation == NONE:
        return

    plain = copy(task)
    plain.variation = NONE
    nominal = plain.scene(0)
    known = {fault.bodies for fault in find_faults(nominal)} | nominal.hindered.keys()
    first = dict[object, str]()
    count = Counter[object]()

    for seed in range(LAYOUTS):
        scene = task.scene(seed)
        faults = [*find_faults(scene), *find_left_behind(scene, nominal)]
        found = [(fault.bodies, fault.text) for fault in faults]
        for subject, text in (*found, *scene.hindered.items()):
            if subject not in known:
                where = f"in layout {seed} of variation {task.variation}"
                first.setdefault(subject, f"{where}, {text}")
                count[subject] += 1

    lines = [
        f"{text} (so in {count[subject]} of {LAYOUTS} layouts)"
        for subject, text in first.items()
    ]
    yield from say_first(lines, "such warnings of layouts")


class Flight(NamedTuple):
    """A body that moves by itself: how fast it gets, m/s, and how thin it is, or the thinnest that it may hit, m."""

    body: str
    speed: float
    thin: float

    @property
    def rate(self) -> float:
        """How many steps a second are needed, so that it goes no farther than halfway through what is thin in one."""
        return self.speed / (_HALFWAY * self.thin)


def find_fast(scene: Scene) -> Iterator[str]:
    """Yield a line for each body that moves by itself so fast that no engine's steps are fine enough."""
    for flight in list_flights(scene):
        if flight.rate > MOST_HZ:
            thin = f"{1000 * flight.thin:.2g} mm"
            yield (
                f"body {flight.body} gets to {flight.speed:.1f} m/s, and may go through what is {thin} thick; make "
                "that thicker, or let it begin slower or lower"
            )


def find_rate(scene: Scene, states: State) -> float:
    """Return how many steps a second small bodies need that nothing holds, `MOST_HZ` at most.

    None then goes farther than half its largest side in a step, at the fastest that it got in states (T,): a marble
    that a robot drops, too.
    """
    speeds = np.linalg.norm(states.linear_velocities, axis=-1).max(axis=0)
    fastest = dict(zip(states.names, speeds.tolist(), strict=True))
    sides = _measure_sides(scene).items()
    rates = [Flight(name, fastest[name], side).rate for name, side in sides]

    return min(max(rates, default=0.0), MOST_HZ)


@lru_cache(maxsize=8)
def _measure_sides(scene: Scene) -> dict[str, float]:
    """Measure the largest side, metres, of each free body that collides and that nothing holds."""
    hung = list_hung(scene)
    sides = {}
    for body in scene.free:
        if body.collisions and body.name not in hung:
            low, high = bound(body)
            sides[body.name] = float((high - low).max())

    return sides


def list_hung(scene: Scene) -> set[str]:
    """List the bodies that joints or bonds hold."""
    return {joint.body for joint in scene.joints} | {bond.body for bond in scene.bonds}


@lru_cache(maxsize=8)
def list_flights(scene: Scene) -> list[Flight]:
    """List the bodies that are thrown, or fall before anything touches them."""
    boxes = bound_upright(scene)
    flights = []
    pull = float(np.linalg.norm(scene.gravity))
    hung = list_hung(scene)
    thin = {
        body.name: min(part.shape.thickness for part in body.collisions)
        for body in scene.bodies
        if body.collisions
    }

    for body in scene.free:
        if body.name not in thin or body.name in hung:
            continue

        gap = measure_fall(body.name, boxes)
        fall = min(gap, _DEEPEST_M) if pull else 0.0
        thrown = float(np.linalg.norm(body.velocity))
        if not thrown and (fall <= FALLS_M or find_gaps(scene, {body.name})):
            continue  # it lies, or hangs on what it touches

        met = [
            name
            for name in thin
            if name != body.name and (thrown or _is_below(body.name, name, boxes))
        ]
        thinnest = min([thin[body.name], *(thin[name] for name in met)])
        speed = float(np.hypot(thrown, np.sqrt(2 * pull * fall)))
        flights.append(Flight(body.name, speed, thinnest))

    return flights


def _is_below(name: str, other: str, boxes: Mapping[str, Box]) -> bool:
    """Report whether a body would fall on another one, by their boxes."""
    low, high = boxes[name]
    bottom, top = boxes[other]
    over = (low[:2] < top[:2]).all() and (high[:2] > bottom[:2]).all()
    return bool(over and bottom[2] < low[2])
