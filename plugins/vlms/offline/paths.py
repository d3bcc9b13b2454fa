"""The path of a tool's head through the world, which becomes waypoints of the end-effector."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from core.geometry import Array, Pose
from core.interfaces import Anchor
from plugins.vlms.offline.boxes import UP
from plugins.vlms.offline.subgoals import Subgoal

_SEGMENT_S = 0.5  # minimum duration of a segment
# Everything near, from where a head comes down, and above its place at least.
_ABOVE_M = 0.03
_MOST_SEGMENTS = 10  # of a straight motion
FAR_TURN_RAD = 1.6
"""A head turns far from here on: an arm gets there by few of its postures."""


@dataclass(frozen=True, eq=False)
class SampledPlan:
    """A plan of the embedded designer.

    Attributes:
        rows: waypoints, (N, 6), or (N, 7) with the gripper.
        text: what it does, in words.
        anchors: what each waypoint stands by.
        touching: whether the head may touch the bodies on the way to each waypoint; empty: it is not known.
    """

    rows: Array
    text: str
    anchors: Sequence[Anchor]
    touching: Sequence[bool] = ()


class Stage(NamedTuple):
    """The part of a path that is for one subgoal: numbers of waypoints."""

    end: int  # the first one after it
    contact: int  # from here on the bodies are moved


@dataclass
class HeadPath:
    """Poses of a head in the world, one per waypoint. A motion primitive adds those for a subgoal.

        path = HeadPath()
        path.descend(subgoal, heading, behind)
        path.move(behind + subgoal.shift, heading, speed=0.2)
        path.end_stage()
        rows = path.to_rows(head_pose, gripper=False)

    Attributes:
        poses: of the head.
        grips: the gripper's value at each waypoint.
        touching: whether the head may touch the subgoal's bodies on the way to each waypoint.
        stages: one for each subgoal that is done with.
        texts: what each primitive does.
        anchors: what each waypoint stands by, once the path is complete.
    """

    poses: list[Pose] = field(default_factory=list)
    grips: list[float] = field(default_factory=list)
    touching: list[bool] = field(default_factory=list)
    stages: list[Stage] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)
    anchors: list[Anchor] = field(default_factory=list)
    _held_from: int | None = None

    @property
    def end(self) -> Array:
        """The last position, (3,)."""
        return self.poses[-1].position

    @property
    def lowest(self) -> float:
        """The height of the lowest waypoint, metres."""
        return min(float(pose.position[2]) for pose in self.poses)

    def add(self, pose: Pose, *, grip: float = 0.0, touch: bool = False) -> None:
        """Add a waypoint; ``touch``: on the way to it the head may touch the bodies."""
        self.poses.append(pose)
        self.grips.append(grip)
        self.touching.append(touch)

    def go(
        self,
        turn: float | Pose,
        *positions: Array,
        grip: float = 0.0,
        touch: bool = False,
    ) -> None:
        """Add positions of the head at a heading, or turned as a pose is.

        Args:
            turn: the heading, radians about z; or a pose that has the turn.
            positions: of the head in the world, (3,) each.
            grip: the gripper's value.
            touch: see `add`.
        """
        if not isinstance(turn, Pose):
            turn = Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, turn))

        for position in positions:
            self.add(Pose(position, turn.quaternion), grip=grip, touch=touch)

    def descend(self, subgoal: Subgoal, turn: float | Pose, position: Array) -> None:
        """Come down to a position from above everything near.

        Args:
            subgoal: whose bodies and neighbours are near.
            turn: see `go`.
            position: of the head in the world, (3,).
        """
        rise = max(_ABOVE_M, subgoal.clear_height - position[2] + _ABOVE_M)
        self.go(turn, position + rise * UP, position)

    def move(
        self,
        end: Array,
        turn: float | Pose,
        speed: float,
        *,
        grip: float = 0.0,
    ) -> None:
        """Add segments to ``end``, as many as give the head a speed of about ``speed`` metres per second.

        Args:
            end: position of the head in the world, (3,).
            turn: see `go`.
            speed: as a segment has its minimum duration.
            grip: the gripper's value.
        """
        start = self.end
        seconds = np.linalg.norm(end - start) / (speed * _SEGMENT_S)
        count = int(np.clip(np.ceil(seconds), 1, _MOST_SEGMENTS))

        for share in np.linspace(0.0, 1.0, count + 1)[1:]:
            self.go(turn, start + share * (end - start), grip=grip, touch=True)

    def follow(self, displacements: Iterable[Pose], *, grip: float = 0.0) -> Pose:
        """Move the head as a body moves, by displacements in the world; return where the head ends."""
        head = self.poses[-1]
        for displacement in displacements:
            self.add(displacement @ head, grip=grip, touch=True)
        return self.poses[-1]

    def turn_about(
        self, middle: Array, turn: Array, step: float, *, grip: float = 0.0
    ) -> Pose:
        """Turn the head as a body turns about a point, in steps; return where the head ends.

        Args:
            middle: the point in the world, (3,).
            turn: (3,) along the axis, as long as the angle, radians.
            step: of each waypoint, at most, radians.
            grip: the gripper's value.
        """
        about = Pose(middle)
        steps = int(np.ceil(np.linalg.norm(turn) / step))
        parts = Rotation.from_rotvec(np.linspace(0.0, 1.0, steps + 1)[1:, None] * turn)
        displacements = (
            about @ Pose.from_rotation(np.zeros(3), part) @ about.inverse()
            for part in parts
        )
        return self.follow(displacements, grip=grip)

    def turn_above(self, number: int, height: float) -> None:
        """Insert waypoints before another one, if the head turns far to it: up, halfway around, and above its place.

        Halfway says which way round: an arm may go either way by half a turn, and only one may be within its limits.

        Args:
            number: of the other one.
            height: of the head on the way, at least, metres.
        """
        before = self.poses[number - 1]
        after = self.poses[number]
        turn = (after.rotation * before.rotation.inv()).as_rotvec()
        if np.linalg.norm(turn) < FAR_TURN_RAD:
            return

        top = max(height, before.position[2], after.position[2])
        for share in (1.0, 0.5, 0.0):
            position = share * before.position + (1 - share) * after.position
            position[2] = top
            rotation = Rotation.from_rotvec((1 - share) * turn) * before.rotation
            self.poses.insert(number, Pose.from_rotation(position, rotation))
            self.grips.insert(number, self.grips[number - 1])
            self.touching.insert(number, False)
            number += 1

    def wait(self, seconds: float) -> None:
        """Stay at the last waypoint of a path with anchors: it is repeated, and each segment has its minimum duration.

        Args:
            seconds: at least.
        """
        for _ in range(int(np.ceil(seconds / _SEGMENT_S))):
            self.add(self.poses[-1], grip=self.grips[-1], touch=self.touching[-1])
            self.anchors.append(self.anchors[-1])

    def hold(self) -> None:
        """Note that the bodies are in the head's hold now; without it they are moved from the first touch on."""
        self._held_from = len(self.poses) - 1

    def end_stage(self) -> None:
        """End a subgoal."""
        first = self.stages[-1].end if self.stages else 0
        contact = self._held_from
        if contact is None:
            touched = len(self.poses)
            if True in self.touching[first:]:
                touched = self.touching.index(True, first)
            contact = max(first, touched - 1)

        self.stages.append(Stage(len(self.poses), contact))
        self._held_from = None

    def turn_over(self, turn: Pose) -> None:
        """Turn the whole path: from a layout that was turned over to the world.

        Args:
            turn: half a turn in the world, which undoes itself.
        """
        self.poses = [turn @ pose for pose in self.poses]

    def to_rows(self, head: Pose, gripper: bool) -> Array:
        """Compute waypoints of the end-effector, (N, 6), or (N, 7) with the gripper.

        Args:
            head: the head's pose in the frame of the tool mount.
            gripper: whether there is one.
        """
        back = head.inverse()
        rows = []
        for pose in self.poses:
            mount = pose @ back
            rows.append(np.concatenate([mount.position, mount.rpy]))

        if gripper:
            return np.column_stack([rows, self.grips])
        return np.array(rows)
