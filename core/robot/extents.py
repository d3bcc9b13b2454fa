"""Measure the space that links take, each by itself, and the fingers of a gripper."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from core.design import GRIPPER_MOUNTS
from core.geometry import Array, Pose
from core.robot.kinematics import open_mounts
from core.robot.solids import corners, robot_solids
from core.values.robots import Robot

Extent = tuple[Array, Array]  # the lowest and the highest x, y and z, metres


class Finger(NamedTuple):
    """A finger of the open gripper."""

    name: str  # of its link, a mount
    pose: Pose  # of its frame in that of the tool mount
    extent: Extent  # of its collision shapes, in its frame
    opens: Array  # the axis of its frame (3,), perhaps reversed, along which it opens
    tip: Array  # the axis of its frame (3,), perhaps reversed, that leads to its tip

    def face(self, way: Array) -> float:
        """Find where it ends along an axis of its frame (3,), perhaps reversed: a coordinate on this axis, metres."""
        return float(np.abs(way) @ self.extent[int(way.sum() > 0)])

    def place(self, way: Array) -> Array:
        """Place this end (3,) in the frame of the tool mount."""
        return self.pose.apply(np.abs(way) * self.face(way))


def link_extents(robot: Robot, gripper: bool) -> dict[str, Extent]:
    """Measure the collision shapes of each link that has some, in its own frame."""
    return extents_of(
        (solid.name, solid.pose.apply(corners(solid.geometry)))
        for solid in robot_solids(robot, gripper)
    )


def extents_of(placed: Iterable[tuple[str, Array]]) -> dict[str, Extent]:
    """Find the extents of named groups of points (N, 3); several of one name are one."""
    found: dict[str, Extent] = {}
    for name, points in placed:
        low, high = found.get(name, (points[0], points[0]))
        lowest = np.minimum(low, points.min(axis=0))
        found[name] = lowest, np.maximum(high, points.max(axis=0))
    return found


@lru_cache(maxsize=8)
def fingers_of(robot: Robot) -> tuple[Finger, ...]:
    """Measure the fingers of the open gripper, the left one first; none without a gripper."""
    if robot.gripper is None:
        return ()
    poses = open_mounts(robot, True)
    extents = link_extents(robot, True)
    found = []
    for name, joint in zip(GRIPPER_MOUNTS, robot.gripper.joints, strict=True):
        opens = _nearest_axis(robot.description.named[joint].direction)
        tip = _nearest_axis(poses[name].rotation.inv().apply((0.0, 0.0, -1.0)))
        found.append(Finger(name, poses[name], extents[name], opens, tip))
    return tuple(found)


def _nearest_axis(way: Array) -> Array:
    """Return the unit vector along an axis that is nearest to a way (3,)."""
    longest = np.abs(way).argmax()
    axis = np.zeros(3)
    axis[longest] = np.sign(way[longest])
    return axis
