"""Plans: where the head goes, from that where the end-effector goes, and whether the arm and the scene allow it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from core.geometry import Array, Pose
from core.robot.kinematics import arm
from plugins.vlms.offline.boxes import Boxes, overlaps

_SEGMENT_S = 0.5  # the least that a segment lasts
_MOST_SEGMENTS = 10  # of a stroke
_STEP_M = 0.04  # between the places where collisions are looked for
_CONTACT_M = 0.001  # boxes that overlap by less only touch


@dataclass
class Path:
    """Poses of a head in the world, one per waypoint, with the gripper's value; ``touching`` says on the way to which
    of them the head is meant to touch the bodies of its errand."""

    poses: list[Pose] = field(default_factory=list)
    grips: list[float] = field(default_factory=list)
    touching: list[bool] = field(default_factory=list)

    def go(
        self,
        position: Array,
        heading: float,
        *,
        pitch: float = 0.0,
        roll: float = 0.0,
        grip: float = 0.0,
        touch: bool = False,
    ) -> None:
        self.poses.append(Pose.xyz_rpy(position, (roll, pitch, heading)))
        self.grips.append(grip)
        self.touching.append(touch)

    def stroke(self, end: Array, heading: float, speed: float, *, grip: float = 0.0) -> None:
        """To ``end`` in so many segments that the head moves at about ``speed`` metres a second."""
        start = self.poses[-1].position
        count = int(np.clip(np.ceil(np.linalg.norm(end - start) / (speed * _SEGMENT_S)), 1, _MOST_SEGMENTS))
        for share in np.linspace(0.0, 1.0, count + 1)[1:]:
            self.go(start + share * (end - start), heading, grip=grip, touch=True)

    def plan(self, head: Pose, gripper: bool) -> Array:
        """Waypoints (N, 6), or with the gripper (N, 7), of the end-effector with the head at the pose ``head``."""
        back = head.inverse()
        mounts = [pose @ back for pose in self.poses]
        rows = np.array([np.concatenate([mount.position, mount.rpy]) for mount in mounts])
        return np.column_stack([rows, self.grips]) if gripper else rows


def reach_error(plan: Array) -> float:
    """The worst miss of the waypoints, metres and (weighed) radians, by inverse kinematics from one to the next."""
    joints, worst = arm().home, 0.0
    for row in plan:
        solution = arm().inverse(Pose.xyz_rpy(row[:3], row[3:6]), joints)
        joints = solution.joints
        worst = max(worst, solution.error_m + 0.2 * solution.error_rad)
        if worst > 0.1:
            break
    return worst


def collisions(plan: Array, touching: Sequence[bool], tool: Boxes, home: Pose, moved: Boxes, others: Boxes) -> int:
    """How often boxes of the tool meet what they should not on the straight ways between waypoints: ``others`` always,
    and ``moved`` until the head is meant to touch them."""
    rows = np.vstack([np.concatenate([home.position, home.rpy]), plan[:, :6]])
    turns = Rotation.from_euler("xyz", rows[:, 3:6])
    count = 0
    for i, touch in enumerate(touching):
        steps = max(2, int(np.ceil(np.linalg.norm(rows[i + 1, :3] - rows[i, :3]) / _STEP_M)) + 1)
        share = np.linspace(0.0, 1.0, steps)
        positions = rows[i, :3] + share[:, None] * (rows[i + 1, :3] - rows[i, :3])
        rotations = Slerp([0.0, 1.0], turns[i : i + 2])(share).as_matrix()
        carried = tool.carried(positions, rotations)
        count += overlaps(carried, others, margin=-_CONTACT_M)
        if not touch:
            count += overlaps(carried, moved, margin=-_CONTACT_M)
    return count
