"""Find out whether a rigid thing can be brought to where it starts, past what stands there.

A way in is a way out, walked backward. Straight ways are tried first, in which each solid sweeps a convex hull. Only
where all of them are blocked, the thing slides along the world's axes, and is then turned and shifted at random, until
a straight way leads on. The effort is bounded, so a very winding way may be missed; a straight one is not.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property, lru_cache
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from core.geometry import Array, Pose
from core.robot.solids import Obstacles, Solid, contact, corners
from core.shapes.solid import convex_hull

CLEAR_M = 2e-4
"""How deep a way may go into what is in contact at the start, beyond that contact."""

FAR_M = 1.0
"""How far a straight way leads, from the last body that is near."""

HUGE_M = 3.0
"""A body of this size, such as a floor, is nothing that one gets out of."""

MOST_POSES = 50
"""How many poses the tree may have."""

MOST_STEPS = 30
"""Of a move in the tree."""

SLIDES = 2
"""How many moves along the world's axes come before a straight way out."""

_STOPS = 4  # of a slide
_STOP_M = 0.06  # between two of them
CELL_M = 0.01
"""Two stops in one cell of this size count as one."""

_SHIFT_M = 0.15  # a move of the tree, at most
_TURN_RAD = 0.8
_LEAST_STEP_M = 5e-4
_AXES = np.concatenate([np.eye(3), -np.eye(3)])  # the directions of slides (6, 3)


class Trap(NamedTuple):
    """What holds a thing where it starts: one of its parts, a body in its way, and a direction (3,) out."""

    part: str
    body: str
    direction: Array


@lru_cache(maxsize=1)
def _directions() -> Array:
    """The directions (17, 3) of straight ways: up first, then obliquely up, and level."""
    steps = product((1.0, 0.0), (0.0, 1.0, -1.0), (0.0, 1.0, -1.0))
    ways = [(x, y, up) for up, x, y in steps if (x, y, up) != (0.0, 0.0, 0.0)]
    return np.array([np.divide(way, np.linalg.norm(way)) for way in ways])


def find_trap(parts: Sequence[Solid], obstacles: Obstacles) -> Trap | None:
    """Find what keeps a thing from being brought to where it is.

    Args:
        parts: its solids, in the world.
        obstacles: what stands there, which does not give way.

    Returns:
        What is in the way along the direction in which least is; None: there is a way.
    """
    if not parts:
        return None

    tree = _Tree(parts, obstacles)
    if tree.leads_straight_out(parts) or tree.slides_out() or tree.grows_out():
        return None

    blocks = [[*_find_blocks(parts, obstacles, way)] for way in _directions()]
    return min(blocks, key=len)[0]


def _find_blocks(
    parts: Sequence[Solid], obstacles: Obstacles, direction: Array
) -> Iterator[Trap]:
    """Yield what parts meet on a straight way."""
    way = _measure_way(parts, obstacles, direction) * direction

    for part in parts:
        middle, half = part.bounds()
        near = obstacles.overlap(middle + way / 2, half + np.abs(way) / 2)
        if not near:
            continue

        swept = _sweep(part, way)
        for other in near:
            gap, _, _ = contact(swept, other)
            if -gap <= CLEAR_M:
                continue
            touching, _, _ = contact(part, other)
            if -gap > max(-touching, 0.0) + CLEAR_M:
                yield Trap(part.name, other.name, direction)


def _measure_way(
    parts: Sequence[Solid], obstacles: Obstacles, direction: Array
) -> float:
    """Measure how far parts have to go until they are beyond all bodies, metres."""
    across = np.abs(direction)
    small = obstacles.halves.max(axis=1) < HUGE_M / 2
    ends = obstacles.centers @ direction + obstacles.halves @ across
    bounds = [part.bounds() for part in parts]
    begin = min(middle @ direction - half @ across for middle, half in bounds)
    way = ends[small].max(initial=begin) - begin

    return min(float(way), 2.0) + FAR_M


def _sweep(part: Solid, way: Array) -> Solid:
    """Build the hull of a part and of itself at the end of a way (3,)."""
    begin = part.pose.apply(corners(part.geometry))
    hull = convex_hull(np.concatenate([begin, begin + way]))

    return replace(part, geometry=hull, pose=Pose(), shape=None)


class _Tree:
    """Poses that a thing can get to from its start, by slides along the axes, and by moves that are drawn at random."""

    def __init__(self, parts: Sequence[Solid], obstacles: Obstacles) -> None:
        self.parts = parts
        self.obstacles = obstacles
        self.rng = np.random.default_rng(0)

        places = [part.bounds() for part in parts]
        self.middle = np.mean([middle for middle, _ in places], axis=0)
        far = [np.linalg.norm(np.abs(m - self.middle) + half) for m, half in places]
        self.reach = float(np.max(far))
        self.blocking: dict[int, int] = {}  # the part by the direction

    def slides_out(self) -> bool:
        """Report whether a straight way leads out after a few slides along the world's axes, as behind a hook."""
        level = [Pose()]
        known = {(0, 0, 0)}

        for _ in range(SLIDES):
            reached = []
            for start, axis in product(level, _AXES):
                for pose in self._slide(start, axis):
                    place = tuple(np.round(pose.position / CELL_M).astype(int).tolist())
                    if place in known:
                        continue

                    known.add(place)
                    reached.append(pose)
                    if self.leads_straight_out(self._carry_parts(pose)):
                        return True

            level = reached

        return False

    def _slide(self, start: Pose, axis: Array) -> Iterator[Pose]:
        """Yield the stops of a way along an axis (3,), as far as it is free."""
        for _ in range(_STOPS):
            shift = _STOP_M * axis
            reached = self._go(start, shift, np.zeros(3))
            yield reached
            if not np.allclose(reached.position, start.position + shift):
                return

            start = reached

    def _carry_parts(self, pose: Pose) -> list[Solid]:
        """Return the thing's parts as they are at a pose of it."""
        return [_carry(pose, part) for part in self.parts]

    def grows_out(self) -> bool:
        """Report whether a straight way leads out from one of the poses."""
        poses = [Pose()]

        while len(poses) < MOST_POSES:
            start = poses[self.rng.integers(len(poses))]
            reached = self._move(start)
            poses.append(reached)

            if reached is start:
                continue
            if self.leads_straight_out(self._carry_parts(reached)):
                return True

        return False

    def leads_straight_out(self, moved: Sequence[Solid]) -> bool:
        """Report whether a straight way is free; the part that was in the way last is tried first."""
        for number, direction in enumerate(_directions()):
            last = self.blocking.get(number, 0)
            ordered = [moved[last], *moved[:last], *moved[last + 1 :]]
            block = next(_find_blocks(ordered, self.obstacles, direction), None)
            if block is None:
                return True

            names = [part.name for part in moved]
            self.blocking[number] = names.index(block.part)

        return False

    def _move(self, start: Pose) -> Pose:
        """Move from a pose by a random shift and turn, as far as the way is free; return the pose there."""
        shift = self.rng.normal(size=3)
        shift *= self.rng.uniform(0, _SHIFT_M) / np.linalg.norm(shift)
        turn = self.rng.normal(size=3)
        turn *= self.rng.uniform(0, _TURN_RAD) / np.linalg.norm(turn)

        kind = self.rng.integers(3)
        if kind == 0:
            turn *= 0.0
        elif kind == 1:
            shift *= 0.0

        return self._go(start, shift, turn)

    def _go(self, start: Pose, shift: Array, turn: Array) -> Pose:
        """Go from a pose by a shift (3,) and a rotation vector (3,), as far as it is free; return the pose there."""
        most = float(np.linalg.norm(shift) + self.reach * np.linalg.norm(turn))
        share = 0.0
        last = start
        room = self._measure_room(start)

        for _ in range(MOST_STEPS):
            share = min(1.0, share + max(room, _LEAST_STEP_M) / max(most, 1e-9))
            pose = self._between(start, share * shift, share * turn)
            room = self._measure_room(pose)
            if room < -CLEAR_M:
                break

            last = pose
            if share == 1.0:
                break

        return last

    def _between(self, start: Pose, shift: Array, turn: Array) -> Pose:
        """Shift a pose, and turn it about the thing's middle, by a rotation vector (3,)."""
        rotation = Rotation.from_rotvec(turn) * start.rotation
        middle = start.apply(self.middle) + shift
        return Pose.from_rotation(middle - rotation.apply(self.middle), rotation)

    def _measure_room(self, pose: Pose) -> float:
        """Measure the least gap to what is near, less the contact at the start, metres."""
        least = _SHIFT_M

        for number, part in enumerate(self.parts):
            moved = _carry(pose, part)
            middle, half = moved.bounds()
            for other in self.obstacles.overlap(middle, half + least):
                gap, _, _ = contact(moved, other)
                allowed = self.depths.get((number, id(other)), 0.0)
                least = min(least, gap + allowed)

        return least

    @cached_property
    def depths(self) -> dict[tuple[int, int], float]:
        """Measure how deep each part is in what it touches at the start."""
        depths = {}

        for number, part in enumerate(self.parts):
            for other in self.obstacles.near(part, 0.0):
                gap, _, _ = contact(part, other)
                if gap < 0:
                    depths[number, id(other)] = -gap

        return depths


def _carry(pose: Pose, part: Solid) -> Solid:
    """Move a part with the thing that it belongs to."""
    return replace(part, pose=pose @ part.pose)
