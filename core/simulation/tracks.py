"""Follow the solids of a rollout over time: the robot's links, the tool's components and the scene's bodies.

Covered by `tests/core/simulation/test_penetration.py`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin
import trimesh
from scipy.spatial.transform import Rotation

from core.design import Tool
from core.geometry import Array, Mesh, Pose, Shape, Sphere
from core.interfaces import JointTrajectory, Recording
from core.robot.frames import compose, link_frames, robot_model, times
from core.robot.solids import hull, robot_solids, solid_geometry
from core.scene import Scene

SAMPLE_HZ = 25.0
ROBOT = "the robot"  # the owner of its links and of the tool


class Detour(NamedTuple):
    """How far something gets from the straight way between two samples, metres and radians: each (T,)."""

    moved: Array
    turned: Array


@dataclass(frozen=True, eq=False)
class Track:
    """A convex solid, and the rotations (T, 3, 3) and positions (T, 3) of its frame at T samples.

    A solid that never moves has T = 1. The frame of a ball does not turn.

    Attributes:
        owner: the body that the solid is part of, or the robot.
        shape: None for a link's hull.
        middles: (T, 3) the middle of the bounding box ``box``, which is along the solid's own axes.
        low: (T, 3), with ``high`` the bounding box at a sample and on the way to the next.
        reach: how far from the frame's origin rotation moves a point, metres.
        half_width: half of the smallest extent, metres.
        box: half of its extents along its own axes, (3,), metres.
        aside: (T,) how far it gets from the straight way to the next sample, metres, at most.
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
    reach: float
    half_width: float
    box: Array
    aside: Array
    transforms: dict[int, tuple[Any, Array]] = field(default_factory=dict)  # results of `at`, by sample

    @classmethod
    def make(
        cls,
        name: str,
        owner: str,
        solid: _Measured,
        rotations: Array,
        positions: Array,
        detour: Detour | None = None,
        arm: float = 0.0,
    ) -> Track:
        """Make a track; a ``detour`` of its owner widens its bounding boxes, ``arm`` metres away."""
        if solid.pose is not None:
            rotations, positions = compose(rotations, positions, *solid.pose)
        if isinstance(solid.shape, Sphere):
            rotations = np.broadcast_to(np.eye(3), rotations.shape)
        middles, extents = positions + times(rotations, solid.middle), times(np.abs(rotations), solid.half)
        low, high = middles - extents, middles + extents
        low[:-1], high[:-1] = np.minimum(low[:-1], low[1:]), np.maximum(high[:-1], high[1:])
        aside = np.zeros(len(positions))
        if detour is not None:
            aside = detour.moved + (solid.far + arm) * detour.turned
            low, high = (low.T - aside).T, (high.T + aside).T
        half = float(solid.half.min())
        shape, geometry, reach, box = solid.shape, solid.geometry, solid.reach, solid.half
        return cls(name, owner, shape, geometry, rotations, positions, middles, low, high, reach, half, box, aside)

    @cached_property
    def travel(self) -> Array:
        """An upper bound (T,) of how far any point has moved since the first sample, metres."""
        travel: Array = travelled(self.rotations[None], self.positions[None], np.array([self.reach]))[0]
        return travel

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


def travelled(rotations: Array, positions: Array, reaches: Array) -> Array:
    """Bound how far points have moved since the first sample, (N, T), metres.

    The points are within ``reaches`` (N,) of frames with rotations (N, T, 3, 3) and positions (N, T, 3).
    """
    shifts = positions[:, 1:] - positions[:, :-1]
    steps = np.sqrt(np.einsum("nti,nti->nt", shifts, shifts))
    turning = np.flatnonzero(reaches)
    if len(turning):
        traces = np.einsum("ntij,ntij->nt", rotations[turning, 1:], rotations[turning, :-1])  # of the rotation between
        steps[turning] += reaches[turning, None] * np.arccos(np.clip((traces - 1) / 2, -1.0, 1.0))
    return np.concatenate([np.zeros((len(steps), 1)), np.cumsum(steps, axis=1)], axis=1)


def robot_tracks(
    tool: Tool, recording: Recording, detour: Detour | None = None, only: set[int] | None = None
) -> list[Track]:
    """Follow the links that move, and the tool's components; ``only`` those with these numbers among them."""
    frames = link_frames(tool.gripper, recording.arm, recording.fingers)
    reach = robot_model(tool.gripper).reach
    return [
        Track.make(name, ROBOT, solid, *frames[link], detour, reach)
        for i, (name, link, solid) in enumerate([*_link_solids(tool.gripper), *_tool_solids(tool)])
        if only is None or i in only
    ]


def tool_speed(tool: Tool, trajectory: JointTrajectory) -> float:
    """An upper bound of the speed of any point of a tool on its way, m/s, averaged over a sample of `SAMPLE_HZ`."""
    times = np.append(np.arange(0.0, trajectory.duration, 1 / SAMPLE_HZ), trajectory.duration)
    arm, opening = trajectory.sample(times)
    frames = link_frames(tool.gripper, arm, np.column_stack([opening, opening]))
    reaches: dict[str, float] = {}
    for _, link, solid in _tool_solids(tool):
        reaches[link] = max(solid.far, reaches.get(link, 0.0))
    fastest = 0.0
    for link, reach in reaches.items():
        rotations, positions = frames[link]
        (travel,) = travelled(rotations[None], positions[None], np.array([reach]))
        fastest = max(fastest, float((np.diff(travel) / np.diff(times)).max(initial=0.0)))
    return fastest


def body_tracks(
    scene: Scene, recording: Recording, detours: Sequence[Detour] | None = None, only: set[int] | None = None
) -> list[Track]:
    """Follow the collision shapes of all bodies; ``only`` those with these numbers among them."""
    states = recording.states
    quaternions = states.quaternions.reshape(-1, 4)
    matrices = Rotation.from_quat(quaternions, scalar_first=True).as_matrix() if len(quaternions) else np.empty(0)
    rotations = matrices.reshape(*states.quaternions.shape[:2], 3, 3)
    number = {name: i for i, name in enumerate(states.names)}
    tracks: list[Track] = []
    at = 0
    for body in scene.bodies:
        wanted = [part for k, part in enumerate(body.collisions, at) if only is None or k in only]
        at += len(body.collisions)
        if not wanted:
            continue
        if body.fixed:
            tracks += [_fixed(body.name, part.shape, part.pose, body.pose) for part in wanted]
            continue
        i = number[body.name]
        turned, positions = np.ascontiguousarray(rotations[:, i]), np.ascontiguousarray(states.positions[:, i])
        for part in wanted:
            solid = _measured(part.shape, part.pose)
            detour = detours[i] if detours is not None else None
            tracks.append(Track.make(body.name, body.name, solid, turned, positions, detour))
    return tracks


class _Place(NamedTuple):
    """A pose as a rotation (3, 3) and a position (3,)."""

    rotation: Array
    position: Array

    @classmethod
    def of(cls, pose: Pose) -> _Place:
        return cls(pose.rotation.as_matrix(), pose.position)


@dataclass(frozen=True, eq=False)
class _Measured:
    """A solid in its owner's frame: its bounding box there (``middle``, ``half``), and `Track.reach`."""

    shape: Shape | None
    geometry: Any
    pose: _Place | None
    middle: Array
    half: Array
    reach: float

    @cached_property
    def far(self) -> float:
        """How far from the owner's frame it extends, metres."""
        place = 0.0 if self.pose is None else float(np.linalg.norm(self.pose.position))
        return place + float(np.linalg.norm(np.abs(self.middle) + self.half))


def smallest_extent(shape: Shape) -> float:
    """Measure a shape's smallest extent along its own axes, metres."""
    return 2 * float(_measured(shape, Pose()).half.min())


@lru_cache(maxsize=256)
def _measured(shape: Shape, pose: Pose) -> _Measured:
    geometry = _hull(shape.vertices.tobytes()) if isinstance(shape, Mesh) else solid_geometry(shape)
    return _measure(geometry, pose, shape)


@lru_cache(maxsize=256)
def _hull(vertices: bytes) -> Any:
    """The hull of points (V, 3), cached by content: scenes are made anew for each rollout, mostly of equal meshes."""
    return hull(trimesh.PointCloud(np.frombuffer(vertices).reshape(-1, 3)))


def _measure(geometry: Any, pose: Pose, shape: Shape | None = None) -> _Measured:
    geometry.computeLocalAABB()
    box = geometry.aabb_local
    middle, half = (box.max_ + box.min_) / 2, (box.max_ - box.min_) / 2
    reach = 0.0 if isinstance(shape, Sphere) else float(np.linalg.norm(np.abs(middle) + half))
    return _Measured(shape, geometry, None if pose == Pose() else _Place.of(pose), middle, half, reach)


@lru_cache(maxsize=2)
def _link_solids(gripper: bool) -> list[tuple[str, str, _Measured]]:
    """The solids of the links that move: twice the link's name, and the solid."""
    links = robot_model(gripper).links
    return [(s.name, s.name, _measure(s.geometry, s.pose)) for s in robot_solids(gripper) if links[s.name][0] > 0]


@lru_cache(maxsize=8)
def _tool_solids(tool: Tool) -> list[tuple[str, str, _Measured]]:
    """Each component's name, the link that bears it, and its solid."""
    placed = tool.placed()
    return [(part.name, placed[part.name][0], _measured(part.shape, placed[part.name][1])) for part in tool.components]


@lru_cache(maxsize=256)
def _fixed(name: str, shape: Shape, pose: Pose, body: Pose) -> Track:
    """The track of a part of a fixed body: the same for every rollout in a scene."""
    at = body.rotation.as_matrix()[None], body.position[None]
    return Track.make(name, name, _measured(shape, pose), *at)
