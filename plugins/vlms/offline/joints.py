"""Where a body can be pushed so that its joint moves, and how that point moves with it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product

import numpy as np

from core.geometry import Array, Pose, Sphere
from core.robot.solids import Solid, bounding_box, contact, solid_geometry
from core.values.joints import PlacedJoint, Placement
from plugins.vlms.offline.job import Job

_SHARES = (-0.8, -0.4, 0.0, 0.4, 0.8)  # of half a side, where points are taken
_EYE_AWAY_M = 0.01  # before a side, the nearest point of the body is looked for
_HEAD_ON = 0.89  # the cosine of 26 degrees from a surface's normal: a friction of 0.5 holds a rod there
_LEAST_LEVER = 0.5  # of the longest lever: what is nearer to an axis takes more force
_ON_AXIS_M = 1e-3  # a point that moves by less for a metre or radian lies on the axis
_NUDGE = 1e-4  # metres or radians of a joint, to see which way points move

_EYE = solid_geometry(Sphere(1e-6))
_ROD_M = 0.02  # as wide as a rod, with a little room
_ROD_LENGTH_M = 0.4  # at most: longer ones are not stiff
_LENGTH_STEP_M = 0.02  # between two lengths that are tried
_OFF_M = 0.004  # a face begins the room for a rod, so as not to meet the face itself
_BEARER_M = 0.07  # as wide as what comes down and bears a rod, with room for its socket
_BEARER_HEIGHT_M = 0.3  # of that, from the rod up: there it may turn aside


@dataclass(frozen=True, eq=False)
class Spot:
    """A point on a body where pushing moves the joint that holds it.

    Attributes:
        joint: in the layout.
        parent: the pose of what holds it.
        point: in the world, (3,), at the start.
        way: that it moves, as a unit vector of the world, (3,), at the start.
        lever: how far it moves, m, for a metre or radian of the joint.
        depth: how long a rod must be, until there is room for what bears it, metres; 0: that is not measured.
    """

    joint: PlacedJoint
    parent: Pose
    point: Array
    way: Array
    lever: float
    depth: float = 0.0

    @property
    def turns(self) -> bool:
        """Whether the body turns as it moves."""
        return self.joint.joint.kind == "hinge"

    @property
    def springs_back(self) -> bool:
        """Whether the joint goes back when it is let go."""
        return self.joint.joint.springs_back

    def carry(self, to: float, farther: float, count: int) -> Iterator[Pose]:
        """Yield how the body has moved on its joint's way, in the world: the pose that a frame at the world's gets.

        Args:
            to: the position that the joint has to get to.
            farther: than that, as a share of the way.
            count: of poses, at even distances; the last one is the end.
        """
        start = self.joint.joint.start
        begin = _place(self.joint, self.parent, start).inverse()
        way = (to - start) * (1 + farther)
        for share in np.linspace(0.0, 1.0, count + 1)[1:]:
            yield _place(self.joint, self.parent, start + share * way) @ begin


@lru_cache(maxsize=32)
def find_spots(job: Job) -> list[Spot]:
    """Find where a body can be pushed by a rod, so that its joint gets where a job wants it; the best levers alone."""
    found = []
    for spot in list_spots(job):
        depth = _measure_depth(job, spot.point, spot.way)
        if depth is not None:
            found.append(replace(spot, depth=depth))

    longest = max((spot.lever for spot in found), default=0.0)
    return [spot for spot in found if spot.lever >= _LEAST_LEVER * longest]


def list_spots(job: Job) -> Iterator[Spot]:
    """Yield the points on a body's parts that are pushed the way that a job wants the joint to go."""
    joint = job.layout.scene.placed_joints[job.want.joint]
    if joint.joint.kind == "ball" or job.want.to == joint.joint.start:
        return

    parent = Pose()
    if joint.joint.parent:
        parent = job.layout.scene[joint.joint.parent].pose

    nudge = float(np.copysign(_NUDGE, job.want.to - joint.joint.start))
    before = _place(joint, parent, joint.joint.start)
    nudged = _place(joint, parent, joint.joint.start + nudge) @ before.inverse()

    for solid in job.layout.solids[joint.joint.body]:
        for point, normal in _list_points(solid):
            shift = nudged.apply(point) - point
            moved = float(np.linalg.norm(shift))
            lever = moved / _NUDGE
            if lever < _ON_AXIS_M:
                continue
            way = shift / moved
            if -normal @ way >= _HEAD_ON:
                yield Spot(joint, parent, point, way, lever)


def _list_points(solid: Solid) -> Iterator[tuple[Array, Array]]:
    """Yield points on all sides of a solid's surface, with its normals there, in the world."""
    middle, half = bounding_box(solid.geometry)
    for axis, side in product(range(3), (-1.0, 1.0)):
        for shares in product(_SHARES, repeat=2):
            before = np.insert(shares, axis, side) * half
            before[axis] += side * _EYE_AWAY_M
            eye = Solid("eye", _EYE, Pose(solid.pose.apply(middle + before)))
            gap, _, inward = contact(eye, solid)
            yield eye.pose.position + gap * inward, -inward


def _measure_depth(job: Job, point: Array, way: Array) -> float | None:
    """Measure how long a rod must be that pushes a point: until, at its other end, there is room for what bears it.

    Returns:
        Its length, metres; None: a rod doesn't get to the point, or would be too long.
    """
    for length in np.arange(_LENGTH_STEP_M, _ROD_LENGTH_M, _LENGTH_STEP_M):
        middle = _aim(point - (_OFF_M + length / 2) * way, way)
        if job.layout.meets(middle, (length, _ROD_M, _ROD_M)):
            return None

        end = point - (length + _BEARER_M / 2) * way
        up = np.array([0.0, 0.0, (_BEARER_HEIGHT_M - _ROD_M) / 2])
        bearer = (_BEARER_M, _BEARER_M, _BEARER_HEIGHT_M)
        if not job.layout.meets(Pose(end + up), bearer):
            return float(length)

    return None


def _aim(point: Array, way: Array) -> Pose:
    """Return the pose at a point whose x points along a unit vector (3,), and whose y is level."""
    yaw = float(np.arctan2(way[1], way[0]))
    pitch = -float(np.arcsin(np.clip(way[2], -1.0, 1.0)))
    return Pose.xyz_rpy(point, (0.0, pitch, yaw))


def _place(joint: PlacedJoint, parent: Pose, value: float) -> Pose:
    """Place the body of a joint in the world, when the joint has a value."""
    there = joint.carry(np.array(value), np.zeros(()), Placement.at_rest(parent))
    return Pose(there.position, there.quaternion)
