"""Lead a body around what bars its way on the ground, or a hole in it, in a pen: four walls without a floor.

The way is the shortest one over a grid on which the pen, which does not turn, touches nothing, and the body stands on
as much as where it is now. Of its places those are kept between which it goes straight. Where no pen gets, as into a
narrow slot, a blade pushes: across it first, and then along it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
from numpy.random import Generator
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from core.geometry import Array
from plugins.vlms.offline.boxes import LEVEL, UP, Boxes, find_overlaps
from plugins.vlms.offline.chance import Range
from plugins.vlms.offline.heads import Head, make_blade, make_pen
from plugins.vlms.offline.paths import HeadPath
from plugins.vlms.offline.raycast import find_tops
from plugins.vlms.offline.subgoals import Subgoal

_GRID_M = 0.01
_AROUND_M = 0.25  # of where the body is and of its goal, that the way may go
_WALL_M = 0.005  # thick
_SPARE_M = Range(0.002, 0.006)  # between the body and a wall
_CLEAR_M = 0.003  # between the pen and what it passes
_ABOVE_M = Range(0.003, 0.006)  # the ground
_HEIGHT = Range(0.6, 1.0)  # of the body's
_HEIGHTS_M = (0.02, 0.12)
_LEAD_M_S = Range(0.08, 0.2)
_LEAVE_M = 0.05  # up, above the body
_GROUND_M = 0.01  # a body stands on what is no farther below its foot
_STANDS = 0.8  # of the way from its middle to its corners: what is below these places bears it
_FALL_M = 0.01  # what has to get lower by more is to fall
_LEAST_LEG_M = 0.02  # of two pushes
_BLADE = Range(0.7, 0.9)  # of the narrower side of the body
_BLADE_THICK_M = Range(0.006, 0.012)
_BLADE_HEIGHT = Range(0.4, 0.7)  # of the body's
_BEHIND_M = Range(0.006, 0.015)
_PUSH_M_S = Range(0.06, 0.15)
_NEIGHBOURS = ((1, 0), (0, 1), (1, 1), (1, -1))  # and those across from them


def find_detour(subgoal: Subgoal) -> list[Array] | None:
    """Find the way of a pen with the bodies around what bars the straight one; None: there is none.

    Args:
        subgoal: the bodies, which go over the ground.

    Returns:
        Shifts (3,) from where the bodies are, one after another.
    """
    key = ("detour", *map(id, subgoal.solids), repr(subgoal.shift))
    return subgoal.model.find_once(key, lambda: _find_detour(subgoal))


def loses_ground(subgoal: Subgoal) -> bool:
    """Report whether bodies that are to end as high as they are now come over a hole, or an edge, on the straight way.

    Args:
        subgoal: the bodies, which go over the ground.
    """
    goal = subgoal.goal
    if goal is None or goal.place is None or goal.joint is not None:
        return False
    if goal.place[2] is None or goal.over_edge or subgoal.shift[2] < -_FALL_M:
        return False

    count = max(2, int(np.ceil(subgoal.length / _GRID_M)) + 1)
    shares = np.linspace(0.0, 1.0, count)[:, None]
    places = subgoal.center[:2] + shares * subgoal.shift[:2]
    return not bool(_find_borne(subgoal, places).all())


def make_leader(subgoal: Subgoal, detour: list[Array], rng: Generator) -> Head:
    """Make a pen that comes down around bodies, and leads them along a detour.

    Args:
        subgoal: the bodies.
        detour: see `find_detour`.
        rng: random numbers.
    """
    extent = subgoal.extent(0.0)
    spare = _SPARE_M.draw(rng)
    pen = make_pen(
        width=extent.across + 2 * spare,
        depth=extent.along + 2 * spare,
        height=float(np.clip(subgoal.height * _HEIGHT.draw(rng), *_HEIGHTS_M)),
        thick=_WALL_M,
    )

    def lead(path: HeadPath, rng: Generator) -> str:
        """Come down around the bodies, go from place to place, and leave them."""
        start = subgoal.center * LEVEL - pen.depth / 2 * extent.ahead
        start = start + (subgoal.lower[2] + _ABOVE_M.draw(rng)) * UP
        speed = _LEAD_M_S.draw(rng)
        path.descend(subgoal, extent.heading, start)
        for shift in detour:
            path.move(start + shift, extent.heading, speed)

        leave = path.end + (subgoal.height + _LEAVE_M) * UP
        path.go(extent.heading, leave, touch=True)
        return f"comes down around the body, and leads it around what is in its way, in {len(detour)} straight parts"

    return replace(pen, primitive="guided", motion=lead)


def find_two_pushes(subgoal: Subgoal) -> tuple[Array, Array] | None:
    """Find two shifts (3,) along the world's axes that lead bodies to their goal, one after the other; None: no way.

    Args:
        subgoal: the bodies, which go over the ground.
    """
    for axis in (1, 0):
        across = np.zeros(3)
        across[axis] = subgoal.shift[axis]
        along = subgoal.shift * LEVEL - across
        if min(np.linalg.norm(across), np.linalg.norm(along)) < _LEAST_LEG_M:
            continue
        if not (subgoal.is_blocked(across) or subgoal.is_blocked(along, across)):
            return across, along

    return None


def make_two_pushes(
    subgoal: Subgoal, legs: tuple[Array, Array], rng: Generator
) -> Head:
    """Make a blade that pushes bodies from two sides, one after the other.

    Args:
        subgoal: the bodies.
        legs: see `find_two_pushes`.
        rng: random numbers.
    """
    narrow = float((subgoal.upper - subgoal.lower)[:2].min())
    height = subgoal.height * _BLADE_HEIGHT.draw(rng)
    blade = make_blade(
        width=narrow * _BLADE.draw(rng),
        height=float(np.clip(height, *_HEIGHTS_M)),
        thick=_BLADE_THICK_M.draw(rng),
    )

    def push_twice(path: HeadPath, rng: Generator) -> str:
        """Come down behind the bodies, push them, rise, and do so on another side."""
        moved = np.zeros(3)
        for leg in legs:
            extent = subgoal.extent(float(np.arctan2(leg[1], leg[0])))
            gap = _BEHIND_M.draw(rng)
            low = subgoal.lower[2] + _ABOVE_M.draw(rng)
            rear = (extent.rear - gap) * extent.ahead + extent.middle + moved
            start = rear * LEVEL + low * UP
            end = start + leg + gap * extent.ahead
            path.descend(subgoal, extent.heading, start)
            path.move(end, extent.heading, _PUSH_M_S.draw(rng))
            back = end - gap * extent.ahead
            high = max(subgoal.clear_height, back[2]) + _LEAVE_M
            path.go(extent.heading, back, back * LEVEL + high * UP, touch=True)
            moved = moved + leg

        return "pushes the body across first, and then along into its place"

    return replace(blade, primitive="guided", motion=push_twice)


def _find_detour(subgoal: Subgoal) -> list[Array] | None:
    """Search for what `find_detour` returns."""
    here = subgoal.center[:2]
    there = here + subgoal.shift[:2]
    low = np.minimum(here, there) - _AROUND_M
    counts = np.ceil((np.maximum(here, there) + _AROUND_M - low) / _GRID_M).astype(int)
    free = _find_free(subgoal, low, counts + 1)

    first = np.round((here - low) / _GRID_M).astype(int)
    last = np.round((there - low) / _GRID_M).astype(int)
    if not (free[tuple(first)] and free[tuple(last)]):
        return None

    cells = _find_shortest(free, first, last)
    if cells is None:
        return None

    corners = _keep_corners(cells, free)
    shifts = [np.append((corner - first) * _GRID_M, 0.0) for corner in corners[1:-1]]
    return [*shifts, subgoal.shift * LEVEL]


def _find_free(
    subgoal: Subgoal, low: Array, counts: npt.NDArray[np.int64]
) -> npt.NDArray[np.bool_]:
    """Find at which places of a grid a pen around the bodies touches nothing.

    Args:
        subgoal: the bodies.
        low: the corner of the grid, (2,).
        counts: of its places along x and y.
    """
    margin = _SPARE_M.high + _WALL_M + _CLEAR_M
    size = subgoal.upper - subgoal.lower + 2 * margin * LEVEL
    bottom = subgoal.lower[2] + _ABOVE_M.low
    middle = bottom + size[2] / 2
    x, y = np.meshgrid(*(np.arange(count) for count in counts), indexing="ij")
    places = np.stack([x.ravel(), y.ravel()], axis=1) * _GRID_M + low
    centers = np.column_stack([places, np.full(len(places), middle)])
    axes = np.broadcast_to(np.eye(3), (len(places), 3, 3))
    halves = np.broadcast_to(size / 2, centers.shape)

    taken, _ = find_overlaps(Boxes(centers, axes, halves), subgoal.obstacles)
    free = _find_borne(subgoal, places)
    free[taken] = False
    return free.reshape(x.shape)


def _find_borne(subgoal: Subgoal, places: Array) -> npt.NDArray[np.bool_]:
    """Find at which places the bodies stand on something wherever they do so now, (K,).

    Args:
        subgoal: the bodies.
        places: of their middle, on the level, (K, 2).
    """
    reach = _STANDS * (subgoal.upper - subgoal.lower)[:2] / 2
    corners = np.array([(0, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)]) * reach
    stands = _find_standing(subgoal, subgoal.center[:2] + corners)

    borne = np.ones(len(places), dtype=bool)
    for corner in corners[stands]:
        borne &= _find_standing(subgoal, places + corner)

    return borne


def _find_standing(subgoal: Subgoal, points: Array) -> npt.NDArray[np.bool_]:
    """Find at which points something is below the bodies' foot, or around it, (K,).

    Args:
        subgoal: the bodies.
        points: on the level, (K, 2).
    """
    foot = np.full(len(points), subgoal.lower[2])
    tops = find_tops(subgoal.obstacles, np.column_stack([points, foot + _GROUND_M]))
    return np.asarray(tops > foot - _GROUND_M)


def _find_shortest(
    free: npt.NDArray[np.bool_],
    first: npt.NDArray[np.int64],
    last: npt.NDArray[np.int64],
) -> npt.NDArray[np.int64] | None:
    """Find the shortest way between two places of a grid over free ones, (N, 2); None: there is none.

    Args:
        free: places, (U, V).
        first: the place where it begins, (2,).
        last: the place where it ends, (2,).
    """
    numbers = np.arange(free.size).reshape(free.shape)
    starts = []
    ends = []
    lengths = []
    u, v = np.nonzero(free)
    for way in _NEIGHBOURS:
        near = np.stack([u, v], axis=1) + way
        inside = np.array(((near >= 0) & (near < free.shape)).all(axis=1))
        inside[inside] = free[tuple(near[inside].T)]
        starts.append(numbers[u, v][inside])
        ends.append(numbers[tuple(near[inside].T)])
        lengths.append(np.full(inside.sum(), np.hypot(*way)))

    places = (np.concatenate(starts), np.concatenate(ends))
    graph = coo_array((np.concatenate(lengths), places), shape=(free.size, free.size))
    begin = numbers[tuple(first)]
    distances, before = dijkstra(
        graph.tocsr(), directed=False, indices=begin, return_predecessors=True
    )

    number = numbers[tuple(last)]
    if not np.isfinite(distances[number]):
        return None

    passed = [int(number)]
    while passed[-1] != begin:
        passed.append(int(before[passed[-1]]))

    return np.stack(np.unravel_index(passed[::-1], free.shape), axis=1)


def _keep_corners(
    cells: npt.NDArray[np.int64], free: npt.NDArray[np.bool_]
) -> list[npt.NDArray[np.int64]]:
    """Keep those places of a way between which the straight one is free.

    Args:
        cells: of the way, (N, 2).
        free: places, (U, V).
    """
    corners = [cells[0]]
    number = 0
    while number < len(cells) - 1:
        farthest = number + 1
        for other in range(len(cells) - 1, number, -1):
            steps = int(2 * np.abs(cells[other] - cells[number]).max()) + 1
            line = np.linspace(cells[number], cells[other], steps).round().astype(int)
            if free[tuple(line.T)].all():
                farthest = other
                break

        corners.append(cells[farthest])
        number = farthest

    return corners
