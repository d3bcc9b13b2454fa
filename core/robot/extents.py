"""Measure the fingers of a gripper."""

from __future__ import annotations

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
    """A finger of the open gripper: where it is, how large it is, and which way it points.

    For example, how far below the flange the tips are, and how wide the gap between the fingers is::

        left, right = fingers_of(robot)
        depth = -left.place(left.tip)[2]
        gap = np.linalg.norm(left.place(-left.opens) - right.place(-right.opens))

    Attributes:
        name: of its link, a mount.
        pose: of its frame in that of the tool mount.
        extent: of its collision shapes, in its frame.
        opens: the axis of its frame (3,), perhaps reversed, along which it opens.
        tip: the axis of its frame (3,), perhaps reversed, that leads to its tip.
    """

    name: str
    pose: Pose
    extent: Extent
    opens: Array
    tip: Array

    def face(self, way: Array) -> float:
        """Find where the finger ends in a direction.

        Args:
            way: an axis of its frame (3,), perhaps reversed, such as ``tip`` or ``-opens``.

        Returns:
            The coordinate of this end on the axis, metres; below 0 where it lies on the axis's negative side.
        """
        return float(np.abs(way) @ self.extent[int(way.sum() > 0)])

    def place(self, way: Array) -> Array:
        """Place the end that `face` finds in the frame of the tool mount, (3,) metres."""
        return self.pose.apply(np.abs(way) * self.face(way))


@lru_cache(maxsize=8)
def fingers_of(robot: Robot) -> tuple[Finger, ...]:
    """Measure the fingers of the open gripper.

    Returns:
        The left one and the right one; none without a gripper.
    """
    if robot.gripper is None:
        return ()

    poses = open_mounts(robot, True)
    solids = robot_solids(robot, True)
    fingers = []

    for name, joint in zip(GRIPPER_MOUNTS, robot.gripper.joints, strict=True):
        opens = _nearest_axis(robot.description.named[joint].direction)
        tip = _nearest_axis(poses[name].rotation.inv().apply((0.0, 0.0, -1.0)))

        shapes = [solid for solid in solids if solid.name == name]
        points = [solid.pose.apply(corners(solid.geometry)) for solid in shapes]
        around = np.concatenate(points)
        extent = around.min(axis=0), around.max(axis=0)

        fingers.append(Finger(name, poses[name], extent, opens, tip))

    return tuple(fingers)


def _nearest_axis(way: Array) -> Array:
    """Return the unit vector along an axis that is nearest to a way (3,)."""
    longest = np.abs(way).argmax()
    axis = np.zeros(3)
    axis[longest] = np.sign(way[longest])

    return axis
