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
import numpy.typing as npt
import pinocchio as pin
import trimesh
from scipy.spatial.transform import Rotation

from core.design import Tool
from core.geometry import Array, Mesh, Pose, Shape, Sphere
from core.interfaces import JointTrajectory, Recording
from core.robot.frames import bearer_frames, joint_frames, joint_values, place, robot_model, rotate, tool_values
from core.robot.solids import hull, robot_solids, solid_geometry
from core.robots import Robot
from core.scene import Scene

SAMPLE_HZ = 25.0
ROBOT = "the robot"  # the owner of its links and of the tool


class Detour(NamedTuple):
    """How far something gets from the straight way between two samples, metres and radians: each (T,)."""

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
        lowest: (3,), with ``highest`` the bounding box of the whole way.
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
    lowest: Array
    highest: Array
    reach: float
    half_width: float
    box: Array
    aside: Array
    moved: Array
    turned: Array
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


def lengths(vectors: Array) -> Array:
    """Compute the lengths (...) of vectors (..., 3)."""
    squares: Array = np.einsum("...i,...i->...", vectors, vectors)
    return np.sqrt(squares)


def angles(rotations: Array, after: Array) -> Array:
    """Compute the angles (...), radians, from rotations (..., 3, 3) to others."""
    traces = np.einsum("...ij,...ij->...", rotations, after)  # of the rotation between
    turned: Array = np.arccos(np.clip((traces - 1) / 2, -1.0, 1.0))
    return turned


def robot_tracks(
    robot: Robot, tool: Tool, recording: Recording, detour: Detour | None = None, only: Sequence[int] | None = None
) -> list[Track]:
    """Follow the links that move, and the tool's components; ``only`` those with these numbers among them."""
    solids, model = _robot_solids(robot, tool), robot_model(robot, tool.gripper)
    frames = joint_frames(model, joint_values(robot, tool.gripper, recording.arm, recording.fingers))
    if tool.bearers:
        frames = _with_bearers(robot, tool, recording, *frames)
    return solids.tracks(*frames, detour and Detour(detour.moved[None], detour.turned[None]), model.reach, only)


def _with_bearers(
    robot: Robot, tool: Tool, recording: Recording, rotations: Array, positions: Array
) -> tuple[Array, Array]:
    """Append the frames of the tool's bearers to those of the joints, (J, T, 3, 3) and (J, T, 3)."""
    links, mounts = robot_model(robot, tool.gripper).links, {}
    for mount in tool.mounts:
        joint, at = links[mount]
        mounts[mount] = place(rotations[joint], positions[joint], at.rotation.as_matrix(), at.position)
    found = bearer_frames(tool, tool_values(robot, tool, recording.fingers), mounts).values()
    turned, moved = zip(*found, strict=True)
    return np.concatenate([rotations, turned]), np.concatenate([positions, moved])


def tool_speed(robot: Robot, tool: Tool, trajectory: JointTrajectory) -> float:
    """An upper bound of the speed of any point of a tool on its way, m/s, averaged over a sample of `SAMPLE_HZ`."""
    times = np.append(np.arange(0.0, trajectory.duration, 1 / SAMPLE_HZ), trajectory.duration)
    arm, opening = trajectory.sample(times)
    model = robot_model(robot, tool.gripper)
    joints = joint_values(robot, tool.gripper, arm, np.column_stack([opening, opening]))
    rotations, positions = joint_frames(model, joints)
    fastest = 0.0
    for mount, reach in _reaches(robot, tool).items():
        joint, pose = model.links[mount]
        turned, moved = place(rotations[joint], positions[joint], pose.rotation.as_matrix(), pose.position)
        steps = lengths(np.diff(moved, axis=0)) + reach * angles(turned[:-1], turned[1:])
        fastest = max(fastest, float((steps / np.diff(times)).max(initial=0.0)))
    return fastest


def body_tracks(
    scene: Scene, recording: Recording, detours: Sequence[Detour] | None = None, only: Sequence[int] | None = None
) -> list[Track]:
    """Follow the collision shapes of all bodies; ``only`` those with these numbers among them."""
    fixed, free, numbers = _body_solids(scene)
    tracks = {number: track for number, track in fixed.items() if only is None or number in only}
    chosen = [i for i, number in enumerate(numbers) if only is None or number in only]
    if chosen:
        states = recording.states
        quaternions = states.quaternions.swapaxes(0, 1).reshape(-1, 4)
        matrices = Rotation.from_quat(quaternions, scalar_first=True).as_matrix()
        rotations: Array = matrices.reshape(-1, len(recording.times), 3, 3)
        detour = None if detours is None else Detour(*(np.array(values) for values in zip(*detours, strict=True)))
        moved = free.tracks(rotations, states.positions.swapaxes(0, 1), detour, 0.0, chosen)
        tracks |= {numbers[i]: track for i, track in zip(chosen, moved, strict=True)}
    return [tracks[number] for number in sorted(tracks)]


@dataclass(frozen=True, eq=False)
class _Solids:
    """N solids, each at rest in one of the frames that move.

    Attributes:
        frames: (N,) the number of each one's frame.
        rotations: (N, 3, 3), with ``positions`` (N, 3) its place there.
        middles: (N, 3), with ``halves`` (N, 3) its bounding box along its own axes.
        reaches: (N,) see `Track.reach`.
        far: (N,) how far from the origin of its frame it extends, metres.
    """

    names: tuple[str, ...]
    owners: tuple[str, ...]
    shapes: tuple[Shape | None, ...]
    geometries: tuple[Any, ...]
    frames: npt.NDArray[np.intp]
    rotations: Array
    positions: Array
    middles: Array
    halves: Array
    widths: Array
    reaches: Array
    far: Array

    @classmethod
    def of(cls, solids: Sequence[_Solid]) -> _Solids:
        """Measure solids."""
        names, owners, shapes, geometries, frames, poses = zip(*solids, strict=True) if solids else ((),) * 6
        boxes = [_bounding_box(geometry) for geometry in geometries]
        middles, halves = np.array(boxes).reshape(-1, 2, 3).swapaxes(0, 1)
        balls = np.array([isinstance(shape, Sphere) for shape in shapes], dtype=bool)
        corners = np.linalg.norm(np.abs(middles) + halves, axis=1)
        positions = np.array([pose.position for pose in poses]).reshape(-1, 3)
        return cls(
            names,
            owners,
            shapes,
            geometries,
            np.array(frames, dtype=np.intp),
            np.array([pose.rotation.as_matrix() for pose in poses]).reshape(-1, 3, 3),
            positions,
            middles,
            halves,
            np.array(
                [thickness(s) if isinstance(s, Mesh) else 2 * h.min() for s, h in zip(shapes, halves, strict=True)]
            )
            / 2,
            np.where(balls, 0.0, corners),
            np.linalg.norm(positions, axis=1) + corners,
        )

    def tracks(
        self, rotations: Array, positions: Array, detour: Detour | None, arm: float, only: Sequence[int] | None = None
    ) -> list[Track]:
        """Follow the solids in frames with rotations (F, T, 3, 3) and positions (F, T, 3).

        A ``detour``, each (F, T) or (1, T), widens their bounding boxes; what turns is ``arm`` metres farther away.
        """
        chosen = np.arange(len(self.names)) if only is None else np.array(only, dtype=np.intp)
        of, halves = self.frames[chosen], self.halves[chosen]
        rotations, positions = place(rotations[of], positions[of], self.rotations[chosen], self.positions[chosen])
        for i, number in enumerate(chosen.tolist()):
            if isinstance(self.shapes[number], Sphere):
                rotations[i] = np.eye(3)
        middles, extents = positions + rotate(rotations, self.middles[chosen]), rotate(np.abs(rotations), halves)
        # By axis, since numpy reduces along contiguous instants fifty times as fast.
        across, extents = middles.swapaxes(1, 2).copy(), extents.swapaxes(1, 2)
        low, high = across - extents, across + extents
        np.minimum(low[..., :-1], low[..., 1:], out=low[..., :-1])
        np.maximum(high[..., :-1], high[..., 1:], out=high[..., :-1])
        aside = np.zeros(positions.shape[:2])
        if detour is not None:
            by_frame = of if len(detour.moved) > 1 else 0
            aside += detour.moved[by_frame] + (self.far[chosen] + arm)[:, None] * detour.turned[by_frame]
            low -= aside[:, None]
            high += aside[:, None]
        lowest, highest = low.min(axis=2), high.max(axis=2)
        moved, turned = np.zeros_like(aside), np.zeros_like(aside)
        moved[:, :-1] = lengths(np.diff(positions, axis=1))
        turned[:, :-1] = angles(rotations[:, :-1], rotations[:, 1:])
        return [
            Track(
                self.names[number],
                self.owners[number],
                self.shapes[number],
                self.geometries[number],
                rotations[i],
                positions[i],
                middles[i],
                low[i].T,
                high[i].T,
                lowest[i],
                highest[i],
                float(self.reaches[number]),
                float(self.widths[number]),
                halves[i],
                aside[i],
                moved[i],
                turned[i],
            )
            for i, number in enumerate(chosen.tolist())
        ]


@lru_cache(maxsize=512)
def thickness(shape: Shape) -> float:
    """Measure how thick a shape is, metres: along its own axes, or square to a face of a mesh's hull."""
    straight = 2 * float(_bounding_box(_geometry(shape))[1].min())
    return min(straight, _across_faces(shape)) if isinstance(shape, Mesh) else straight


@lru_cache(maxsize=512)
def _across_faces(mesh: Mesh) -> float:
    hull = mesh.to_trimesh().convex_hull
    return float(np.ptp(hull.vertices @ hull.face_normals.T, axis=0).min())


def _geometry(shape: Shape) -> Any:
    return _hull(shape.vertices.tobytes()) if isinstance(shape, Mesh) else solid_geometry(shape)


@lru_cache(maxsize=256)
def _hull(vertices: bytes) -> Any:
    """The hull of points (V, 3), cached by content: scenes are made anew for each rollout, mostly of equal meshes."""
    return hull(trimesh.PointCloud(np.frombuffer(vertices).reshape(-1, 3)))


def _bounding_box(geometry: Any) -> tuple[Array, Array]:
    """The middle (3,) of a geometry's bounding box along its own axes, and half of its extents (3,)."""
    geometry.computeLocalAABB()
    box = geometry.aabb_local
    return (box.max_ + box.min_) / 2, (box.max_ - box.min_) / 2


_Solid = tuple[str, str, Shape | None, Any, int, Pose]  # name, owner, shape, Coal's geometry, frame, pose in it


@lru_cache(maxsize=8)
def _link_solids(robot: Robot, gripper: bool) -> tuple[_Solid, ...]:
    """The solids of the links that move, in the joints' frames."""
    links = robot_model(robot, gripper).links
    moving = [(solid, *links[solid.name]) for solid in robot_solids(robot, gripper) if links[solid.name][0] > 0]
    return tuple((solid.name, ROBOT, None, solid.geometry, joint, at @ solid.pose) for solid, joint, at in moving)


@lru_cache(maxsize=8)
def _robot_solids(robot: Robot, tool: Tool) -> _Solids:
    """The links' solids, and behind them the tool's parts."""
    links, solids = robot_model(robot, tool.gripper).links, list(_link_solids(robot, tool.gripper))
    frames = {mount: links[mount] for mount in tool.mounts}
    joints = len(robot_model(robot, tool.gripper).parents)
    frames |= {bearer.name: (joints + number, Pose()) for number, bearer in enumerate(tool.bearers)}
    for name, shape, bearer, pose in tool.parts:
        joint, at = frames[bearer]
        solids.append((name, ROBOT, shape, _geometry(shape), joint, at @ pose))
    return _Solids.of(solids)


@lru_cache(maxsize=8)
def _reaches(robot: Robot, tool: Tool) -> dict[str, float]:
    """How far the tool extends from each of its mounts, metres, at most."""
    solids, reaches = _robot_solids(robot, tool), dict[str, float]()
    own = slice(len(solids.far) - len(tool.parts), None)
    corners = (solids.far - np.linalg.norm(solids.positions, axis=1))[own]
    away = {mount: (mount, 0.0) for mount in tool.mounts}
    for name, parent, pose, joint in tool.bearers:
        mount, before = away[parent]
        range_m = max(-joint.lower, joint.upper) if joint.kind == "slider" else 0.0
        away[name] = mount, before + float(np.linalg.norm(pose.position)) + range_m
    for part, corner in zip(tool.parts, corners, strict=True):
        mount, before = away[part.bearer]
        reaches[mount] = max(before + float(np.linalg.norm(part.pose.position) + corner), reaches.get(mount, 0.0))
    return reaches


_Kept = tuple[dict[int, Track], _Solids, list[int]]
_last: tuple[Scene, list[object], _Kept] | None = None


def _body_solids(scene: Scene) -> _Kept:
    """The tracks of fixed bodies' solids by number, the solids of free ones, and their numbers.

    They are kept for the last scene, which has many rollouts, and for equal ones made anew.
    """
    global _last
    if _last is not None and _last[0] is scene:
        return _last[2]
    content: list[object] = [(b.name, b.pose if b.fixed else None, b.collisions) for b in scene.bodies]
    if _last is not None and _last[1] == content:
        _last = scene, *_last[1:]
        return _last[2]
    names, numbers = [body.name for body in scene.free], list[int]()
    fixed, free, places = dict[int, _Solid](), list[_Solid](), list[Pose]()
    parts = [(body, part) for body in scene.bodies for part in body.collisions]
    for number, (body, part) in enumerate(parts):
        frame = len(fixed) if body.fixed else names.index(body.name)
        solid = (body.name, body.name, part.shape, _geometry(part.shape), frame, part.pose)
        if body.fixed:
            fixed[number] = solid
            places.append(body.pose)
        else:
            free.append(solid)
            numbers.append(number)
    rotations = np.array([pose.rotation.as_matrix() for pose in places]).reshape(-1, 1, 3, 3)
    positions = np.array([pose.position for pose in places]).reshape(-1, 1, 3)
    tracks = _Solids.of(list(fixed.values())).tracks(rotations, positions, None, 0.0)
    _last = scene, content, (dict(zip(fixed, tracks, strict=True)), _Solids.of(free), numbers)
    return _last[2]
