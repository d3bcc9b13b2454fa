"""What physics let happen and the world would not: things that pass through one another, and things that are flung.

It is found in what a simulator recorded, so engines need not know of it. Two solids are followed from one moment to the
next at which they can have met: between samples poses are interpolated, and as long as what lies between two moments is
too short a way to get deeper than the limit, nothing need be looked at (conservative advancement: B. Mirtich, "Impulse-
based dynamic simulation of rigid body systems", PhD thesis, Berkeley 1996, section 2.3).
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache, lru_cache
from typing import Any, NamedTuple

import coal
import numpy as np
import numpy.typing as npt
import pinocchio as pin
import trimesh
from scipy.spatial.transform import Rotation

from core.design import Tool
from core.geometry import Array, Box, Cylinder, Mesh, Pose, Shape, Sphere
from core.interfaces import Recording
from core.robot.description import ARM_JOINTS, FINGER_JOINTS, assemble
from core.robot.solids import hull, robot_solids, solid_geometry
from core.scene import Scene

SAMPLE_HZ = 25.0

DEEP_M = 0.01  # what presses hard may be this deep in something, or half of how far it would be on its way through
THIN_M = 0.003  # but of thin things this much
DEEP_S = 0.06  # what is struck hard may be deeper, for this long
THROUGH = 2 / 3  # share of the way to the middle that one must have got into the other to have passed through it

FLUNG_M_S = 5.0  # faster than this, and
FLUNG_TIMES = 3.0  # so many times as fast as the robot ever was: an elastic blow gives twice the speed at most
LOST_M = 5.0  # from the arm's base
EXPLODED_M_S = 100.0

_FROM_AFAR_M = 0.02  # from here on the first look finds the two still apart, so that it is known from where one came
_REQUEST = coal.DistanceRequest()
_GRAVITY = 9.81


@dataclass(frozen=True)
class Finding:
    """Something that would not happen, told for people; ``cheat`` where a reward that came of it means nothing."""

    text: str
    cheat: bool


class Explosion(Exception):
    """The simulation went to pieces; says how."""


def findings(scene: Scene, tool: Tool, recording: Recording) -> list[Finding]:
    """What would not happen, in a rollout of ``tool`` in ``scene``: one finding for each two things that passed through
    one another, whichever moment it was first, and one for each that was flung.

    The robot's own parts are not held against each other, nor what stands inside each other from the beginning.

    Raises:
        Explosion: a body's state is not finite, or it is faster than `EXPLODED_M_S` and no fall has made it so.
    """
    states = recording.states
    for what in (states.positions, states.quaternions, states.linear_velocities, recording.arm):
        if not np.isfinite(what).all():
            raise Explosion("a body's state is not finite")
    robot = _robot_tracks(tool, recording)
    found = _flung(recording, max((track.fastest(recording.times) for track in robot), default=0.0))
    return _passages(robot, _body_tracks(scene, recording), recording.times) + found


# --- solids over time -------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Track:
    """A convex solid and where it is at each sample: rotations (T, 3, 3) and positions (T, 3) of its frame. One that
    never moves has T = 1.

    ``way`` (T,) is how far a point of it can have gone since the first sample; ``low`` and ``high`` (T, 3) bound its
    place at a sample and on the way to the next. ``of`` is what it is part of, ``reach`` how far from its frame's
    origin turning moves it, ``thick`` its least half width. The frame of a ball does not turn.
    """

    name: str
    of: str
    shape: Shape | None  # None: a link's hull
    geometry: Any
    rotations: Array
    positions: Array
    way: Array
    low: Array
    high: Array
    reach: float
    thick: float
    placed: dict[int, tuple[Any, Array]] = field(default_factory=dict)  # what `at` has found, by sample

    @classmethod
    def make(cls, name: str, of: str, solid: _Measured, rotations: Array, positions: Array) -> _Track:
        if solid.pose is not None:
            rotations, positions = _placed(rotations, positions, solid.pose)
        if isinstance(solid.shape, Sphere):
            rotations = np.broadcast_to(np.eye(3), rotations.shape)
        middles, reach = positions + _times(rotations, solid.middle), _times(np.abs(rotations), solid.half)
        low, high = middles - reach, middles + reach
        low[:-1], high[:-1] = np.minimum(low[:-1], low[1:]), np.maximum(high[:-1], high[1:])
        (way,) = _ways(rotations[None], positions[None], np.array([solid.reach]))
        thick = float(solid.half.min())
        return cls(name, of, solid.shape, solid.geometry, rotations, positions, way, low, high, solid.reach, thick)

    def fastest(self, times: Array) -> float:
        """The speed that no point of it passed, m/s, taken over a tenth of a second."""
        count = max(1, min(len(times) - 1, round(0.1 * SAMPLE_HZ)))
        if len(times) < 2:
            return 0.0
        return float(((self.way[count:] - self.way[:-count]) / (times[count:] - times[:-count])).max())

    def at(self, k: int, share: float) -> tuple[Any, Array]:
        """Coal's transform at sample ``k`` or so far on the way to the next, and the rotation (3, 3)."""
        if len(self.positions) == 1:
            k, share = 0, 0.0
        if share == 0 and k in self.placed:
            return self.placed[k]
        rotation, position = self.rotations[k], self.positions[k]
        if share > 0:
            position = position + share * (self.positions[k + 1] - position)
            rotation = rotation.dot(pin.exp3(share * pin.log3(rotation.T.dot(self.rotations[k + 1]))))
            return coal.Transform3s(rotation, position), rotation
        self.placed[k] = coal.Transform3s(rotation, position), rotation
        return self.placed[k]


class _Place(NamedTuple):
    """A pose as a rotation (3, 3) and a position (3,)."""

    rotation: Array
    position: Array

    @classmethod
    def of(cls, pose: Pose) -> _Place:
        return cls(pose.rotation.as_matrix(), pose.position)


def _placed(rotations: Array, positions: Array, at: _Place) -> tuple[Array, Array]:
    """Of what is at a place in frames with rotations (T, 3, 3) and positions (T, 3), the same."""
    return _times(rotations, at.rotation), positions + _times(rotations, at.position)


def _times(rotations: Array, other: Array) -> Array:
    """Rotations (T, 3, 3) times a matrix (3, 3) or a vector (3,): as one matrix, which takes a tenth of the time."""
    product: Array = rotations.reshape(-1, 3).dot(other)
    return product.reshape(len(rotations), 3, *other.shape[1:])


@dataclass(frozen=True, eq=False)
class _Measured:
    """A solid in the frame of what it is part of: its bounding box there, and how far its points are from its origin
    where turning moves them.
    """

    shape: Shape | None
    geometry: Any
    pose: _Place | None
    middle: Array
    half: Array
    reach: float


@lru_cache(maxsize=256)
def _measured(shape: Shape, pose: Pose) -> _Measured:
    geometry = _hull(shape.vertices.tobytes()) if isinstance(shape, Mesh) else solid_geometry(shape)
    return _measure(geometry, pose, shape)


@lru_cache(maxsize=256)
def _hull(vertices: bytes) -> Any:
    """Of points (V, 3), by content: scenes are made anew for each rollout, their meshes are mostly the same."""
    return hull(trimesh.PointCloud(np.frombuffer(vertices).reshape(-1, 3)))


def _measure(geometry: Any, pose: Pose, shape: Shape | None = None) -> _Measured:
    geometry.computeLocalAABB()
    box = geometry.aabb_local
    middle, half = (box.max_ + box.min_) / 2, (box.max_ - box.min_) / 2
    reach = 0.0 if isinstance(shape, Sphere) else float(np.linalg.norm(np.abs(middle) + half))
    return _Measured(shape, geometry, None if pose == Pose() else _Place.of(pose), middle, half, reach)


@lru_cache(maxsize=2)
def _robot(gripper: bool) -> tuple[Any, dict[str, tuple[int, _Place]], list[tuple[str, _Measured]]]:
    """The kinematic model, on which joint each link sits and where, and the solids that move, by link."""
    model = pin.buildModelFromXML(assemble(Tool(gripper=gripper), visuals=False))
    bodies = [frame for frame in model.frames if frame.type == pin.FrameType.BODY]
    links = {
        frame.name: (frame.parentJoint, _Place.of(Pose.from_matrix(frame.placement.homogeneous))) for frame in bodies
    }
    solids = [(s.name, _measure(s.geometry, s.pose)) for s in robot_solids(gripper) if links[s.name][0] > 0]
    return model, links, solids


def _joints(tool: Tool, recording: Recording) -> tuple[Array, Array]:
    """Rotations (J, T, 3, 3) and positions (J, T, 3) of the joints' frames in the world, numbered as in the kinematic
    model; by numpy, for all samples at once, which is a tenth of the time that Pinocchio takes one by one.
    """
    model, _, _ = _robot(tool.gripper)
    count = len(recording.times)
    rotations, positions = np.zeros((model.njoints, count, 3, 3)), np.zeros((model.njoints, count, 3))
    rotations[0] = np.eye(3)
    cosines, sines = np.cos(recording.arm), np.sin(recording.arm)
    for joint in range(1, model.njoints):
        parent, placement = model.parents[joint], model.jointPlacements[joint]
        at = _Place(placement.rotation, placement.translation)
        rotations[joint], positions[joint] = _placed(rotations[parent], positions[parent], at)
        if joint <= len(ARM_JOINTS):  # about z
            turn = np.zeros((count, 3, 3))
            turn[:, 0, 0] = turn[:, 1, 1] = cosines[:, joint - 1]
            turn[:, 1, 0], turn[:, 0, 1] = sines[:, joint - 1], -sines[:, joint - 1]
            turn[:, 2, 2] = 1.0
            rotations[joint] = rotations[joint] @ turn
        else:  # along y, the second finger's frame the other way
            side = 1.0 if model.names[joint] == FINGER_JOINTS[0] else -1.0
            opening = recording.fingers[:, FINGER_JOINTS.index(model.names[joint])]
            positions[joint] += side * opening[:, None] * rotations[joint][:, :, 1]
    return rotations, positions


def _robot_tracks(tool: Tool, recording: Recording) -> list[_Track]:
    _, links, solids = _robot(tool.gripper)
    rotations, positions = _joints(tool, recording)

    @cache
    def frames(link: str) -> tuple[Array, Array]:
        joint, at = links[link]
        return _placed(rotations[joint], positions[joint], at)

    tracks = [_Track.make(name, "the robot", solid, *frames(name)) for name, solid in solids]
    return tracks + [_Track.make(name, "the robot", solid, *frames(link)) for name, link, solid in _tool_solids(tool)]


@lru_cache(maxsize=8)
def _tool_solids(tool: Tool) -> list[tuple[str, str, _Measured]]:
    """Of each component its name, the link that it is on, and its solid."""
    placed = tool.placed()
    return [(part.name, placed[part.name][0], _measured(part.shape, placed[part.name][1])) for part in tool.components]


def _body_tracks(scene: Scene, recording: Recording) -> list[_Track]:
    states = recording.states
    quaternions = states.quaternions.reshape(-1, 4)
    matrices = Rotation.from_quat(quaternions, scalar_first=True).as_matrix() if len(quaternions) else np.empty(0)
    rotations = matrices.reshape(*states.quaternions.shape[:2], 3, 3)
    number = {name: i for i, name in enumerate(states.names)}
    tracks = []
    for body in scene.bodies:
        if body.fixed:
            tracks += [_standing(body.name, part.shape, part.pose, body.pose) for part in body.collisions]
            continue
        i = number[body.name]
        turned, positions = np.ascontiguousarray(rotations[:, i]), np.ascontiguousarray(states.positions[:, i])
        for part in body.collisions:
            solid = _measured(part.shape, part.pose)
            tracks.append(_Track.make(body.name, body.name, solid, turned, positions))
    return tracks


@lru_cache(maxsize=256)
def _standing(name: str, shape: Shape, pose: Pose, body: Pose) -> _Track:
    """Of a part of a body that can't move; the same for every rollout in a scene."""
    at = body.rotation.as_matrix()[None], body.position[None]
    return _Track.make(name, name, _measured(shape, pose), *at)


# --- passing through --------------------------------------------------------------------------------------------


def _passages(robot: Sequence[_Track], bodies: Sequence[_Track], times: Array) -> list[Finding]:
    found: dict[tuple[str, str], tuple[float, str]] = {}
    for one, other, near, way in _meetings(robot, bodies):
        passage = _passage(one, other, near, way, times)
        if passage is not None:
            names = one.name, other.name
            found[names] = min(found.get(names, passage), passage)
    return [Finding(f"{one!r} {what.format(repr(other))}", True) for (one, other), (_, what) in found.items()]


def _meetings(
    robot: Sequence[_Track], bodies: Sequence[_Track]
) -> Iterator[tuple[_Track, _Track, npt.NDArray[np.intp], Array]]:
    """Pairs whose bounding boxes are ever as deep in each other as counts, at least one of the two in motion; the
    samples at which the boxes meet or are about to, rising; and how far a point of the first can have gone in the frame
    of the second, (T,).
    """
    moving = [track for track in (*robot, *bodies) if len(track.way) > 1]
    if not moving:
        return
    low = np.array([track.low.T for track in moving]).swapaxes(0, 1).copy()  # (3, M, T)
    high = np.array([track.high.T for track in moving]).swapaxes(0, 1).copy()
    lowest, highest = low.min(axis=2), high.max(axis=2)
    reaches = np.array([t.reach for t in moving])
    order = {id(track): i for i, track in enumerate(moving)}
    for other in bodies:
        count = order.get(id(other), len(moving))  # of two bodies that move, each pair once
        below, above = other.low.min(axis=0)[:, None], other.high.max(axis=0)[:, None]
        if not ((lowest[:, :count] <= above) & (highest[:, :count] >= below)).all(axis=0).any():
            continue
        near = np.ones((count, low.shape[2]), dtype=bool)
        for axis in range(3):
            near &= low[axis, :count] <= other.high[:, axis]
            near &= high[axis, :count] >= other.low[:, axis]
        met = [i for i in np.flatnonzero(near.any(axis=1)) if moving[i].of != other.of]
        # Solids are no deeper in each other than their boxes along any axis.
        depths = np.minimum(high[:, met] - other.low.T[:, None], other.high.T[:, None] - low[:, met]).min(axis=0)
        deepest = depths.max(axis=1).tolist()
        met = [i for i, depth in zip(met, deepest, strict=True) if depth >= min(_limits(moving[i], other))]
        if not met:
            continue
        if len(other.way) == 1:
            yield from ((moving[i], other, np.flatnonzero(near[i]), moving[i].way) for i in met)
            continue
        positions = np.array([moving[i].positions for i in met]) - other.positions
        rotations = np.array([moving[i].rotations for i in met])
        if not isinstance(other.shape, Sphere):  # whose frame does not turn
            back = other.rotations.swapaxes(1, 2)
            positions, rotations = (back @ positions[..., None])[..., 0], back @ rotations
        ways = _ways(rotations, positions, reaches[met])
        yield from ((moving[i], other, np.flatnonzero(near[i]), way) for i, way in zip(met, ways, strict=True))


def _ways(rotations: Array, positions: Array, reaches: Array) -> Array:
    """How far points can have gone since the first sample, (N, T), if they are within reaches (N,) of frames with
    rotations (N, T, 3, 3) and positions (N, T, 3).
    """
    shifts = positions[:, 1:] - positions[:, :-1]
    steps = np.sqrt(np.einsum("nti,nti->nt", shifts, shifts))
    turning = np.flatnonzero(reaches)
    if len(turning):
        traces = np.einsum("ntij,ntij->nt", rotations[turning, 1:], rotations[turning, :-1])  # of the turns
        steps[turning] += reaches[turning, None] * np.arccos(np.clip((traces - 1) / 2, -1.0, 1.0))
    return np.concatenate([np.zeros((len(steps), 1)), np.cumsum(steps, axis=1)], axis=1)


def _limits(one: _Track, other: _Track) -> tuple[float, float]:
    """From what depth on two things are too deep in each other, and one may have passed through the other, metres."""
    across = one.thick + other.thick
    return min(DEEP_M, max(across / 2, min(THIN_M, 0.9 * across))), THROUGH * across


def _passage(
    one: _Track, other: _Track, near: npt.NDArray[np.intp], way: Array, times: Array
) -> tuple[float, str] | None:
    """When one got into the other, seconds, and how it is told; None: it never did."""
    deep, through = _limits(one, other)
    limit = min(deep, through)
    gaps = _gaps(one, other)
    # From one sample to the next, a gap can't shrink and grow again by more than the way allows.
    if gaps is not None and ((gaps[:-1] + gaps[1:] - way[1:] + way[:-1]) / 2).take(near, mode="clip").min() > -limit:
        return None
    distance = coal.ComputeDistance(other.geometry, one.geometry)
    samples, gone, instants = near.tolist(), way.tolist(), times.tolist()  # faster one by one
    last = len(gone) - 1
    # The way out of ``other`` when the two last only touched, if at all; before that nothing counts.
    entry: _Way | None = None
    reached = 0.0  # how deep since then
    since, stuck = 0.0, None  # when it got in, and since which sample it is too deep
    k, share = samples[0], 0.0
    while True:
        depth, out = _look(distance, one, other, k, share)
        if depth < (limit if entry is None else 0.0):
            if entry is not None and reached >= through and out.along(entry) < 0.5:
                return since, f"passed through {{}} at {since:.2f} s"
            entry, reached = out, 0.0
        if depth >= limit and entry is not None:
            now = instants[k] + (share * (instants[k + 1] - instants[k]) if share else 0.0)
            since = now if reached < limit else since
            reached = max(reached, depth)
        if depth < deep:
            stuck = None
        elif share == 0 and entry is not None:
            stuck = instants[k] if stuck is None else stuck
            if instants[k] - stuck >= DEEP_S:
                return stuck, f"was {1000 * reached:.0f} mm deep inside {{}} at {stuck:.2f} s"
        ahead = gone[k] + (share * (gone[k + 1] - gone[k]) if share else 0.0)
        if depth >= limit:
            if k == last:
                return None
            ahead = min(ahead + limit, gone[k + 1])
            k, share = (k + 1, 0.0) if ahead >= gone[k + 1] else (k, share)
            if ahead == gone[k]:
                continue
        else:
            ahead += max(limit - depth, limit / 4) if -depth < _FROM_AFAR_M else -depth
            if ahead > gone[last]:
                return None
            further = bisect_right(gone, ahead) - 1
            if further > k:
                k, share = further, 0.0
                if depth < 0:
                    at = bisect_left(samples, k)
                    if at == len(samples):
                        return None
                    k = samples[at]
                continue
        share = (ahead - gone[k]) / (gone[k + 1] - gone[k])


def _gaps(one: _Track, other: _Track) -> Array | None:
    """Between a ball and a ball, box or cylinder (T,), metres, negative where they overlap; None for other pairs."""
    ball, solid = (one, other) if isinstance(one.shape, Sphere) else (other, one)
    if not isinstance(ball.shape, Sphere):
        return None
    gaps: Array
    match solid.shape:
        case Sphere(radius):
            offsets = ball.positions - solid.positions
            gaps = np.sqrt(np.einsum("ti,ti->t", offsets, offsets)) - radius - ball.shape.radius
            return gaps
        case Box(size):
            beyond = np.abs(_inside(ball, solid)) - np.asarray(size) / 2
        case Cylinder(radius, length):
            x, y, z = _inside(ball, solid).T
            beyond = np.column_stack([np.hypot(x, y) - radius, np.abs(z) - length / 2])
        case _:
            return None
    outside = np.maximum(beyond, 0.0)
    gaps = np.sqrt((outside * outside).sum(axis=1)) + np.minimum(beyond.max(axis=1), 0.0) - ball.shape.radius
    return gaps


def _inside(one: _Track, other: _Track) -> Array:
    """Positions (T, 3) of the one in the frame of the other."""
    return ((one.positions - other.positions)[:, None] @ other.rotations)[:, 0]


class _Way(NamedTuple):
    """A way out of a solid that is turned so: a direction (3,) in the world, and the solid's rotation (3, 3)."""

    direction: Array
    rotation: Array

    def along(self, other: _Way) -> float:
        """The cosine between the two, each in the solid's own frame."""
        return float(self.direction @ self.rotation @ (other.direction @ other.rotation))


def _look(distance: Any, one: _Track, other: _Track, k: int, share: float) -> tuple[float, _Way]:
    """How deep the two are in each other, metres, negative if they are apart; and the way out for ``one``. ``distance``
    is Coal's, from ``other`` to ``one``.
    """
    at, _ = one.at(k, share)
    others_at, others_rotation = other.at(k, share)
    result = coal.DistanceResult()
    depth = -float(distance(others_at, at, _REQUEST, result))
    return depth, _Way(result.normal, others_rotation)


# --- flung ------------------------------------------------------------------------------------------------------


def _flung(recording: Recording, robots_fastest: float) -> list[Finding]:
    """Bodies faster than anything here can have made them, beyond what a fall gives; and bodies that are far away.

    Raises:
        Explosion: one is faster than `EXPLODED_M_S`.
    """
    states, found = recording.states, []
    fallen = np.maximum(states.positions[:1, :, 2] - states.positions[:, :, 2], 0.0)
    squares = (states.linear_velocities**2).sum(axis=2) - 2 * _GRAVITY * fallen
    fastest = np.sqrt(np.maximum(squares, 0.0).max(axis=0))
    farthest = np.linalg.norm(states.positions[:, :, :2], axis=2).max(axis=0)
    for name, speed, far in zip(states.names, fastest, farthest, strict=True):
        if speed > EXPLODED_M_S:
            raise Explosion(f"{name!r} reached {speed:.0f} m/s")
        if speed > max(FLUNG_M_S, FLUNG_TIMES * robots_fastest):
            found.append(
                Finding(f"{name!r} was flung: it reached {speed:.1f} m/s, the robot {robots_fastest:.1f} m/s", False)
            )
        elif far > LOST_M:
            found.append(Finding(f"{name!r} was flung: it got {far:.1f} m away", False))
    return found
