"""Find the hollow of a body by its parts, and measure how deep in it a point is."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import ConvexHull

from core.design import Fixture
from core.geometry import Array, Pose, Shape
from core.goals import EMPTY, Space
from core.scene import FIXTURE, Body, Geom
from core.solids.standing import bound

_CELLS = 16_000  # of the grid that a body is looked at by
_LEAST = 8  # cells along a side
_WAYS = 8  # directions in which a wall must stand
_PART = 0.2  # of the largest hollow: smaller ones, such as a handle's, are none
_STEP_M = 0.001  # of the way down to where a body rests
_FLAT_M = 0.002  # a mark that is not higher is flat

COLUMN_M = 0.1
"""How high above a flat mark is still inside it, where nothing else is said."""

_AROUND = 2  # cells beside the body, where there is a way around it

# Half of the 26 neighbours of a cell: the others are the same ways back.
_STEPS = tuple(
    step for step in itertools.product((-1, 0, 1), repeat=3) if step > (0, 0, 0)
)

Flags = npt.NDArray[np.bool_]
Counts = npt.NDArray[np.int64]
Planes = tuple[Array, Array]


@dataclass(frozen=True, eq=False)
class Hollow(Space):
    """A space in a body's frame, as a grid of how far from its boundary each point is.

    Outside, it is how long the way in is: around the body's walls, and through the opening.

    Attributes:
        low: (3,) the grid's first point, m.
        step: (3,) between its points, m.
        rooms: (X, Y, Z) m, below 0 outside.
    """

    low: Array
    step: Array
    rooms: Array

    def room(self, points: Array) -> Array:
        most = np.array(self.rooms.shape) - 1.0
        cells = (points - self.low) / self.step
        within = np.clip(cells, 0.0, most)
        beyond = np.linalg.norm((cells - within) * self.step, axis=-1)

        flat = within.reshape(-1, 3).T
        found = ndimage.map_coordinates(self.rooms, flat, order=1, mode="nearest")
        room: Array = found.reshape(beyond.shape) - beyond
        return room

    @property
    def middle(self) -> Array:
        """Its point (3,) that is farthest from its boundary; of several the lowest in the middle."""
        deepest = np.argwhere(self.rooms > self.rooms.max() - self.step.min() / 2)
        lowest = deepest[deepest[:, 2] == deepest[:, 2].min()]
        return np.asarray(self.low + self.step * lowest.mean(axis=0))

    def rest(self, down: Array, foot: float) -> Array:
        length = float(np.linalg.norm(down))
        if length < 1e-9:
            return self.middle

        longest = float(np.linalg.norm(self.step * self.rooms.shape))
        ways = np.arange(0.0, longest, _STEP_M)
        points = self.middle + ways[:, None] * down / length
        outside = self.room(points) <= 0
        ground = float(ways[outside.argmax()]) if outside.any() else 0.0
        # A body that is taller than the room below the middle stands up into it.
        return np.asarray(self.middle + (ground - foot) * down / length)


@dataclass(frozen=True, eq=False)
class FixtureHollow(Space):
    """The hollow of whatever fixture a design adds; ``around`` are the bodies that may close it."""

    around: tuple[Body, ...]

    def within(self, fixture: Fixture | None) -> Space | None:
        if fixture is None:
            return EMPTY

        return find_fixture_hollow(fixture, self.around)


@lru_cache(maxsize=64)  # the candidates of a chunk share their fixture
def find_fixture_hollow(fixture: Fixture, around: tuple[Body, ...]) -> Hollow | None:
    """Find the hollow of a design's fixture, in its frame; see `find_hollow`."""
    parts = tuple(Geom(part.shape, part.pose) for part in fixture.parts.parts)
    return find_hollow(Body(FIXTURE, fixture.pose, 0.0, (), parts), around)


def find_hollow(body: Body, around: Sequence[Body] = ()) -> Hollow | None:
    """Find where walls of a body stand all around, and nothing else is; None: nowhere.

    It may be open toward one side, as a cup, a niche and a tube are; a channel is no hollow.

    Args:
        body: with its collision parts.
        around: what is a wall, too, where it is fixed: the table closes a goal that stands on it.
    """
    parts = [_planes(part.shape, part.pose) for part in body.collisions]
    for other in around:
        if other.fixed and other.name != body.name:
            frame = body.pose.inverse() @ other.pose
            parts += [_planes(p.shape, frame @ p.pose) for p in other.collisions]

    low, high = bound(replace(body, pose=Pose()))
    sides = high - low

    cell = (np.prod(sides) / _CELLS) ** (1 / 3)
    counts = np.maximum(np.ceil(sides / cell), _LEAST).astype(int)
    step = sides / counts
    first = low + step / 2
    points = _make_grid(first, step, counts)

    for opening in (2, 0, 1):
        enclosed = _find_enclosed(points.reshape(-1, 3), parts, opening)
        spaces = _largest(enclosed.reshape(counts))
        if spaces.any():
            padded = np.pad(spaces, _AROUND)
            first = first - _AROUND * step
            cells = _make_grid(first, step, counts + 2 * _AROUND)
            blocked = _find_blocked(cells, parts, step)
            rooms = _measure_rooms(padded, blocked, step)
            return Hollow(first, step, rooms)

    return None


def _make_grid(first: Array, step: Array, counts: Counts) -> Array:
    """Return the points (X, Y, Z, 3) of a grid."""
    return first + step * np.moveaxis(np.indices(counts.tolist()), 0, -1)


def space_of(mark: Body, height: float) -> Hollow:
    """Return the space that a mark's shape takes up; above a flat one, what is over it by up to ``height``, m."""
    (drawn,) = mark.visuals
    normals, offsets = _planes(drawn.shape, drawn.pose)
    middle, sides = drawn.shape.bounds
    low = middle - sides / 2
    high = middle + sides / 2
    if sides[2] < _FLAT_M:
        upward = np.array([0.0, 0.0, height])
        offsets = offsets + np.maximum(normals @ upward, 0.0)
        high = high + upward

    around = (high - low) / 4
    axes = np.linspace(low - around, high + around, 25)
    points = np.stack(np.meshgrid(*axes.T, indexing="ij"), axis=-1)
    rooms = (offsets - points @ normals.T).min(axis=-1)
    return Hollow(axes[0], axes[1] - axes[0], rooms)


def _planes(shape: Shape, pose: Pose) -> Planes:
    """Return the planes around a convex shape: outward normals (F, 3), and how far along them each is (F,)."""
    hull = ConvexHull(pose.apply(shape.to_trimesh().vertices))
    planes = np.unique(hull.equations.round(9), axis=0)
    return planes[:, :3], -planes[:, 3]


def _find_enclosed(points: Array, parts: Sequence[Planes], opening: int) -> Flags:
    """Report which points (N, 3) are in no part, and have walls in all directions across the axis ``opening``."""
    angles = np.arange(_WAYS) * 2 * np.pi / _WAYS
    ways = np.zeros((_WAYS, 3))
    ways[:, (opening + 1) % 3] = np.cos(angles)
    ways[:, (opening + 2) % 3] = np.sin(angles)

    solid = np.zeros(len(points), dtype=bool)
    walled = np.zeros((_WAYS, len(points)), dtype=bool)
    for normals, offsets in parts:
        gaps = offsets - points @ normals.T
        solid |= (gaps >= 0).all(axis=1)
        for number, way in enumerate(ways):
            walled[number] |= _meets(gaps, normals @ way)

    enclosed: Flags = walled.all(axis=0) & ~solid
    return enclosed


def _meets(gaps: Array, speeds: Array) -> Flags:
    """Report which rays meet a convex part.

    Args:
        gaps: (N, F) how far within each plane they begin.
        speeds: (F,) how fast they leave through each plane.
    """
    along = np.abs(speeds) < 1e-9
    leaving = speeds > 0
    entering = ~along & ~leaving
    times = gaps / np.where(along, 1.0, speeds)
    out = times[:, leaving & ~along].min(axis=1, initial=np.inf)
    into = times[:, entering].max(axis=1, initial=0.0)
    beside = (gaps[:, along] < 0).any(axis=1)
    met: Flags = (into <= out) & (out > 0) & ~beside
    return met


def _largest(enclosed: Flags) -> Flags:
    """Keep the spaces that are not much smaller than the largest."""
    labels, count = ndimage.label(enclosed)
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    sizes[0] = 0
    kept = (sizes > 0) & (sizes >= _PART * sizes.max())
    spaces: Flags = kept[labels]
    return spaces


def _find_blocked(cells: Array, parts: Sequence[Planes], step: Array) -> Flags:
    """Report which cells (X, Y, Z), by their middles (X, Y, Z, 3), parts reach into: a thin wall leaves no gap."""
    blocked = np.zeros(cells.shape[:-1], dtype=bool)
    for normals, offsets in parts:
        reaches = offsets + np.abs(normals) @ step / 2
        blocked |= (cells @ normals.T < reaches).all(axis=-1)

    return blocked


def _measure_rooms(space: Flags, blocked: Flags, step: Array) -> Array:
    """Measure how far each point of a grid is from the boundary of a space; below 0: how long the way in is.

    Args:
        space: (X, Y, Z) the points in it.
        blocked: (X, Y, Z) those through which no way leads.
        step: (3,) between points, m.
    """
    inside = ndimage.distance_transform_edt(space, sampling=step)
    half = step.min() / 2
    ways = _measure_ways(space, blocked, step)
    return np.asarray(np.where(space, inside - half, half - ways))


def _measure_ways(space: Flags, blocked: Flags, step: Array) -> Array:
    """Measure how far it is from each point of a grid into a space, m, (X, Y, Z); for arguments see `_measure_rooms`.

    Ways go from a point to one of its 26 neighbours, and so are at most a tenth too long. What no way leads from counts
    as the nearest point that has one.
    """
    numbers = np.arange(space.size, dtype=np.int64).reshape(space.shape)
    starts = list[Counts]()
    ends = list[Counts]()
    lengths = list[Array]()

    for way in _STEPS:
        near = tuple(slice(max(0, -by), min(0, -by) or None) for by in way)
        far = tuple(slice(max(0, by), min(0, by) or None) for by in way)
        free = ~(blocked[near] | blocked[far])
        starts.append(numbers[near][free])
        ends.append(numbers[far][free])
        length = float(np.linalg.norm(np.multiply(way, step)))
        lengths.append(np.full(free.sum(), length))

    pairs = (np.concatenate(starts), np.concatenate(ends))
    graph = coo_array((np.concatenate(lengths), pairs), shape=(space.size, space.size))
    found = dijkstra(
        graph.tocsr(), directed=False, indices=numbers[space], min_only=True
    )

    ways: Array = found.reshape(space.shape)
    off, nearest = ndimage.distance_transform_edt(
        np.isinf(ways), sampling=step, return_indices=True
    )
    return np.asarray(ways[tuple(nearest)] + off)
