"""Follow the solids of a rollout over time."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property, lru_cache
from typing import Any, NamedTuple, cast

import coal
import numpy as np
import numpy.typing as npt
import pinocchio as pin
from scipy.spatial.transform import Rotation

from core.design import Tool
from core.geometry import Array
from core.interfaces import Recording
from core.robot.kinematics import joint_frames, joint_values, place, robot_model, rotate
from core.robot.solids import WORLD
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
    """Solids at samples, one after the other: R rows in all. Those of a single solid are its T samples."""

    rotations: Array  # (R, 3, 3), with ``positions`` (R, 3) the solid's frame. That of a ball does not turn
    positions: Array
    middles: Array  # (R, 3) the middle of the bounding box along the solid's own axes
    low: Array  # (3, R), with ``high`` the bounding box at the sample and on the way to the next
    high: Array
    aside: Array  # (R,) how far it gets from the straight way to the next sample, metres, at most
    moved: Array  # (R,) the length of the way to the next sample, metres; the last is 0
    turned: Array  # (R,) the angle to the next sample, radians; the last is 0


_AXES = (0, 0, 0, 1, 1, 0, 0, 0)  # along which the rows are in each of them


class Track:
    """A convex solid at T samples; one that never moves has T = 1.

    Attributes:
        rotations, positions, middles, aside, moved, turned: its `Rows`.
        low: (T, 3), with ``high`` the bounding boxes.
        reach: how far from the frame's origin rotation moves a point, metres.
        half_width: half of the thickness, metres (`thickness`).
        box: half of the bounding box's extents along its own axes, (3,), metres.
    """

    def __init__(self, solids: Solids, number: int, rows: Rows) -> None:
        solid = solids.items[number]
        self.name, self.owner, self.shape, self.geometry = (
            solid.name,
            solid.owner,
            solid.shape,
            solid.geometry,
        )
        (
            self.rotations,
            self.positions,
            self.middles,
            low,
            high,
            self.aside,
            self.moved,
            self.turned,
        ) = rows
        self.low, self.high = low.T, high.T
        self.reach, self.half_width = (
            float(solids.reaches[number]),
            float(solids.widths[number]),
        )
        self.box = solids.halves[number]
        self._transforms: dict[
            int, tuple[Any, Array]
        ] = {}  # results of `at`, by sample

    @cached_property
    def travel(self) -> Array:
        """An upper bound (T,) of how far any point has moved since the first sample, metres."""
        return np.concatenate(
            [[0.0], np.cumsum((self.moved + self.reach * self.turned)[:-1])]
        )

    @cached_property
    def since(self) -> list[int]:
        """For each sample the first one, of those in a row before it, that has exactly its pose; T numbers."""
        still = (self.rotations[1:] == self.rotations[:-1]).all(axis=(1, 2))
        still &= (self.positions[1:] == self.positions[:-1]).all(axis=1)
        begins = np.where(np.append(False, still), 0, np.arange(len(self.positions)))
        return cast("list[int]", np.maximum.accumulate(begins).tolist())

    def at(self, k: int, share: float) -> tuple[Any, Array]:
        """Coal's transform and the rotation (3, 3), a ``share`` (0..1) of the way from sample ``k`` to the next."""
        if len(self.positions) == 1:
            k, share = 0, 0.0
        if share == 0 and k in self._transforms:
            return self._transforms[k]
        rotation, position = self.rotations[k], self.positions[k]
        if share > 0:
            position = position + share * (self.positions[k + 1] - position)
            rotation = rotation.dot(
                pin.exp3(share * pin.log3(rotation.T.dot(self.rotations[k + 1])))
            )
            return coal.Transform3s(rotation, position), rotation
        self._transforms[k] = coal.Transform3s(rotation, position), rotation
        return self._transforms[k]


class Pair:
    """Two solids over time: how deep the first is in the second, and how far apart they are."""

    def __init__(self, one: Track, other: Track) -> None:
        self.one, self.other = one, other
        self._measure = coal.ComputeDistance(other.geometry, one.geometry)
        self._gaps: dict[tuple[int, int], float] = {}

    def query(self, k: int, share: float) -> tuple[float, Array, Array, Array]:
        """Find at an instant (see `Track.at`) the penetration depth, the way out for the first, and both rotations.

        The depth is in metres, and negative if the two are apart.
        """
        here, rotation = self.one.at(k, share)
        there, others_rotation = self.other.at(k, share)
        result = coal.DistanceResult()
        depth = -float(self._measure(there, here, _REQUEST, result))
        return depth, result.normal, rotation, others_rotation

    def gap(self, k: int) -> float:
        """Measure the gap at a sample, metres, negative if they overlap."""
        k, j = (
            track.since[min(k, len(track.positions) - 1)]
            for track in (self.one, self.other)
        )
        if (k, j) not in self._gaps:
            result = coal.DistanceResult()
            self._gaps[k, j] = float(
                self._measure(
                    self.other.at(j, 0.0)[0], self.one.at(k, 0.0)[0], _REQUEST, result
                )
            )
        return self._gaps[k, j]

    def nearest(self, k: int) -> Array:
        """Find the point (3,) of the first that is nearest to the second at a sample."""
        result = coal.DistanceResult()
        self._measure(
            self.other.at(k, 0.0)[0], self.one.at(k, 0.0)[0], _REQUEST, result
        )
        return np.array(result.getNearestPoint2())


class Tracks:
    """The solids of a rollout at some ``samples``: the `Track` of each, and the ``rows`` of all.

    At sample k solid i is in row ``first[i] + moves[i] * k``. Those that move come first.

    Attributes:
        moving: the numbers of the M solids that move.
        moves: (N,) 1 for these, 0 for the others.
    """

    def __init__(
        self, solids: Solids, moving: Indices, moved: Rows, samples: int
    ) -> None:
        resting, rest = _at_rest(solids)
        self.solids, self.moving, self.samples = solids, moving, samples
        self.rows = Rows(
            *(
                np.concatenate(each, axis)
                for *each, axis in zip(moved, rest, _AXES, strict=True)
            )
        )
        self.first, self.moves = (
            np.full(len(self), len(self.rows.aside)),
            np.zeros(len(self), dtype=np.intp),
        )
        self.first[moving], self.moves[moving] = samples * np.arange(len(moving)), 1
        self.first[resting] = samples * len(moving) + np.arange(len(resting))
        self._made: dict[int, Track] = {}

    def __len__(self) -> int:
        return len(self.solids.items)

    def __getitem__(self, number: int) -> Track:
        if number not in self._made:
            begin = int(self.first[number])
            span = slice(begin, begin + (self.samples if self.moves[number] else 1))
            rows = (
                values[:, span] if axis else values[span]
                for values, axis in zip(self.rows, _AXES, strict=True)
            )
            self._made[number] = Track(self.solids, number, Rows(*rows))
        return self._made[number]

    def __iter__(self) -> Iterator[Track]:
        return (self[number] for number in range(len(self)))

    def row(self, numbers: Indices | int, samples: Indices) -> Indices:
        """The rows of solids at samples."""
        rows: Indices = self.first[numbers] + self.moves[numbers] * samples
        return rows

    def by_sample(self, values: Array) -> Array:
        """Those of the rows' values (..., R) that are of the solids that move: (..., M, T)."""
        shape = len(self.moving), self.samples
        return values[..., : shape[0] * shape[1]].reshape(*values.shape[:-1], *shape)


def lengths(vectors: Array) -> Array:
    """Compute the lengths (...) of vectors (..., N)."""
    squares: Array = np.einsum("...i,...i->...", vectors, vectors)
    return np.sqrt(squares)


def angles(rotations: Array, after: Array) -> Array:
    """Compute the angles (...), radians, from rotations (..., 3, 3) to others."""
    traces = np.einsum("...ij,...ij->...", rotations, after)  # of the rotation between
    turned: Array = np.arccos(np.maximum(np.minimum((traces - 1) / 2, 1.0), -1.0))
    return turned


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
    own = joint_frames(
        model, joint_values(robot, tool, recording.arm, recording.fingers)
    )
    bodies = _body_frames(recording.states)
    rotations, positions = (
        np.concatenate(pair) for pair in zip(own, bodies, strict=True)
    )
    moving = solids.moving
    if only is not None:
        wanted = np.zeros(len(solids.items), dtype=bool)
        wanted[only] = True
        moving = moving[wanted[moving]]
    aside = np.zeros((len(moving), len(recording.times)))
    if detour is not None:
        number = np.maximum(solids.frames[moving] + 1 - len(own[0]), 0)
        turning = np.where(
            number == 0, model.reach, 0.0
        )  # links turn about the joints before them, too
        aside += (
            detour.moved[number]
            + (solids.far[moving] + turning)[:, None] * detour.turned[number]
        )
    return Tracks(
        solids,
        moving,
        _rows(solids, moving, rotations, positions, aside),
        len(recording.times),
    )


def _body_frames(states: State) -> tuple[Array, Array]:
    """The frames of the free bodies: (B, T, 3, 3) and (B, T, 3)."""
    quaternions = states.quaternions.swapaxes(0, 1)
    matrices = Rotation.from_quat(
        quaternions.reshape(-1, 4), scalar_first=True
    ).as_matrix()
    return matrices.reshape(*quaternions.shape[:2], 3, 3), states.positions.swapaxes(
        0, 1
    )


@lru_cache(maxsize=8)
def _at_rest(solids: Solids) -> tuple[Indices, Rows]:
    """The numbers of the solids that never move, and their rows."""
    numbers = np.flatnonzero(solids.frames == WORLD)
    return numbers, _rows(
        solids,
        numbers,
        np.eye(3)[None, None],
        np.zeros((1, 1, 3)),
        np.zeros((len(numbers), 1)),
    )


def _rows(
    solids: Solids, numbers: Indices, rotations: Array, positions: Array, aside: Array
) -> Rows:
    """Place solids with these numbers in frames with rotations (F, T, 3, 3) and positions (F, T, 3).

    They get up to ``aside`` (N, T) from the straight way, by which their bounding boxes are wider.
    """
    frames, halves = solids.frames[numbers], solids.halves[numbers]
    rotations, positions = place(
        rotations[frames],
        positions[frames],
        solids.rotations[numbers],
        solids.positions[numbers],
    )
    rotations[solids.radii[numbers] < np.inf] = np.eye(3)
    middles, extents = (
        positions + rotate(rotations, solids.middles[numbers]),
        rotate(np.abs(rotations), halves),
    )
    # By axis, since numpy reduces along contiguous instants fifty times as fast.
    across, extents = (
        middles.transpose(2, 0, 1).copy(),
        extents.transpose(2, 0, 1).copy(),
    )
    low, high = across - extents, across + extents
    np.minimum(low[..., :-1], low[..., 1:], out=low[..., :-1])
    np.maximum(high[..., :-1], high[..., 1:], out=high[..., :-1])
    low -= aside
    high += aside
    moved, turned = np.zeros_like(aside), np.zeros_like(aside)
    moved[:, :-1] = lengths(positions[:, 1:] - positions[:, :-1])
    turned[:, :-1] = angles(rotations[:, :-1], rotations[:, 1:])
    places = (
        rotations.reshape(-1, 3, 3),
        positions.reshape(-1, 3),
        middles.reshape(-1, 3),
    )
    boxes = low.reshape(3, -1), high.reshape(3, -1)
    return Rows(*places, *boxes, aside.ravel(), moved.ravel(), turned.ravel())
