"""Find pegs on which a body can hang by a hole, such as a mug by its handle."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.random import Generator
from scipy import ndimage
from scipy.spatial.transform import Rotation

from core.geometry import Array
from plugins.vlms.offline.boxes import UP, Boxes, count_overlaps
from plugins.vlms.offline.chance import Range
from plugins.vlms.offline.raycast import cross_lines
from plugins.vlms.offline.subgoals import Subgoal
from plugins.vlms.offline.targets import Place, Target

# A peg.
_SLENDER = 3.0  # times as long as thick, at least
_STEEP = 0.6  # the upward part of its direction is less: nothing hangs on a steep one
_LEAST_PEG_M = 0.03
_MOST_THICK_M = 0.04
_SAME_M = 1e-4  # between the tips of boxes that are one peg
_BEYOND_M = 0.01  # from its free end there is nothing so near
_OVER = Range(0.3, 0.6)  # of its length, from its free end, at which bodies hang
_NEAR_M = 0.06  # to the place that is asked for

# How a body is turned to hang there.
_YAWS: list[float] = (np.arange(-11, 12) * np.pi / 12).tolist()
_TURN_COSTS = 1e-5  # square metres of room that a turn by a radian is worth
_AXIS = (1.0, 0.0, 0.0)  # of a body, which a turn is given by

# A hole, as lines along the peg find it.
_CELL_M = 0.002  # between lines
_MOST_CELLS = 150  # of a side
_ROOM_M = 0.002  # between a peg and the hole's edge, when it goes in
_IN_EYE_M = 0.02  # from its hole, that a peg is in it
_HANGS_M = 0.002  # bodies are so much higher than where they hang, to be let down
_BAND_M = 0.006  # above a hole, of what hangs on the peg


@dataclass(frozen=True, eq=False)
class Peg:
    """A slender part of a fixed body that ends freely.

    Attributes:
        tip: the middle of its free end, (3,).
        axis: unit vector (3,) along it, out of its free end.
        length: metres.
        half: half of its greatest thickness, metres.
    """

    tip: Array
    axis: Array
    length: float
    half: float


class Eye(NamedTuple):
    """A hole through a body.

    Attributes:
        place: of a peg's middle in it, when the body hangs on the peg, (3,).
        room: for the peg's middle, square metres.
    """

    place: Array
    room: float


class Hung(NamedTuple):
    """How a body hangs on a peg.

    Attributes:
        peg: on which it hangs.
        yaw: by which it is turned about the vertical, radians.
        shift: (3,) to where it would hang at the peg's free end, metres.
    """

    peg: Peg
    yaw: float
    shift: Array


class Swing(NamedTuple):
    """How a body turns about the peg that it hangs on, when it is let go.

    Attributes:
        middle: of the peg, (3,).
        turn: (3,) along the peg, as long as the angle, radians.
    """

    middle: Array
    turn: Array


def hang_on_peg(subgoal: Subgoal, goal: Target, rng: Generator) -> Target:
    """Give a goal a place on a peg that wants its body near one, or only higher, and let go there.

    Others stay as they are.

    Args:
        subgoal: the goal's bodies, without a shift.
        goal: in the world.
        rng: random numbers.
    """
    if goal.place is None or goal.joint is not None or goal.container is not None:
        return goal
    if not goal.released or goal.axis is not None or len(subgoal.solids) > 1:
        return goal

    solid = subgoal.solids[0]
    found = subgoal.model.find_once(
        ("pegs", solid.body.name), lambda: list(_find_hung(subgoal))
    )
    far = _OVER.draw(rng) if found else 0.0
    ways = []
    for hung in found:
        there = solid.position + hung.shift - far * hung.peg.length * hung.peg.axis
        if _suits(there, goal.place, solid.position[2]):
            ways.append((hung.yaw, there))
    if not ways:
        return goal

    yaw, there = ways[int(rng.integers(len(ways)))]
    goal = replace(goal, place=tuple(there.tolist()))
    if yaw == 0.0:
        return goal

    turned = Rotation.from_rotvec(yaw * UP) * solid.body.pose.rotation
    return replace(goal, axis=_AXIS, points=tuple(turned.apply(_AXIS).tolist()))


def _suits(there: Array, place: Place, height: float) -> bool:
    """Report whether a body hangs near the place that is asked for, or as high where nothing else is.

    Args:
        there: where it hangs, (3,).
        place: that is asked for.
        height: where it is now.
    """
    x, y, z = place
    if x is None and y is None:
        return z is not None and height < z <= there[2]

    return all(
        wanted is None or abs(wanted - found) < _NEAR_M
        for wanted, found in zip(place, there.tolist(), strict=True)
    )


def _find_hung(subgoal: Subgoal) -> Iterator[Hung]:
    """Find pegs that a body can hang on, turned as it has most room around each."""
    body = subgoal.solids[0].position
    for peg in find_pegs(subgoal):
        best: tuple[float, Hung] | None = None
        for yaw in _YAWS:
            turn = Rotation.from_rotvec(yaw * UP).as_matrix()
            boxes = subgoal.boxes.moved_to((body - turn @ body)[None], turn[None])
            eye = find_eye(boxes, peg)
            if eye is None:
                continue

            worth = eye.room - _TURN_COSTS * abs(yaw)
            if best is None or worth > best[0]:
                best = worth, Hung(peg, yaw, peg.tip - eye.place + _HANGS_M * UP)

        if best is not None:
            yield best[1]


def find_swing(subgoal: Subgoal) -> Swing | None:
    """Find how a body swings on the peg that it hangs on at its goal; None: it hangs on none.

    Args:
        subgoal: with one body.
    """
    by = subgoal.shift[None]
    boxes = subgoal.turned.boxes.moved_to(by, np.eye(3)[None])
    middle = subgoal.turned.center + subgoal.shift
    for peg in find_pegs(subgoal):
        eye = find_eye(boxes, peg)
        if eye is None:
            continue

        off = eye.place - peg.tip
        along = float(off @ peg.axis)
        if np.linalg.norm(off - along * peg.axis) > _IN_EYE_M or along > 0.0:
            continue

        # To where its middle is below the peg.
        arm = middle - eye.place
        across = np.cross(peg.axis, UP)
        side = float(arm @ across) / float(np.linalg.norm(across))
        angle = np.arctan2(side, -float(arm @ UP))
        return Swing(eye.place, -angle * peg.axis)

    return None


def find_pegs(subgoal: Subgoal) -> Iterator[Peg]:
    """Find the pegs around a subgoal's bodies.

    Args:
        subgoal: whose bodies have none.
    """
    obstacles = subgoal.obstacles
    seen = list[Array]()
    fixed = Boxes.concatenate(
        solid.boxes
        for solid in subgoal.model.solids.values()
        if solid.body.fixed and solid not in subgoal.solids
    )
    for center, axes, halves in zip(
        fixed.centers, fixed.axes, fixed.halves, strict=True
    ):
        order = np.argsort(halves)
        half = float(halves[order[1]])
        length = float(2 * halves[order[2]])
        axis = axes[:, order[2]]
        if abs(axis[2]) > _STEEP or 2 * half > _MOST_THICK_M:
            continue
        if length < max(_LEAST_PEG_M, _SLENDER * 2 * half):
            continue

        for way in (axis, -axis):
            tip = center + length / 2 * way
            # What is round is made of several boxes.
            if any(np.allclose(tip, other, atol=_SAME_M) for other in seen):
                continue
            seen.append(tip)
            beyond = Boxes(
                (tip + _BEYOND_M * way)[None],
                np.eye(3)[None],
                np.full((1, 3), _BEYOND_M / 2),
            )
            if not count_overlaps(beyond, obstacles):
                yield Peg(tip, way, length, half)


def find_eye(boxes: Boxes, peg: Peg) -> Eye | None:
    """Find where a peg's middle is when a body hangs on it by a hole; None: it has no such hole.

    Args:
        boxes: of the body.
        peg: along which the hole goes through the body.
    """
    across = np.cross(UP, peg.axis)
    across = across / np.linalg.norm(across)
    upward = np.cross(peg.axis, across)

    origin = boxes.centers.mean(axis=0)
    right, left = boxes.ranges_along(across, origin)
    low, high = boxes.ranges_along(upward, origin)
    columns = np.arange(right.min() - _CELL_M, left.max() + _CELL_M, _CELL_M)
    rows = np.arange(low.min() - _CELL_M, high.max() + _CELL_M, _CELL_M)
    if max(len(columns), len(rows)) > _MOST_CELLS:
        return None

    starts = origin + columns[:, None, None] * across + rows[:, None] * upward
    near, _ = cross_lines(boxes, starts.reshape(-1, 3), peg.axis)
    filled = np.isfinite(near).any(axis=1).reshape(len(columns), len(rows))
    hole = ndimage.binary_fill_holes(filled) & ~filled

    # Where the peg's middle can be.
    cells = int(np.ceil((peg.half + _ROOM_M) / _CELL_M))
    around = np.ones((2 * cells + 1, 2 * cells + 1), dtype=bool)
    room = ndimage.binary_erosion(hole, around)
    if not room.any():
        return None

    column, row = np.nonzero(room)
    top = int(row.max())
    middle = float(columns[column[row == top]].mean())
    place = origin + middle * across + rows[top] * upward

    # The middle, along the peg, of what hangs on it.
    above = place + (cells * _CELL_M + _BAND_M) * upward
    near, far = cross_lines(boxes, above[None], peg.axis)
    met = np.isfinite(near)
    if not met.any():
        return None

    along = (near[met].min() + far[met].max()) / 2
    return Eye(place + along * peg.axis, np.count_nonzero(room) * _CELL_M**2)
