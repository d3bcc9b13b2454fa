"""Find by rays where a rod can push a body, where a hook can pull it, and where tines get under it.

Parallel rays go through the layout on a grid around the bodies. Where each enters and leaves each box says what one
would meet there. A rod fits at a point that is hit where a ray meets the bodies before anything else, and so do all
rays within the rod's width. A hook fits where a face has room behind it, and beside it is an opening for the hook to
come in by, from the side to which it pulls. Tines fit under an underside, as rays find it that go up, along lanes in
which nothing is just below it.

What was found is kept: it is the same for all subgoals of the same bodies.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import maximum_filter, minimum_filter

from core.geometry import Array, Pose
from plugins.vlms.offline.boxes import LEVEL, UP, Boxes, heading_axes
from plugins.vlms.offline.subgoals import Subgoal

Mask = npt.NDArray[np.bool_]

_GRID_M = 0.003  # between rays
_MOST_RAYS = 50  # side by side
_MOST_CROSSINGS = 1e6  # of rays and boxes
_AROUND_M = 0.04  # how far beside the bodies rays pass
_HALF_M = (0.01, 0.007, 0.004)  # half widths of rods, the stoutest first
_LONGEST_M = 0.4  # of a rod, from what it passes to the body
_MOST_LEVELS = 12  # heights of undersides that are looked at
_GAPS_M = (0.02, 0.012, 0.006)  # heights of gaps below a body, the highest first
_MOST_WORTH_M = 0.06  # more depth ahead is worth no more
# Tines that are farther apart are worth no more: what they carry is steady by then.
_WIDE_M = 0.05
_BARRED_M = 0.025  # to both sides of a way in: what is nearer is passed by the rod
_ROOF_M = 0.4  # above all rays, up to where something keeps a shaft from coming down
_LEVEL_WAY = 0.5  # the sine of the steepest way that is level
_ROD_CLEAR_M = 0.002  # beside a rod
_FREE_M = 0.01  # behind the face that is pushed: it gives way
_BEST = 6  # one of so many places is as good as the best
_HOOK_RAYS = 120  # side by side: openings are narrow
_THIN_HOOK_M = 0.003  # half of the thickness of a hook where no rod fits
_HOOK_CLEAR_M = 0.002  # beside a hook's arm, and behind its toe
_TOES_M = (0.006, 0.03)  # how far a hook's toe reaches past an edge
_EDGE_RAYS = 2  # from a face to the opening beside it, at most
_IN_FRONT_M = 0.1  # of the bodies: what is farther away bars no way in
_PER_LENGTH = 0.5  # metres of cost for one of a hook's arm
LEVEL_M = 0.0015
"""A face is so even."""

_TOUCH_M = 0.0016  # what is so near below it is itself
_LEAST_DEPTH_M = 0.008


@dataclass(frozen=True, eq=False)
class PushPoint:
    """A point of a body that a rod can push.

    Attributes:
        point: in the world, (3,).
        half: half of the rod's width, metres.
        length: how long it must be to stay outside of what is around the point, metres.
        cost: the less, the better the bodies are pushed there.
        under: how far before the point what is high above its way begins, where no shaft comes down; -inf: nothing is.
    """

    point: Array
    half: float
    length: float
    cost: float
    under: float = -np.inf


@dataclass(frozen=True, eq=False)
class HookPoint:
    """A point on the edge of a face that a hook can pull from behind.

    Attributes:
        point: in the world, (3,).
        outward: from the face to the opening beside it, a unit vector (3,) in the frame along the pull.
        half: half of the hook's thickness, metres.
        toe: how far the hook reaches past the edge, metres.
        length: how long its arm must be to end outside of what is around the point, metres.
        cost: the less, the better the bodies are pulled there.
    """

    point: Array
    outward: Array
    half: float
    toe: float
    length: float
    cost: float


@dataclass(frozen=True, eq=False)
class LiftPoint:
    """Where two tines get under bodies along a heading.

    Attributes:
        heading: radians about z.
        rear: where the bodies begin, at the height of their underside, (3,).
        apart: how far each tine is from the line through ``rear``, metres.
        gap: the height of what is free below the underside, metres.
        depth: how far ahead of ``rear`` it is free, metres.
    """

    heading: float
    rear: Array
    apart: float
    gap: float
    depth: float

    @property
    def worth(self) -> float:
        """More for one that is high, wide apart, and far ahead."""
        ahead = min(self.depth, _MOST_WORTH_M)
        wide = min(self.apart, _WIDE_M)

        return ahead + wide + self.gap + float(self.rear[2])


def frame_along(way: Array) -> Pose:
    """Return the turn of a frame whose x points along ``way`` (3,), its y horizontal."""
    x, y, z = way / np.linalg.norm(way)
    yaw = 0.0

    if np.hypot(x, y) > 1e-6:
        yaw = np.arctan2(y, x)

    pitch = -np.arcsin(np.clip(z, -1.0, 1.0))

    return Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, pitch, yaw))


class _Rays:
    """Parallel rays through a layout, on a grid (U, V) around a subgoal's bodies.

    Attributes:
        turn: of a frame with x along the rays, and the grid along y and z.
        axes: the coordinates of rays along y, (U,), and along z, (V,).
        steps: between two rays, along y and z.
        near: where each ray enters each box of the bodies, (U, V, N); inf: it misses the box.
        far: where it leaves the box; -inf: it misses the box.
        obstacle_near: as ``near``, of all other bodies.
        obstacle_far: as ``far``, of all other bodies.
    """

    def __init__(self, subgoal: Subgoal, way: Array, most: int = _MOST_RAYS) -> None:
        """Cast rays along ``way`` (3,) on a grid that goes a little beyond the bodies.

        Args:
            subgoal: the bodies, around which the rays go.
            way: along the rays, in the world.
            most: rays side by side.
        """
        self.turn = frame_along(way)
        points = self.turn.inverse().apply(subgoal.points)
        lower = points.min(axis=0) - _AROUND_M

        upper = points.max(axis=0) + _AROUND_M
        beside = self._find_beside(subgoal.obstacles, lower, upper)

        # The more boxes, the fewer rays: all crossings are computed at once.
        boxes = len(subgoal.boxes.centers) + len(beside.centers)
        affordable = max(_MOST_RAYS, int(np.sqrt(_MOST_CROSSINGS / boxes)))
        counts = np.ceil((upper - lower)[1:] / _GRID_M).astype(int)
        counts = np.minimum(counts, min(most, affordable))

        self.axes = [
            np.linspace(lower[1], upper[1], counts[0]),
            np.linspace(lower[2], upper[2], counts[1]),
        ]

        self.steps = [(axis[1] - axis[0]) for axis in self.axes]
        self.near, self.far = self._cross(subgoal.boxes)
        self.obstacle_near, self.obstacle_far = self._cross(beside)

    def _find_beside(self, boxes: Boxes, lower: Array, upper: Array) -> Boxes:
        """Return the boxes that some ray may meet.

        Args:
            boxes: in the world.
            lower: corner (3,) of what the rays go through, in their frame.
            upper: the other corner.
        """
        near = np.ones(len(boxes.centers), dtype=bool)
        for axis in (1, 2):
            way = self.turn.rotation_matrix[:, axis]
            low, high = boxes.ranges_along(way, np.zeros(3))
            near &= (low < upper[axis]) & (high > lower[axis])

        return boxes[near]

    def starts(self) -> Array:
        """Return the origins of all rays in their frame, (U, V, 3)."""
        u, v = np.meshgrid(*self.axes, indexing="ij")
        return np.stack([np.zeros_like(u), u, v], axis=-1)

    def _cross(self, boxes: Boxes) -> tuple[Array, Array]:
        """Compute where each ray enters and leaves each box, by the slab method.

        Args:
            boxes: N boxes in the world.

        Returns:
            Depths along the rays, (U, V, N) each; inf and -inf where a ray misses a box.
        """
        back = self.turn.rotation_matrix.T
        axes = np.einsum("ij,njk->nik", back, boxes.axes)

        centers = boxes.centers @ back.T
        starts = self.starts()[:, :, None] - centers
        inside = np.einsum("nik,uvni->uvnk", axes, starts)

        # A ray's slopes are along each of a box's axes.
        return _cross_slabs(inside, axes[:, 0], boxes.halves)

    def window(self, half: float) -> tuple[int, ...]:
        """Count the rays within ``half`` metres of one, along both axes."""
        return tuple(2 * int(np.ceil(half / step)) + 1 for step in self.steps)

    def point(
        self,
        u: int,
        v: int,
        depth: float,
    ) -> Array:
        """Return a point (3,) of a ray in the world.

        Args:
            u: the ray's number along y.
            v: the ray's number along z.
            depth: the coordinate along the ray, metres.
        """
        return self.turn.apply([depth, self.axes[0][u], self.axes[1][v]])

    def cross_roofs(self, boxes: Boxes) -> tuple[Array, Array]:
        """Find where what is above all rays begins and ends, for each row of them, of N boxes that are so high.

        Args:
            boxes: in the world.

        Returns:
            Depths along the rays, (U, N) each; inf and -inf where a box is beside a row.
        """
        forward, side, up = self.turn.rotation_matrix.T
        top = self.axes[1][-1]
        low, _ = boxes.ranges_along(up, np.zeros(3))
        roofs = boxes[(low > top) & (low < top + _ROOF_M)]

        right, left = roofs.ranges_along(side, np.zeros(3))
        begin, end = roofs.ranges_along(forward, np.zeros(3))
        row = self.axes[0][:, None]
        above = (right < row + _BARRED_M) & (left > row - _BARRED_M)
        return np.where(above, begin, np.inf), np.where(above, end, -np.inf)


def _cross_slabs(inside: Array, slopes: Array, halves: Array) -> tuple[Array, Array]:
    """Compute where rays enter and leave boxes; inf and -inf where a ray misses a box.

    Args:
        inside: where each ray begins, in the frame of each box, (..., N, 3).
        slopes: of the rays along each of a box's axes, (N, 3).
        halves: half of the boxes' sides, (N, 3).

    Returns:
        Depths along the rays, (..., N) each.
    """
    slopes = np.where(np.abs(slopes) < 1e-9, 1e-9, slopes)
    low = (-halves - inside) / slopes

    high = (halves - inside) / slopes
    near = np.minimum(low, high).max(axis=-1)

    far = np.maximum(low, high).min(axis=-1)
    missed = near >= far

    return np.where(missed, np.inf, near), np.where(missed, -np.inf, far)


def find_profile(subgoal: Subgoal, line: Array) -> Array:
    """Find how high the bodies are at points (K, 3) of the ground, in the world; -inf where there is none of them.

    Args:
        subgoal: the bodies.
        line: the points, whose heights do not count.
    """
    starts = line * LEVEL + subgoal.upper[2] * UP
    return find_tops(subgoal.boxes, starts)


def cross_lines(boxes: Boxes, starts: Array, way: Array) -> tuple[Array, Array]:
    """Find where lines enter and leave boxes; inf and -inf where one misses a box.

    Args:
        boxes: N boxes in the world.
        starts: a point of each line, (K, 3).
        way: unit vector (3,) along all lines.

    Returns:
        From the points along the way, (K, N) each, metres.
    """
    inside = np.einsum("nik,vni->vnk", boxes.axes, starts[:, None] - boxes.centers)
    slopes = np.einsum("nik,i->nk", boxes.axes, way)
    return _cross_slabs(inside, slopes, boxes.halves)


def find_tops(boxes: Boxes, starts: Array) -> Array:
    """Find how high boxes are below points (K, 3), or around them, in the world; -inf where there is none.

    Args:
        boxes: in the world.
        starts: the points, from which rays go down.
    """
    inside = np.einsum("nik,vni->vnk", boxes.axes, starts[:, None] - boxes.centers)
    near, far = _cross_slabs(inside, -boxes.axes[:, 2], boxes.halves)
    near = np.where(far > 0.0, near, np.inf)
    return np.asarray(starts[:, 2] - near.min(axis=-1, initial=np.inf))


def find_thickness(boxes: Boxes, point: Array, way: Array) -> float:
    """Find how far boxes go on from a point of a face, without a gap, metres.

    Args:
        boxes: in the world.
        point: of a face that is met from behind, (3,).
        way: from there through the boxes, a unit vector (3,).
    """
    inside = np.einsum("nik,ni->nk", boxes.axes, point - boxes.centers)
    slopes = np.einsum("nik,i->nk", boxes.axes, way)
    near, far = _cross_slabs(inside, slopes, boxes.halves)

    end = LEVEL_M
    for number in np.argsort(near):
        if near[number] <= end + _TOUCH_M:
            end = max(end, float(far[number]))

    return end


def find_push_points(
    subgoal: Subgoal,
    way: Array,
    pole: Array | None = None,
    free: float = _FREE_M,
) -> list[PushPoint]:
    """Find where a rod can push the bodies, the best first.

    That is in their middle; with a ``pole`` it is where they go the farthest along the way.

    Args:
        subgoal: the bodies.
        way: along which they are pushed, (3,).
        pole: a point of an axis that they turn about, and its direction, (2, 3).
        free: how much room there must be behind the face that is pushed, metres; 0: they may stand against something.

    Returns:
        The best sixth of all points on which a rod of the stoutest width that fits gets; empty: none fits.
    """
    key = ("push", *map(id, subgoal.solids), repr((way, pole, free)))
    return subgoal.model.find_once(
        key, lambda: _find_push_points(subgoal, way, pole, free)
    )


def _find_push_points(
    subgoal: Subgoal,
    way: Array,
    pole: Array | None,
    free: float,
) -> list[PushPoint]:
    """Search for what `find_push_points` returns, from the stoutest rod to the thinnest.

    Args:
        subgoal: the bodies.
        way: along which they are pushed, (3,).
        pole: see `find_push_points`.
        free: see there.
    """
    rays = _Rays(subgoal, way)
    hit = rays.near.min(axis=-1)

    blocked = rays.obstacle_near.min(axis=-1, initial=np.inf)
    # Where obstacles begin: what begins far before, such as a table, is beside all of the way.
    begins = rays.obstacle_near
    begins = np.where(begins > hit.min() - _LONGEST_M, begins, np.inf)
    begins = begins.min(axis=-1, initial=np.inf)
    passed = minimum_filter(begins, rays.window(_BARRED_M))
    roofs = np.full(len(hit), np.inf)
    if abs(way[2]) < _LEVEL_WAY:  # the shaft comes from above
        passed = np.minimum.accumulate(passed[:, ::-1], axis=1)[:, ::-1]
        roofs, _ = rays.cross_roofs(subgoal.obstacles)
        roofs = np.where(roofs > hit.min() - _LONGEST_M, roofs, np.inf)
        roofs = roofs.min(axis=-1, initial=np.inf)
        passed = np.minimum(passed, roofs[:, None])

    for half in _HALF_M:
        beside = rays.window(half + _ROD_CLEAR_M)
        fits = minimum_filter(blocked, beside) > hit + free

        points = []
        for u, v in np.argwhere(np.isfinite(hit) & fits).tolist():
            point = rays.point(u, v, hit[u, v])
            length = np.clip(hit[u, v] - passed[u, v], 0.0, _LONGEST_M)

            cost = _cost_of_point(point, subgoal, way, pole)
            under = hit[u, v] - roofs[u]
            points.append(PushPoint(point, half, length, cost, under))

        if points:
            points.sort(key=lambda point: point.cost)
            return points[: max(1, len(points) // _BEST)]

    return []


def _cost_of_point(
    point: Array, subgoal: Subgoal, way: Array, pole: Array | None
) -> float:
    """Compute how far a point (3,) is beside the bodies' centre; with a pole, how little they move along the way there.

    Args:
        point: where the bodies are met.
        subgoal: the bodies.
        way: along which they are moved, (3,).
        pole: see `find_push_points`.
    """
    if pole is None:
        return float(np.linalg.norm(np.cross(way, point - subgoal.center)))

    return float(-np.cross(pole[1], point - pole[0]) @ way)


def find_hook_points(
    subgoal: Subgoal,
    way: Array,
    pole: Array | None = None,
) -> list[HookPoint]:
    """Find where a hook that comes in against the way can pull the bodies along it, the best first.

    Args:
        subgoal: the bodies.
        way: along which they are pulled, (3,).
        pole: see `find_push_points`.

    Returns:
        The best sixth of all points, for the stoutest hook that fits; empty: none fits.
    """
    key = ("hook", *map(id, subgoal.solids), repr((way, pole)))
    return subgoal.model.find_once(key, lambda: _find_hook_points(subgoal, way, pole))


def _find_hook_points(
    subgoal: Subgoal,
    way: Array,
    pole: Array | None,
) -> list[HookPoint]:
    """Search for what `find_hook_points` returns, from the stoutest hook to the thinnest.

    Args:
        subgoal: the bodies.
        way: along which they are pulled, (3,).
        pole: see `find_push_points`.
    """
    edges = _Edges(subgoal, way)
    tips = pole is None and way[2] > _LEVEL_WAY  # what is lifted from below its middle

    for half in (*_HALF_M, _THIN_HOOK_M):
        points = []
        for point, outward, toe, length in edges.find(half):
            if tips and point[2] < subgoal.center[2]:
                continue

            cost = _cost_of_point(point, subgoal, way, pole) + _PER_LENGTH * length
            points.append(HookPoint(point, outward, half, toe, length, cost))

        if points:
            points.sort(key=lambda point: point.cost)
            return points[: max(1, len(points) // _BEST)]

    return []


class _Edges:
    """Edges of faces that a hook can get behind, as rays find them that go along the pull."""

    def __init__(self, subgoal: Subgoal, way: Array) -> None:
        """Cast rays along ``way`` (3,) through a subgoal's bodies.

        Args:
            subgoal: the bodies.
            way: along which they are pulled.
        """
        self._rays = _Rays(subgoal, way, _HOOK_RAYS)
        rays = self._rays
        self._near = np.concatenate([rays.near, rays.obstacle_near], axis=-1)
        self._far = np.concatenate([rays.far, rays.obstacle_far], axis=-1)

        # What is far in front of the bodies does not count.
        self._front = rays.far.max() + _IN_FRONT_M
        ends = np.where(self._near < self._front, self._far, -np.inf).max(axis=-1)
        self._ends = maximum_filter(ends, rays.window(_BARRED_M))
        if abs(way[2]) < _LEVEL_WAY:
            begins, roofs = rays.cross_roofs(subgoal.obstacles)
            roofs = np.where(begins < self._front, roofs, -np.inf)
            roofs = roofs.max(axis=-1, initial=-np.inf)
            self._ends = np.maximum(self._ends, roofs[:, None])

    def find(self, half: float) -> Iterator[tuple[Array, Array, float, float]]:
        """Yield a point of each edge, the way (3,) outward, how far a toe reaches, and how long the arm must be.

        Args:
            half: half of the hook's thickness, metres.
        """
        near = self._rays.near
        levels = np.unique(near[np.isfinite(near)].round(3))

        for level in levels[:: max(1, len(levels) // _MOST_LEVELS)].tolist():
            rear = level - 2 * (half + _HOOK_CLEAR_M)
            behind = (self._near < level - _TOUCH_M) & (self._far > rear)
            rooms = ~behind.any(axis=-1)
            faces = rooms & (np.abs(near - level).min(axis=-1) < LEVEL_M)
            barred = (self._near < self._front) & (self._far > rear)
            openings = ~barred.any(axis=-1)

            if faces.any() and openings.any():
                for axis in (0, 1):
                    for sign in (1, -1):
                        yield from self._find_along(
                            (faces, rooms, openings), level, half, axis, sign
                        )

    def _find_along(
        self,
        masks: tuple[Mask, Mask, Mask],
        level: float,
        half: float,
        axis: int,
        sign: int,
    ) -> Iterator[tuple[Array, Array, float, float]]:
        """Yield the edges of faces that have an opening beside them on one side.

        Args:
            masks: (U, V) each, the rays that meet a face with room behind it, those with such room at its level, and
                those on which nothing bars the way in.
            level: of the faces along the rays, metres.
            half: see `find`.
            axis: of the grid, along which the opening is beside the face.
            sign: on which side of it.
        """
        rays = self._rays
        window = [1, 1]
        window[1 - axis] = rays.window(half + _HOOK_CLEAR_M)[1 - axis]
        wide, behind, free = (minimum_filter(mask, window) for mask in masks)

        step = rays.steps[axis]
        covered = step * _count_run(behind, axis, -sign)
        room = step * _count_run(free, axis, sign) - 2 * (half + _HOOK_CLEAR_M)
        least, most = _TOES_M

        for u, v in np.argwhere(wide & (covered >= least)).tolist():
            place = np.array([u, v])
            for count in range(1, _EDGE_RAYS + 1):
                place[axis] += sign
                if not 0 <= place[axis] < free.shape[axis]:
                    break
                if not free[tuple(place)]:
                    continue

                toe = min(covered[u, v], room[tuple(place)], most)
                length = self._ends[tuple(place)] - level
                if toe >= least and length <= _LONGEST_M:
                    outward = np.zeros(3)
                    outward[1 + axis] = sign
                    edge = rays.point(u, v, level)
                    edge = edge + rays.turn.apply(outward) * step * count / 2
                    yield edge, outward, float(toe), max(0.0, float(length))

                break


def _count_run(mask: Mask, axis: int, sign: int) -> Array:
    """Count how many rays in a row are set from each one on, itself included, (U, V).

    Args:
        mask: of rays, (U, V).
        axis: of the grid, along which they are counted.
        sign: in which direction.
    """
    lines = np.moveaxis(mask, axis, 0)[::-sign]
    runs = np.zeros(lines.shape)
    run = np.zeros(lines.shape[1:])

    for number, line in enumerate(lines):
        run = np.where(line, run + 1, 0)
        runs[number] = run

    return np.moveaxis(runs[::-sign], 0, axis)


def find_lift_point(
    subgoal: Subgoal,
    heading: float,
    tine: float,
    uneven: float = LEVEL_M,
    shortest: float = _LEAST_DEPTH_M,
) -> LiftPoint | None:
    """Find where tines ``tine`` metres wide get under the bodies along a heading; None: nowhere.

    Args:
        subgoal: the bodies.
        heading: along which the tines go, radians about z.
        tine: the width of each, metres.
        uneven: how much higher the underside may be than where it is lowest above a tine, metres.
        shortest: how far ahead it is free, at least, metres.
    """
    key = ("lift", *map(id, subgoal.solids), heading, tine, uneven, shortest)
    return subgoal.model.find_once(
        key, lambda: _Underside(subgoal, heading).find(tine, uneven, shortest)
    )


class _Underside:
    """Where bodies are open from below, as rays find it that go up.

    Attributes:
        along: the coordinate of each ray along the heading, from the bodies' centre, (U, V).
        across: the distance of each ray from the line along the heading through the centre, (U, V).
    """

    def __init__(self, subgoal: Subgoal, heading: float) -> None:
        """Cast rays upward through a subgoal's bodies, and lay them out along a heading, radians about z.

        Args:
            subgoal: the bodies.
            heading: along which the tines go.
        """
        self._center = subgoal.center
        self._heading = heading
        self._ahead, side = (axis[:2] for axis in heading_axes(heading))

        key = ("up", *map(id, subgoal.solids))
        self._rays = subgoal.model.find_once(key, lambda: _Rays(subgoal, UP))
        rays = self._rays
        self._near = np.concatenate([rays.near, rays.obstacle_near], axis=-1)
        self._far = np.concatenate([rays.far, rays.obstacle_far], axis=-1)

        places = rays.turn.apply(rays.starts())[..., :2] - self._center[:2]
        self.along = places @ self._ahead
        self.across = np.abs(places @ side)

    def find(self, tine: float, uneven: float, shortest: float) -> LiftPoint | None:
        """Find the best place for tines of this width; None: there is none. See `find_lift_point`.

        It looks at some heights of undersides, from the highest down, at gaps below each, and at pairs of lanes beside
        the middle.
        """
        near = self._rays.near
        levels = np.unique(near[np.isfinite(near)].round(3))
        step = 2 * min(self._rays.steps)

        found: list[LiftPoint] = []

        for level in levels[:: -max(1, len(levels) // _MOST_LEVELS)]:
            above = (near > level - LEVEL_M) & (near < level + uneven)
            underside = above.any(axis=-1)
            widest = self.across[underside].max(initial=0.0)

            for gap in _GAPS_M:
                full = (self._near < level - _TOUCH_M) & (self._far > level - gap)
                filled = full.any(axis=-1)

                for apart in np.arange(0.0, widest + 1e-9, step):
                    half = tine / 2 + step / 2
                    lane = np.abs(self.across - apart) < half
                    ends = self._find_ends(lane & underside, lane & filled)
                    if ends is None:
                        continue

                    rear, front = ends
                    depth = front - rear
                    if depth <= shortest:
                        continue

                    place = np.array([*(self._center[:2] + rear * self._ahead), level])
                    found.append(
                        LiftPoint(self._heading, place, float(apart), gap, depth)
                    )

        return max(found, key=lambda point: point.worth, default=None)

    def _find_ends(self, underside: Mask, filled: Mask) -> tuple[float, float] | None:
        """Find where a gap begins and ends along the heading; None: there is none.

        Args:
            underside: the rays that meet the underside above the gap, (U, V).
            filled: the rays on which something is in the gap, (U, V).
        """
        if not underside.any():
            return None

        rear = self.along[underside].min()
        stops = self.along[filled & (self.along > rear - _AROUND_M)]
        stop = stops.min(initial=1.0)
        ahead = self.along[underside & (self.along < stop)]
        front = ahead.max(initial=rear)

        if stop > rear:
            return rear, front

        return None
