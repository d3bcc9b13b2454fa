"""Follow the solids of a rollout over time.

Covered by `tests/core/solids/test_penetration.py`.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any, NamedTuple, overload

import coal
import numpy as np
import numpy.typing as npt
import pinocchio as pin
from scipy.spatial.transform import Rotation

from core.design import Tool
from core.geometry import Array, Shape
from core.interfaces import Recording
from core.robot.frames import bearer_frames, joint_frames, joint_values, place, robot_model, rotate, tool_values
from core.scene import Scene, State
from core.solids.bodies import WORLD, Solids, all_solids, body_solids, own_solids
from core.values.robots import Robot

SAMPLE_HZ = 25.0

Indices = npt.NDArray[np.intp]


class Detour(NamedTuple):
    """How far things get from the straight way between two samples, metres and radians: each (N, T).

    First comes the robot, then each free body.
    """

    moved: Array
    turned: Array


@dataclass(eq=False)  # not frozen: that takes three times as long to make
class Track:
    """A convex solid, and the rotations (T, 3, 3) and positions (T, 3) of its frame at T samples.

    A solid that never moves has T = 1. The frame of a ball does not turn.

    Attributes:
        owner: the body that the solid is part of, or the robot.
        shape: None for a link's hull.
        middles: (T, 3) the middle of the bounding box ``box``, which is along the solid's own axes.
        low: (T, 3), with ``high`` the bounding box at a sample and on the way to the next.
        reach: how far from the frame's origin rotation moves a point, metres.
        half_width: half of the thickness, metres (`thickness`).
        box: half of its extents along its own axes, (3,), metres.
        aside: (T,) how far it gets from the straight way to the next sample, metres, at most.
        moved: (T,) the length of the way to the next sample, metres; the last is 0.
        turned: (T,) the angle to the next sample, radians; the last is 0.
    """

    name: str
    owner: str
    shape: Shape | None
    geometry: Any
    rotations: Array
    positions: Array
    middles: Array
    low: Array
    high: Array
    aside: Array
    moved: Array
    turned: Array
    reach: float
    half_width: float
    box: Array
    transforms: dict[int, tuple[Any, Array]] = field(default_factory=dict)  # results of `at`, by sample

    @cached_property
    def travel(self) -> Array:
        """An upper bound (T,) of how far any point has moved since the first sample, metres."""
        return np.concatenate([[0.0], np.cumsum((self.moved + self.reach * self.turned)[:-1])])

    def top_speed(self, times: Array) -> float:
        """An upper bound of the speed of any point, m/s, averaged over a tenth of a second."""
        count = max(1, min(len(times) - 1, round(0.1 * SAMPLE_HZ)))
        if len(times) < 2:
            return 0.0
        return float(((self.travel[count:] - self.travel[:-count]) / (times[count:] - times[:-count])).max())

    def at(self, k: int, share: float) -> tuple[Any, Array]:
        """Coal's transform and the rotation (3, 3), a ``share`` (0..1) of the way from sample ``k`` to the next."""
        if len(self.positions) == 1:
            k, share = 0, 0.0
        if share == 0 and k in self.transforms:
            return self.transforms[k]
        rotation, position = self.rotations[k], self.positions[k]
        if share > 0:
            position = position + share * (self.positions[k + 1] - position)
            rotation = rotation.dot(pin.exp3(share * pin.log3(rotation.T.dot(self.rotations[k + 1]))))
            return coal.Transform3s(rotation, position), rotation
        self.transforms[k] = coal.Transform3s(rotation, position), rotation
        return self.transforms[k]


class Rows(NamedTuple):
    """What a `Track` says, of many one after the other: R rows in all."""

    rotations: Array  # (R, 3, 3)
    positions: Array  # (R, 3)
    middles: Array  # (R, 3)
    low: Array  # (3, R)
    high: Array  # (3, R)
    aside: Array  # (R,)
    moved: Array  # (R,)
    turned: Array  # (R,)


_AXES = (0, 0, 0, 1, 1, 0, 0, 0)  # along which the rows are in each of them


class Tracks(Sequence[Track]):
    """The solids of a rollout at some ``samples``: the `Track` of each, and the ``rows`` of all.

    At sample k solid i is in row ``first[i] + moves[i] * k``. Those that move come first.

    Attributes:
        moving: the numbers of the M solids that move.
        moves: (N,) 1 for these, 0 for the others.
    """

    def __init__(self, solids: Solids, moving: Indices, moved: Rows, samples: int) -> None:
        resting, rest = _at_rest(solids)
        self.solids, self.moving, self.samples = solids, moving, samples
        self.rows = Rows(*(np.concatenate(each, axis) for *each, axis in zip(moved, rest, _AXES, strict=True)))
        self.first, self.moves = np.full(len(self), len(self.rows.aside)), np.zeros(len(self), dtype=np.intp)
        self.first[moving], self.moves[moving] = samples * np.arange(len(moving)), 1
        self.first[resting] = samples * len(moving) + np.arange(len(resting))
        self._made: dict[int, Track] = {}

    def __len__(self) -> int:
        return len(self.solids.names)

    @overload
    def __getitem__(self, number: int) -> Track: ...
    @overload
    def __getitem__(self, number: slice) -> list[Track]: ...
    def __getitem__(self, number: int | slice) -> Track | list[Track]:
        numbers = range(len(self))[number]
        if isinstance(numbers, range):
            return [self[i] for i in numbers]
        if numbers not in self._made:
            self._made[numbers] = self._track(numbers)
        return self._made[numbers]

    def _track(self, number: int) -> Track:
        of, begin = self.solids, int(self.first[number])
        at = slice(begin, begin + (self.samples if self.moves[number] else 1))
        what: Any = of.names[number], of.owners[number], of.shapes[number], of.geometries[number]
        rows: Any = (values[:, at].T if axis else values[at] for values, axis in zip(self.rows, _AXES, strict=True))
        sizes: Any = float(of.reaches[number]), float(of.widths[number]), of.halves[number]
        return Track(*what, *rows, *sizes)

    def part(self, begin: int, end: int) -> Tracks:
        """The same solids from one sample to before another."""
        part = copy(self)
        part.first, part.samples, part._made = self.first + begin * self.moves, end - begin, {}
        return part

    def row(self, numbers: Indices | int, samples: Indices) -> Indices:
        """The rows of solids at samples."""
        found: Indices = self.first[numbers] + self.moves[numbers] * samples
        return found

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
    solids, model = all_solids(robot, tool, body_solids(scene)), robot_model(robot, tool.gripper)
    own, bodies = _own_frames(robot, tool, recording), _body_frames(recording.states)
    rotations, positions = (np.concatenate(pair) for pair in zip(own, bodies, strict=True))
    moving = solids.moving
    if only is not None:
        wanted = np.zeros(len(solids.names), dtype=bool)
        wanted[only] = True
        moving = moving[wanted[moving]]
    aside = np.zeros((len(moving), len(recording.times)))
    if detour is not None:
        at = np.maximum(solids.frames[moving] + 1 - len(own[0]), 0)
        far = solids.far[moving] + np.where(at == 0, model.reach, 0.0)  # links turn about the joints before them, too
        aside += detour.moved[at] + far[:, None] * detour.turned[at]
    return Tracks(solids, moving, _rows(solids, moving, rotations, positions, aside), len(recording.times))


def robot_tracks(robot: Robot, tool: Tool, recording: Recording) -> Tracks:
    """Follow the links that move, and the tool's components."""
    return _follow(own_solids(robot, tool), *_own_frames(robot, tool, recording))


def body_tracks(scene: Scene, recording: Recording) -> Tracks:
    """Follow the collision shapes of all bodies."""
    return _follow(body_solids(scene), *_body_frames(recording.states))


def _follow(solids: Solids, rotations: Array, positions: Array) -> Tracks:
    moving, count = solids.moving, rotations.shape[1]
    return Tracks(solids, moving, _rows(solids, moving, rotations, positions, np.zeros((len(moving), count))), count)


def _own_frames(robot: Robot, tool: Tool, recording: Recording) -> tuple[Array, Array]:
    """The frames of the robot's joints and behind them the tool's bearers: (F, T, 3, 3) and (F, T, 3)."""
    model = robot_model(robot, tool.gripper)
    rotations, positions = joint_frames(model, joint_values(robot, tool.gripper, recording.arm, recording.fingers))
    if not tool.bearers:
        return rotations, positions
    mounts = _mounts(robot, tool, rotations, positions)
    found = bearer_frames(tool, tool_values(robot, tool, recording.fingers), mounts).values()
    turned, moved = zip(*found, strict=True)
    return np.concatenate([rotations, turned]), np.concatenate([positions, moved])


def mount_positions(robot: Robot, tool: Tool, recording: Recording) -> dict[str, Array]:
    """Follow the origin (T, 3) of each mount of a tool."""
    joints = joint_values(robot, tool.gripper, recording.arm, recording.fingers)
    frames = _mounts(robot, tool, *joint_frames(robot_model(robot, tool.gripper), joints))
    return {mount: positions for mount, (_, positions) in frames.items()}


def _mounts(robot: Robot, tool: Tool, rotations: Array, positions: Array) -> dict[str, tuple[Array, Array]]:
    """Place the frames of a tool's mounts, given those of the joints: (T, 3, 3) and (T, 3) for each."""
    links = robot_model(robot, tool.gripper).links
    at = {mount: links[mount] for mount in tool.mounts}
    return {
        mount: place(rotations[joint], positions[joint], pose.rotation.as_matrix(), pose.position)
        for mount, (joint, pose) in at.items()
    }


def _body_frames(states: State) -> tuple[Array, Array]:
    """The frames of the free bodies: (B, T, 3, 3) and (B, T, 3)."""
    quaternions = states.quaternions.swapaxes(0, 1)
    matrices = Rotation.from_quat(quaternions.reshape(-1, 4), scalar_first=True).as_matrix()
    return matrices.reshape(*quaternions.shape[:2], 3, 3), states.positions.swapaxes(0, 1)


@lru_cache(maxsize=8)
def _at_rest(solids: Solids) -> tuple[Indices, Rows]:
    """The numbers of the solids that never move, and their rows."""
    numbers = np.flatnonzero(solids.frames == WORLD)
    return numbers, _rows(solids, numbers, np.eye(3)[None, None], np.zeros((1, 1, 3)), np.zeros((len(numbers), 1)))


def _rows(solids: Solids, numbers: Indices, rotations: Array, positions: Array, aside: Array) -> Rows:
    """Place solids with these numbers in frames with rotations (F, T, 3, 3) and positions (F, T, 3).

    They get up to ``aside`` (N, T) from the straight way, by which their bounding boxes are wider.
    """
    of, halves = solids.frames[numbers], solids.halves[numbers]
    rotations, positions = place(rotations[of], positions[of], solids.rotations[numbers], solids.positions[numbers])
    rotations[solids.radii[numbers] < np.inf] = np.eye(3)
    middles, extents = positions + rotate(rotations, solids.middles[numbers]), rotate(np.abs(rotations), halves)
    # By axis, since numpy reduces along contiguous instants fifty times as fast.
    across, extents = middles.transpose(2, 0, 1).copy(), extents.transpose(2, 0, 1).copy()
    low, high = across - extents, across + extents
    np.minimum(low[..., :-1], low[..., 1:], out=low[..., :-1])
    np.maximum(high[..., :-1], high[..., 1:], out=high[..., :-1])
    low -= aside
    high += aside
    moved, turned = np.zeros_like(aside), np.zeros_like(aside)
    moved[:, :-1] = lengths(positions[:, 1:] - positions[:, :-1])
    turned[:, :-1] = angles(rotations[:, :-1], rotations[:, 1:])
    places = rotations.reshape(-1, 3, 3), positions.reshape(-1, 3), middles.reshape(-1, 3)
    boxes = low.reshape(3, -1), high.reshape(3, -1)
    return Rows(*places, *boxes, aside.ravel(), moved.ravel(), turned.ravel())
