"""Where a body can be pushed so that its joint moves, and how that point moves with it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import product

import numpy as np

from core.geometry import Array, Box, Pose
from core.robot.solids import Solid, bounding_box, contact, solid_geometry
from core.values.joints import PlacedJoint, Placement
from plugins.vlms.offline.heads import Size
from plugins.vlms.offline.job import Job

_ROD_M = 0.02  # wide, as what comes to a point is taken
_OFF_M = 0.004  # a face, that is looked for what is before it
_HEAD_ON = 0.7  # the cosine of how far off its way a face may be pushed, at most
_ROOM_M = 0.07  # wide, what bears a rod needs behind it,
_HIGH_M = 0.3  # and from there up
_SHARES = (-0.8, -0.4, 0.0, 0.4, 0.8)  # of half a face, where points are taken
_MOST_M = 0.4  # long, a rod is at most
_STEP_M = 0.02  # between two lengths that are tried
_LEAST_M = 1e-3  # a point moves by less for a metre or radian: it is on the axis
_LEAST_LEVER = 0.5  # of the longest lever


@dataclass(frozen=True, eq=False)
class Spot:
    """A point on a body where pushing moves the joint that holds it.

    Attributes:
        joint: in the layout.
        parent: the pose of what holds it.
        point: in the world, (3,), at the start.
        way: that it moves, as a unit vector of the world, (3,), at the start.
        lever: how far it moves, m, for a metre or radian of the joint.
        depth: how far back along the way there is no room for what bears a rod, metres.
    """

    joint: PlacedJoint
    parent: Pose
    point: Array
    way: Array
    lever: float
    depth: float = 0.0

    def carry(self, value: float) -> Pose:
        """Return how the body has moved when the joint is there, in the world: the pose that its start gets."""
        start = _place(self.joint, self.parent, self.joint.joint.start)
        return _place(self.joint, self.parent, value) @ start.inverse()

    @cached_property
    def turns(self) -> bool:
        """Whether the body turns as it moves."""
        return self.joint.joint.kind == "hinge"


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
    """Yield the points on the faces of a body's parts that are pushed the way that a job wants the joint to go."""
    scene = job.layout.scene
    joint = scene.placed_joints[job.want.joint]
    if joint.joint.kind == "ball":
        return

    parent = scene[joint.joint.parent].pose if joint.joint.parent else Pose()
    start = joint.joint.start
    sign = float(np.sign(job.want.to - start))
    step = 1e-4 * sign
    before = _place(joint, parent, start)
    moved = _place(joint, parent, start + step) @ before.inverse()

    for solid in job.layout.solids[joint.joint.body]:
        for point, normal in _list_faces(solid):
            shift = moved.apply(point) - point
            lever = float(np.linalg.norm(shift) / abs(step))
            way = shift / max(float(np.linalg.norm(shift)), 1e-12)
            if lever < _LEAST_M or -normal @ way < _HEAD_ON:
                continue
            yield Spot(joint, parent, point, way, lever)


def _list_faces(solid: Solid) -> Iterator[tuple[Array, Array]]:
    """Yield points on the faces of the box around a solid, with the faces' normals, in the world."""
    middle, half = bounding_box(solid.geometry)
    for axis, side in product(range(3), (-1.0, 1.0)):
        normal = np.zeros(3)
        normal[axis] = side
        for shares in product(_SHARES, repeat=2):
            place = np.insert(shares, axis, side)
            point = solid.pose.apply(middle + place * half)
            yield point, solid.pose.rotation.apply(normal)


def _measure_depth(job: Job, point: Array, way: Array) -> float | None:
    """Measure how far back a rod must reach, until there is room for what bears it; None: it doesn't get to a point."""
    for back in np.arange(_STEP_M, _MOST_M, _STEP_M):
        foot = aim(point - (_OFF_M + back / 2) * way, way)
        if meets_anything(job, foot, (back, _ROD_M, _ROD_M)):
            return None

        end = point - (back + _ROOM_M / 2) * way
        over = Pose(end + np.array([0.0, 0.0, (_HIGH_M - _ROD_M) / 2]))
        if not meets_anything(job, over, (_ROOM_M, _ROOM_M, _HIGH_M)):
            return float(back)

    return None


def meets_anything(job: Job, pose: Pose, size: Size) -> bool:
    """Report whether a box at a pose in the world meets anything."""
    box = Solid("room", solid_geometry(Box(size)), pose)
    obstacles = job.layout.all_solids
    return any(contact(box, other)[0] < 0.0 for other in obstacles.near(box, 0.0))


def aim(point: Array, way: Array) -> Pose:
    """Return the pose at a point whose x points along a unit vector (3,), and whose y is level."""
    yaw = float(np.arctan2(way[1], way[0]))
    pitch = -float(np.arcsin(np.clip(way[2], -1.0, 1.0)))
    return Pose.xyz_rpy(point, (0.0, pitch, yaw))


def _place(joint: PlacedJoint, parent: Pose, value: float) -> Pose:
    """Place the body of a joint in the world, when the joint has a value."""
    there = joint.carry(np.array(value), np.zeros(()), Placement.at_rest(parent))
    return Pose(there.position, there.quaternion)
