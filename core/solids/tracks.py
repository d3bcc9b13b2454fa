"""Follow the solids of a rollout over time.

`follow` places all solids at all samples at once, as `Rows`; a `Track` is one of them, and a `Pair` measures two.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import coal
import numpy as np
import numpy.typing as npt
import pinocchio as pin
from scipy.spatial.transform import Rotation

from core.design import Tool
from core.geometry import Array
from core.interfaces import Recording
from core.robot.kinematics import place, robot_model, rotate
from core.robot.solids import WORLD, Solid
from core.scene import Scene, State
from core.solids.bodies import Solids, all_solids, scene_solids
from core.values.robots import Robot

SAMPLE_HZ = 25.0
_REQUEST = coal.DistanceRequest()

Indices = npt.NDArray[np.intp]


class Detour(NamedTuple):
    """How far things get from the straight way between two samples, metres and radians: each (N, T).

    First comes the robot, then each free body.
    """

    moved: Array
    turned: Array


class Rows(NamedTuple):
    """Solids at samples, one after the other: R rows in all. Those of a single solid are its T samples.

    Attributes:
        rotations: (R, 3, 3), with ``positions`` (R, 3) the solid's frame. That of a ball does not turn.
        middles: (R, 3) the middle of the bounding box along the solid's own axes.
        low: (R, 3), with ``high`` the bounding box at the sample and on the way to the next. Along an axis, rows lie
            one after another in memory.
        aside: (R,) how far it gets from the straight way to the next sample, metres, at most.
        ways: (R,) how far any of its points moves until the next sample, metres, at most; the last is 0.
        turned: (R,) the angle to the next sample, radians; the last is 0.
    """

    rotations: Array
    positions: Array
    middles: Array
    low: Array
    high: Array
    aside: Array
    ways: Array
    turned: Array


class Track:
    """A convex solid at T samples; one that never moves has T = 1.

    Attributes:
        rotations: (T, 3, 3), with ``positions`` (T, 3) and ``middles`` (T, 3), see `Rows`.
        box: half of the bounding box's extents along its own axes, (3,), metres.
        rows: all that is known of it.
    """

    def __init__(self, solid: Solid, box: Array, rows: Rows) -> None:
        self.name = solid.name
        self.owner = solid.owner
        self.shape = solid.shape
        self.geometry = solid.geometry
        self.box = box
        self.rotations = rows.rotations
        self.positions = rows.positions
        self.middles = rows.middles
        self.rows = rows
        self._places: dict[int, tuple[Any, Array]] = {}  # by sample

    @cached_property
    def travel(self) -> Array:
        """An upper bound (T,) of how far any point has moved since the first sample, metres."""
        return np.append(0.0, np.cumsum(self.rows.ways[:-1]))

    def at(self, k: int, share: float) -> tuple[Any, Array]:
        """Coal's transform and the rotation (3, 3), a ``share`` (0..1) of the way from sample ``k`` to the next."""
        if len(self.positions) == 1:
            k = 0
            share = 0.0

        if share > 0:
            begin = self.positions[k]
            turn = pin.log3(self.rotations[k].T.dot(self.rotations[k + 1]))
            rotation = self.rotations[k].dot(pin.exp3(share * turn))
            position = begin + share * (self.positions[k + 1] - begin)
            return coal.Transform3s(rotation, position), rotation

        if k not in self._places:
            rotation = self.rotations[k]
            self._places[k] = coal.Transform3s(rotation, self.positions[k]), rotation
        return self._places[k]


class Look(NamedTuple):
    """What is measured of two solids at an instant.

    Attributes:
        depth: how deep the first is in the second, metres; negative if they are apart.
        rotation: (3, 3) that of the first; ``others_rotation`` is that of the second.
        result: Coal's.
    """

    depth: float
    rotation: Array
    others_rotation: Array
    result: Any

    @property
    def out(self) -> Array:
        """The direction (3,) in the world of the shortest way out of the second for the first."""
        direction: Array = self.result.normal
        return direction

    @property
    def nearest(self) -> Array:
        """The point (3,) of the first that is nearest to the second."""
        return np.array(self.result.getNearestPoint2())


class Pair:
    """Two solids over time: how deep the first is in the second, and how far apart they are.

    Attributes:
        travel: (T,) how far the two have moved since the first sample, metres, at most.
    """

    def __init__(self, first: Track, second: Track) -> None:
        self.first = first
        self.second = second
        self.travel = first.travel + second.travel
        self._measure = coal.ComputeDistance(second.geometry, first.geometry)

    def look(self, k: int, share: float = 0.0) -> Look:
        """Measure the two at an instant (see `Track.at`)."""
        here, rotation = self.first.at(k, share)
        there, others_rotation = self.second.at(k, share)
        result = coal.DistanceResult()
        gap = float(self._measure(there, here, _REQUEST, result))
        return Look(-gap, rotation, others_rotation, result)

    def gaps(self, samples: Indices) -> Array:
        """Measure the gaps (N,) at N samples, metres, negative if the two overlap; once while they rest."""
        _, firsts, numbers = np.unique(
            self.travel[samples], return_index=True, return_inverse=True
        )
        gaps = np.array([-self.look(k).depth for k in samples[firsts].tolist()])
        return gaps[numbers]


class Tracks:
    """The solids of a rollout at some samples: the `Track` of each, and the ``rows`` of all.

    At sample k solid i is in row ``first[i] + moves[i] * k``. Those that move come first.

    Attributes:
        items: the tracks, as the ``solids`` are numbered.
        moving: the numbers of the M solids that move.
        moves: (N,) 1 for these, 0 for the others.
        times: (T,) of the samples, seconds.
    """

    def __init__(
        self, solids: Solids, moving: Indices, moved: Rows, times: Array
    ) -> None:
        resting, rest = _rest(solids)
        samples = len(times)
        self.solids = solids
        self.moving = moving
        self.times = times
        self.samples = samples
        self.rows = Rows(*map(np.concatenate, zip(moved, rest, strict=True)))
        count = len(solids.items)
        self.first = np.full(count, len(self.rows.aside))
        self.first[moving] = samples * np.arange(len(moving))
        self.first[resting] = samples * len(moving) + np.arange(len(resting))
        self.moves = np.zeros(count, dtype=np.intp)
        self.moves[moving] = 1
        self.items = [self._pick(number) for number in range(count)]

    def _pick(self, number: int) -> Track:
        """Pick a solid's rows."""
        begin = self.first[number]
        end = begin + 1 + self.moves[number] * (self.samples - 1)
        rows = Rows(*(values[begin:end] for values in self.rows))
        return Track(self.solids.items[number], self.solids.halves[number], rows)

    def row(self, numbers: Indices, samples: Indices) -> Indices:
        """The rows of solids at samples."""
        rows: Indices = self.first[numbers] + self.moves[numbers] * samples
        return rows

    def ends(self, numbers: Indices, intervals: Indices) -> Indices:
        """The rows (2, N) of N solids where an interval begins, and where it ends."""
        return self.row(numbers, intervals + np.array([[0], [1]]))

    def by_sample(self, values: Array) -> Array:
        """Those of the rows' values (R, ...) that are of the solids that move: (M, T, ...)."""
        count = len(self.moving)
        moved = values[: count * self.samples]
        return moved.reshape(count, self.samples, *values.shape[1:])


def lengths(vectors: Array) -> Array:
    """Compute the lengths (...) of vectors (..., N)."""
    squares: Array = np.einsum("...i,...i->...", vectors, vectors)
    return np.sqrt(squares)


def angles(rotations: Array, after: Array) -> Array:
    """Compute the angles (...), radians, from rotations (..., 3, 3) to others."""
    chords = lengths((after - rotations).reshape(*rotations.shape[:-2], 9))
    turned: Array = 2 * np.arcsin(np.minimum(chords / math.sqrt(8), 1.0))
    return turned


def bound_speed(tracks: Sequence[Track], times: Array, count: int = 1) -> float:
    """Bound the speed of any point of solids, m/s, averaged over ``count`` of the intervals between ``times`` (T,)."""
    ways = [track.travel for track in tracks]
    travel = np.reshape(ways, (-1, len(times)))
    moved = travel[:, count:] - travel[:, :-count]
    speeds = moved / (times[count:] - times[:-count])
    return float(speeds.max(initial=0.0))


def follow(
    scene: Scene,
    robot: Robot,
    tool: Tool,
    recording: Recording,
    detour: Detour | None = None,
    only: Indices | None = None,
) -> Tracks:
    """Follow the robot's links that move, the tool's components, and behind them the collision shapes of all bodies.

    A ``detour`` widens their bounding boxes. Of the solids that move, ``only`` those with these numbers are followed.
    """
    solids = all_solids(robot, tool, scene_solids(scene))
    model = robot_model(robot, tool)
    joints = model.order(recording.arm, recording.fingers)
    rotations, positions = model.place_joints(joints)
    turns, shifts = _body_frames(recording.states)
    moving = solids.moving
    if only is not None:
        moving = np.intersect1d(moving, only)
    aside = np.zeros((len(moving), len(recording.times)))
    if detour is not None:
        number = np.maximum(solids.frames[moving] + 1 - len(rotations), 0)
        turning = np.where(number == 0, model.reach, 0.0)  # about the joints before
        far = solids.far[moving] + turning
        aside += detour.moved[number] + far[:, None] * detour.turned[number]

    frames = (np.concatenate([rotations, turns]), np.concatenate([positions, shifts]))
    rows = _rows(solids, moving, *frames, aside)
    return Tracks(solids, moving, rows, recording.times)


def _body_frames(states: State) -> tuple[Array, Array]:
    """The frames of the free bodies: (B, T, 3, 3) and (B, T, 3)."""
    quaternions = states.quaternions.swapaxes(0, 1)
    turns = Rotation.from_quat(quaternions.reshape(-1, 4), scalar_first=True)
    rotations = turns.as_matrix().reshape(*quaternions.shape[:2], 3, 3)
    return rotations, states.positions.swapaxes(0, 1)


@lru_cache(maxsize=8)
def _rest(solids: Solids) -> tuple[Indices, Rows]:
    """The numbers of the solids that never move, and their rows."""
    numbers = np.flatnonzero(solids.frames == WORLD)
    straight = np.zeros((len(numbers), 1))
    rotations = np.eye(3)[None, None]
    positions = np.zeros((1, 1, 3))
    return numbers, _rows(solids, numbers, rotations, positions, straight)


def _rows(
    solids: Solids, numbers: Indices, rotations: Array, positions: Array, aside: Array
) -> Rows:
    """Place solids with these numbers in frames with rotations (F, T, 3, 3) and positions (F, T, 3).

    They get up to ``aside`` (N, T) from the straight way, by which their bounding boxes are wider.
    """
    frames = solids.frames[numbers]
    rotations, positions = place(
        rotations[frames],
        positions[frames],
        solids.rotations[numbers],
        solids.positions[numbers],
    )
    rotations[solids.radii[numbers] < np.inf] = np.eye(3)
    middles = positions + rotate(rotations, solids.middles[numbers])
    extents = rotate(np.abs(rotations), solids.halves[numbers])

    # By axis (3, N, T): numpy reduces along contiguous instants fifty times as fast.
    low = (middles - extents).transpose(2, 0, 1).copy()
    high = (middles + extents).transpose(2, 0, 1).copy()
    np.minimum(low[..., :-1], low[..., 1:], out=low[..., :-1])
    np.maximum(high[..., :-1], high[..., 1:], out=high[..., :-1])
    low -= aside
    high += aside

    turned = np.zeros_like(aside)
    turned[:, :-1] = angles(rotations[:, :-1], rotations[:, 1:])
    ways = solids.reaches[numbers, None] * turned
    ways[:, :-1] += lengths(positions[:, 1:] - positions[:, :-1])
    return Rows(
        rotations.reshape(-1, 3, 3),
        positions.reshape(-1, 3),
        middles.reshape(-1, 3),
        low.reshape(3, -1).T,
        high.reshape(3, -1).T,
        aside.ravel(),
        ways.ravel(),
        turned.ravel(),
    )
