"""Follow the solids of a rollout over time.

`follow` places all solids at all samples at once, as `Rows`; a `Track` is one of them, and a `Pair` measures two.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import coal
import numpy as np
import numpy.typing as npt
import pinocchio as pin
from scipy.spatial.transform import Rotation

from core.design import Tool
from core.geometry import Array, running_sums
from core.interfaces import Recording
from core.robot.kinematics import place, robot_model, rotate
from core.robot.solids import WORLD
from core.scene import Scene, State
from core.solids.rollout_solids import Solids, all_solids
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
    """N solids at T samples.

    Attributes:
        rotations: (N, T, 3, 3), with ``positions`` (N, T, 3) the solid's frame. That of a ball does not turn.
        middles: (N, T, 3) the middle of the bounding box along the solid's own axes.
        low: (N, T, 3), with ``high`` the bounding box at the sample and on the way to the next.
        aside: (N, T) how far it gets from the straight way to the next sample, metres, at most.
        ways: (N, T) how far any of its points moves until the next sample, metres, at most; the last is 0.
    """

    rotations: Array
    positions: Array
    middles: Array
    low: Array
    high: Array
    aside: Array
    ways: Array


class Track:
    """A convex solid at T samples.

    Attributes:
        name: of its link, component or body; with ``owner``, ``shape`` and ``geometry`` see `Solid`.
        box: half of the bounding box's extents along its own axes, (3,), metres.
        rotations: (T, 3, 3), with ``positions`` (T, 3), ``middles`` (T, 3), ``low`` (T, 3) and ``high`` (T, 3), see
            `Rows`.
    """

    def __init__(self, solids: Solids, number: int, rows: Rows) -> None:
        solid = solids.items[number]
        self.name = solid.name
        self.owner = solid.owner
        self.shape = solid.shape
        self.geometry = solid.geometry
        self.box = solids.halves[number]
        self.rotations = rows.rotations[number]
        self.positions = rows.positions[number]
        self.middles = rows.middles[number]
        self.low = rows.low[number]
        self.high = rows.high[number]
        self._rests = solid.frame == WORLD
        self._ways = rows.ways[number]

    @cached_property
    def travel(self) -> Array:
        """An upper bound (T,) of how far any point has moved since the first sample, metres."""
        return running_sums(self._ways[:-1])

    @cached_property
    def _rest(self) -> Any:
        return coal.Transform3s(self.rotations[0], self.positions[0])

    def at(self, instant: float) -> Any:
        """Coal's transform at an instant, by the numbers of the samples and in between."""
        if self._rests:
            return self._rest

        k = int(instant)
        share = instant - k
        if share > 0:
            begin = self.positions[k]
            turn = pin.log3(self.rotations[k].T.dot(self.rotations[k + 1]))
            rotation = self.rotations[k].dot(pin.exp3(share * turn))
            position = begin + share * (self.positions[k + 1] - begin)
            return coal.Transform3s(rotation, position)

        return coal.Transform3s(self.rotations[k], self.positions[k])


class Look(NamedTuple):
    """What is measured of two solids at an instant.

    Attributes:
        depth: how deep the first is in the second, metres; negative if they are apart.
        here: Coal's transform of the first; ``there`` is that of the second.
        result: Coal's.
    """

    depth: float
    here: Any
    there: Any
    result: Any

    @property
    def out(self) -> Array:
        """The direction (3,) in the world of the shortest way out of the second for the first."""
        return self.result.normal

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

    def look(self, instant: float) -> Look:
        """Measure the two at an instant (see `Track.at`)."""
        here = self.first.at(instant)
        there = self.second.at(instant)
        result = coal.DistanceResult()
        gap = float(self._measure(there, here, _REQUEST, result))

        return Look(-gap, here, there, result)

    def gaps(self, samples: Indices) -> Array:
        """Measure the gaps (N,) at N samples, metres, negative if the two overlap; once while they rest."""
        moved = np.diff(self.travel[samples], prepend=-1.0) > 0
        gaps = np.array([-self.look(k).depth for k in samples[moved].tolist()])

        return gaps[np.cumsum(moved) - 1]


@dataclass(frozen=True, eq=False)
class Tracks:
    """The solids of a rollout at T samples.

    Attributes:
        solids: what they are, at rest.
        rows: all of them at all samples.
        times: (T,) of the samples, seconds.
    """

    solids: Solids
    rows: Rows
    times: Array

    @cached_property
    def items(self) -> list[Track]:
        """The track of each, made once it is asked for: a first look over a rollout mostly needs none."""
        count = len(self.solids.items)
        return [Track(self.solids, number, self.rows) for number in range(count)]

    def pair(self, numbers: Indices) -> Pair:
        """Return two of the solids, by their numbers (2,)."""
        return Pair(*(self.items[number] for number in numbers))


def lengths(vectors: Array) -> Array:
    """Compute the lengths of vectors.

    Args:
        vectors: (..., N).

    Returns:
        Lengths (...).
    """
    squares: Array = np.einsum("...i,...i->...", vectors, vectors)
    return np.sqrt(squares)


def angles(rotations: Array, after: Array) -> Array:
    """Compute the angles from rotations to others.

    Args:
        rotations: (..., 3, 3).
        after: (..., 3, 3) the others.

    Returns:
        Angles (...), radians.
    """
    chords = lengths((after - rotations).reshape(*rotations.shape[:-2], 9))
    return 2 * np.arcsin(np.minimum(chords / math.sqrt(8), 1.0))


def follow(
    scene: Scene,
    robot: Robot,
    tool: Tool,
    recording: Recording,
    detour: Detour | None = None,
) -> Tracks:
    """Follow the robot's links that move, the tool's components, and behind them the collision shapes of all bodies.

    Args:
        scene: its bodies.
        robot: the arm.
        tool: what it holds.
        recording: how all of them move.
        detour: how far they get from the straight way between two samples, which widens their bounding boxes.
    """
    solids = all_solids(scene, robot, tool)
    model = robot_model(robot, tool)
    joints = model.order(recording.arm, recording.fingers)
    rotations, positions = model.place_joints(joints)
    turns, shifts = _body_frames(recording.states)
    # The world's frame is the last one.
    world = np.broadcast_to(np.eye(3), (1, *turns.shape[1:]))
    frames = (
        np.concatenate([rotations, turns, world]),
        np.concatenate([positions, shifts, np.zeros((1, *shifts.shape[1:]))]),
    )

    aside = np.zeros((len(solids.items), len(recording.times)))
    if detour is not None:
        moving = solids.moving
        number = np.maximum(solids.frames[moving] + 1 - len(rotations), 0)
        turning = np.where(number == 0, model.reach, 0.0)  # about the joints before
        far = solids.far[moving] + turning
        aside[moving] = detour.moved[number] + far[:, None] * detour.turned[number]

    rows = place_solids(solids, np.arange(len(solids.items)), *frames, aside)
    return Tracks(solids, rows, recording.times)


def _body_frames(states: State) -> tuple[Array, Array]:
    """The frames of the free bodies: (B, T, 3, 3) and (B, T, 3)."""
    quaternions = states.quaternions.swapaxes(0, 1)
    turns = Rotation.from_quat(quaternions.reshape(-1, 4), scalar_first=True)
    rotations = turns.as_matrix().reshape(*quaternions.shape[:2], 3, 3)

    return rotations, states.positions.swapaxes(0, 1)


def place_solids(
    solids: Solids,
    numbers: Indices,
    rotations: Array,
    positions: Array,
    aside: Array | None = None,
) -> Rows:
    """Place some solids in frames that move.

    Args:
        solids: in their frames.
        numbers: (N,) of those that are placed.
        rotations: (F, T, 3, 3) of the frames.
        positions: (F, T, 3) of the frames.
        aside: (N, T) how far each gets from the straight way, metres, by which its bounding box is wider. None: all
            of them move straight on.
    """
    frames = solids.frames[numbers]
    rotations, positions = place(
        rotations[frames],
        positions[frames],
        solids.rotations[numbers],
        solids.positions[numbers],
    )
    rotations[solids.radii[numbers] < np.inf] = np.eye(3)
    if aside is None:
        aside = np.zeros(positions.shape[:2])

    # The bounding boxes, on the way to the next sample too.
    middles = positions + rotate(rotations, solids.middles[numbers])
    extents = rotate(np.abs(rotations), solids.halves[numbers])
    # In memory the axis comes first: NumPy reduces contiguous instants far faster.
    low = np.moveaxis((middles - extents).transpose(2, 0, 1).copy(), 0, 2)
    high = np.moveaxis((middles + extents).transpose(2, 0, 1).copy(), 0, 2)
    np.minimum(low[:, :-1], low[:, 1:], out=low[:, :-1])
    np.maximum(high[:, :-1], high[:, 1:], out=high[:, :-1])
    low -= aside[..., None]
    high += aside[..., None]

    turned = angles(rotations[:, :-1], rotations[:, 1:])
    ways = np.zeros(positions.shape[:2])
    ways[:, :-1] = solids.reaches[numbers, None] * turned
    ways[:, :-1] += lengths(positions[:, 1:] - positions[:, :-1])

    return Rows(rotations, positions, middles, low, high, aside, ways)
