"""Turn a head's path into end-effector waypoints, choose what these stand by, and check reach and collisions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.random import Generator
from scipy.spatial.transform import Rotation, Slerp

from core.geometry import Array, Pose
from core.interfaces import Anchor, Seen
from core.robot.kinematics import Arm
from plugins.vlms.offline.boxes import Boxes, overlaps
from plugins.vlms.offline.scene_analysis import UP, SceneAnalysis, Subgoal

_SEGMENT_S = 0.5  # minimum duration of a segment
_MOST_SEGMENTS = 10  # of a straight motion
_STEP_M = 0.04  # between collision checks
_CONTACT_M = 0.001  # a smaller overlap is only a contact
_APART_M = 0.03  # two bodies that are nearer give no direction


@dataclass
class Path:
    """Poses of a head in the world, one per waypoint, with the gripper's value.

    ``touching`` marks the waypoints on the way to which the head may touch the bodies of its subgoal. ``ends`` has, for
    each subgoal, the number of waypoints at its end, and the number of the one from which on its bodies are moved.
    ``anchors`` are what the waypoints stand by, ``texts`` describe the primitives.
    """

    poses: list[Pose] = field(default_factory=list)
    grips: list[float] = field(default_factory=list)
    touching: list[bool] = field(default_factory=list)
    ends: list[tuple[int, int]] = field(default_factory=list)
    held: int | None = None
    anchors: list[Anchor] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)

    def go(
        self,
        turn: float | Pose,
        *positions: Array,
        grip: float = 0.0,
        touch: bool = False,
    ) -> None:
        """Add positions of the head at a heading, or turned as a pose is."""
        for position in positions:
            pose = (
                Pose(position, turn.quaternion)
                if isinstance(turn, Pose)
                else Pose.xyz_rpy(position, (0, 0, turn))
            )
            self.add(pose, grip=grip, touch=touch)

    def add(self, pose: Pose, *, grip: float = 0.0, touch: bool = False) -> None:
        self.poses.append(pose)
        self.grips.append(grip)
        self.touching.append(touch)

    def enter(
        self, subgoal: Subgoal, turn: float | Pose, position: Array, *others: Array
    ) -> None:
        """Come down to a position from above everything near, and go on to others."""
        rise = max(0.03, subgoal.clear_z - float(position[2]) + 0.03)
        self.go(turn, position + rise * UP, position, *others)

    def move(
        self, end: Array, heading: float, speed: float, *, grip: float = 0.0
    ) -> None:
        """Add segments to ``end``, as many as give the head a speed of about ``speed`` metres per second."""
        start = self.poses[-1].position
        count = int(
            np.clip(
                np.ceil(np.linalg.norm(end - start) / (speed * _SEGMENT_S)),
                1,
                _MOST_SEGMENTS,
            )
        )
        for share in np.linspace(0.0, 1.0, count + 1)[1:]:
            self.go(heading, start + share * (end - start), grip=grip, touch=True)

    def follow(self, motion: Iterable[Pose]) -> Pose:
        """Move the head as a body moves, by displacements in the world; returns where the head ends."""
        head = self.poses[-1]
        for moved in motion:
            self.add(moved @ head, touch=True)
        return self.poses[-1]

    @property
    def lowest(self) -> float:
        """The height of the lowest waypoint, metres."""
        return min(float(pose.position[2]) for pose in self.poses)

    def hold(self) -> None:
        """Note that the bodies are in the head's hold now; without it they are moved from the first touch on."""
        self.held = len(self.poses) - 1

    def end(self) -> None:
        """End a subgoal."""
        first = self.ends[-1][0] if self.ends else 0
        touched = (
            self.touching.index(True, first)
            if True in self.touching[first:]
            else len(self.poses)
        )
        self.ends.append(
            (
                len(self.poses),
                self.held if self.held is not None else max(first, touched - 1),
            )
        )
        self.held = None

    def plan(self, head: Pose, gripper: bool) -> Array:
        """Waypoints (N, 6), or (N, 7) with the gripper, of an end-effector that has the head at the pose ``head``."""
        back = head.inverse()
        mounts = [pose @ back for pose in self.poses]
        rows = np.array(
            [np.concatenate([mount.position, mount.rpy]) for mount in mounts]
        )
        return np.column_stack([rows, self.grips]) if gripper else rows


def reach_error(plan: Array, arm: Arm) -> float:
    """The worst error of inverse kinematics over the waypoints, in metres plus 0.2 times radians."""
    joints = arm.home
    worst = 0.0
    for row in plan:
        solution = arm.inverse(Pose.xyz_rpy(row[:3], row[3:6]), joints)
        joints = solution.joints
        worst = max(worst, solution.error_m + 0.2 * solution.error_rad)
        if worst > 0.1:
            break
    return worst


def collisions(
    plan: Array,
    touching: Sequence[bool],
    tool: Boxes,
    home: Pose,
    moved: Boxes,
    others: Boxes,
) -> int:
    """Count overlaps of the tool's boxes on the straight ways between waypoints: with ``others``, and with ``moved``
    on ways where the head must not touch them.
    """
    rows = np.vstack([np.concatenate([home.position, home.rpy]), plan[:, :6]])
    turns = Rotation.from_euler("xyz", rows[:, 3:6])
    count = 0
    for i, touch in enumerate(touching):
        steps = max(
            2, int(np.ceil(np.linalg.norm(rows[i + 1, :3] - rows[i, :3]) / _STEP_M)) + 1
        )
        share = np.linspace(0.0, 1.0, steps)
        positions = rows[i, :3] + share[:, None] * (rows[i + 1, :3] - rows[i, :3])
        rotations = Slerp([0.0, 1.0], turns[i : i + 2])(share).as_matrix()
        carried = tool.carried(positions, rotations)
        count += overlaps(carried, others, margin=-_CONTACT_M)
        if not touch:
            count += overlaps(carried, moved, margin=-_CONTACT_M)
    return count


def anchors_of(path: Path, subgoals: Sequence[Subgoal], rng: Generator) -> list[Anchor]:
    """Choose an anchor for each waypoint of a path through the subgoals.

    Until the bodies are moved it is by them, or by what contains them; then it goes over to where the goal wants them.
    """
    positions = np.array([pose.position for pose in path.poses])
    anchors = []
    first = 0
    for subgoal, (last, contact) in zip(subgoals, path.ends, strict=False):
        base = _base(subgoal, rng)
        goal = subgoal.reference
        shares = np.zeros(last - first)
        if goal is not None and goal != base.name and subgoal.length > _APART_M:
            along = (
                (positions[first:last] - positions[contact])
                @ (subgoal.shift * [1.0, 1.0, 0.0])
                / subgoal.length
            )
            shares = np.clip(
                along / max(float(along.max()), subgoal.length), 0.0, 1.0
            ).round(3)
            shares[: contact - first] = 0.0
        for share in shares.tolist():
            toward = (
                goal if goal is not None and (share or base.toward) else base.toward
            )
            anchors.append(replace(base, toward=toward, share=share))
        first = last
    return anchors


def turn_of(analysis: SceneAnalysis, seen: Seen) -> Pose | None:
    """Compute a turn about the robot after which the axes of what the bodies are taken by are the world's.

    None: they are not taken along its axes, or there is nothing to turn.
    """
    goal = analysis.groups[0][0]
    solids = [analysis.solids[name] for name in goal.bodies]
    name = analysis.container(solids[:1] if goal.any else solids)
    if name is None and len(solids) == 1 and goal.reference in (None, goal.bodies[0]):
        (name,) = goal.bodies
    yaw = 0.0 if name is None else -float(seen.poses[name].rpy[2])
    base = Pose(analysis.space.base)
    return (
        base @ Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, yaw)) @ base.inverse()
        if yaw
        else None
    )


def _base(subgoal: Subgoal, rng: Generator) -> Anchor:
    """Choose the frame in which the bodies are taken."""
    container = subgoal.analysis.container(subgoal.solids)
    if container is not None:
        return Anchor(container, axes="anchor")
    if len(subgoal.solids) > 1:  # they are scattered otherwise in each layout
        return Anchor(toward=subgoal.reference or "")
    (solid,) = subgoal.solids
    name = solid.body.name
    reference = subgoal.analysis.solids.get(subgoal.reference or "")
    away = (
        subgoal.reference is not None
        and subgoal.reference != name
        and subgoal.length > _APART_M
    )
    if reference is not None:  # it may be below
        away = (
            away
            and float(np.hypot(*(reference.position - solid.position)[:2])) > _APART_M
        )
    if away and (subgoal.alone or rng.random() < 0.8):
        return Anchor(name, toward=subgoal.reference or "")
    return Anchor(name, axes="anchor")
