"""Choose where a head is at the tool mount, so that the arm works where it does with ease."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from scipy.spatial.transform import Rotation

from core.geometry import Array, Pose
from plugins.vlms.offline.chance import add_error, draw_head_turn
from plugins.vlms.offline.faults import FaultCounter
from plugins.vlms.offline.heads import Head
from plugins.vlms.offline.paths import FAR_TURN_RAD, HeadPath
from plugins.vlms.offline.scene_model import SceneModel
from plugins.vlms.offline.subgoals import Subgoal

_PLACES = 40  # end-effector positions that are compared,
_MORE = 2  # times as many where a tool must do in several layouts
_SECTOR_RAD = 0.9  # to both sides of home, where the arm works with ease
_WITHIN_M = 0.02  # the workspace
_CEILING_RAD = 0.2  # how wrong the turn of a flange is that points ahead
_YAW_RAD = 0.15  # and that of one that points down
_DROP_M = 0.03  # of a head below the flange, at least: for a shaft
# Below the mount of finger extensions, with the hand and the fingers between.
_FINGER_DROP_M = 0.18
_DROPS_M = 0.02  # between the least drop and the greatest, at least
_CLEAR_M = 0.015  # above the scene at home
_MOST_DROP_M = 0.45  # a longer shaft bends, and swings
_REACH_IN_M = 0.003  # clearance at home of fingers that reach into a container
_HAND_M = 0.068  # the hand's height
# What a metre outside the workspace costs, in metres beside the mount's axis.
_EXCESS = 20.0
# The most that a place costs by chance, so that it is not always the same one.
_DOUBT = 0.15

HeadWay = tuple[Array, Array]  # positions (N, 3) and turns (N, 3, 3) along a path


def _read_way(rows: Array) -> HeadWay:
    """Read positions and turns from waypoints, (N, 6) or (N, 7)."""
    return rows[:, :3], Rotation.from_euler("xyz", rows[:, 3:6]).as_matrix()


@dataclass(frozen=True)
class HeadDirection:
    """Where a head must be.

    Attributes:
        turn: which way it points from the mount, radians.
        drop: how far below the mount it is, metres.
    """

    turn: float
    drop: float


@dataclass(frozen=True)
class HeadRoom:
    """Where there is room for a head beside another one on the same mount.

    Attributes:
        apart: how far it is from the mount's axis, metres, at least.
        azimuth: which way it is from there, in the frame of the mount, radians; None: any way.
        lowest: the height of the mount while the head works, metres, at least: others are below it.
        longest: how far the head may be below the mount, metres, so that it is clear of the ground as the other works.
    """

    apart: float
    azimuth: float | None = None
    lowest: float = 0.0
    longest: float = np.inf


def works_above_home(path: HeadPath, model: SceneModel) -> bool:
    """Report whether the head works higher than the end-effector's home, or begins to, at a ceiling.

    Args:
        path: of the head.
        model: the layout's home counts, and where gravity draws.
    """
    if model.draws_up:
        return True

    return path.lowest > float(model.home.position[2])


def _find_middle_turn(path: HeadPath) -> float:
    """Find the middle of the turns about z that a head makes on its path, radians; 0: it turns little.

    Args:
        path: of the head, whose first turn counts as 0.
    """
    start = path.poses[1].rotation.inv()
    wrapped = [(pose.rotation * start).as_euler("ZYX")[0] for pose in path.poses]
    turns = np.unwrap(wrapped)
    if np.ptp(turns) < FAR_TURN_RAD:
        return 0.0

    return float(turns.min() + turns.max()) / 2


@dataclass(frozen=True, eq=False)
class HeadPlacer:
    """Places heads at the tool mount.

    The end-effector is somewhere above the head, with the flange pointing down, when the path begins. `place` draws
    such places; each gives a pose of the head at the mount, and so the end-effector's way along the whole path.

    Attributes:
        model: the layout that plans are made for.
        faults: what says where a plan's waypoints are in other layouts.
        gripper: whether tools are finger extensions.
        direction: where heads must be; None: anywhere.
        room: where there is room for the head beside another one; None: there is no other one.
        rng: random numbers.
    """

    model: SceneModel
    faults: FaultCounter
    gripper: bool
    direction: HeadDirection | None
    room: HeadRoom | None
    rng: Generator

    def place(self, path: HeadPath, head: Head, subgoal: Subgoal) -> Pose:
        """Choose the head's pose in the frame of the tool mount, the best of some that are drawn.

        Each place of the end-effector above the path's start is judged by how far the arm leaves its workspace on the
        way, in all layouts, and by how far the head is from the mount's axis.

        Args:
            path: of the head.
            head: whose attachment must be below the mount.
            subgoal: what it is for.
        """
        rng = self.rng
        workspace = self.model.workspace
        start = path.poses[1]
        yaw = self._draw_yaw(path, head)
        least, most = self._find_drops(path, head, subgoal)
        from_above = self._reaches_in(head, subgoal)

        # The head's positions (N, 3) and turns (N, 3, 3) along the path, in each layout.
        rows = path.to_rows(Pose(), self.gripper)
        elsewhere = self.faults.resolve_elsewhere(rows, path.anchors)
        ways = [*map(_read_way, (rows, *elsewhere))]

        ahead = 0.0
        if workspace.base[:2].any():
            ahead = workspace.direction(self.model.home.position)

        places = []
        extra_costs = []

        for _ in range(_PLACES * (_MORE if self.faults.several else 1)):
            angle = ahead + rng.uniform(-_SECTOR_RAD, _SECTOR_RAD)
            nearest = workspace.inner + _WITHIN_M
            radius = rng.uniform(nearest, workspace.outer - _WITHIN_M)
            height = start.position[2] + rng.uniform(least, most)
            x, y = start.position[:2]

            if not from_above:
                way = np.array([np.cos(angle), np.sin(angle)])
                x, y = workspace.base[:2] + radius * way

            places.append((x, y, height))
            extra_costs.append(rng.uniform(0.0, _DOUBT))

        costs = self._cost(np.array(places), start, ways, head.behind)
        offsets = start.position - np.array(places)
        if self.room is not None:
            missing = self.room.apart - np.hypot(*offsets[:, :2].T)
            costs += _EXCESS * np.maximum(0.0, missing)

        best = int(np.argmin(costs + extra_costs))
        if self.room is not None and self.room.azimuth is not None:
            yaw = np.arctan2(offsets[best, 1], offsets[best, 0]) - self.room.azimuth

        rpy = (0.0, 0.0, yaw)
        if self.model.draws_up:
            # Pointing down, the flange does not get near a ceiling; here it points ahead.
            outward = workspace.direction(np.array(places[best]))
            rpy = (0.0, -np.pi / 2, outward + rng.normal(0.0, _CEILING_RAD))

        mount = Pose.xyz_rpy(places[best], rpy)
        return mount.inverse() @ start

    def _cost(
        self,
        places: Array,
        start: Pose,
        ways: Sequence[HeadWay],
        behind: float | None,
    ) -> Array:
        """Judge places of the end-effector at the path's start.

        Args:
            places: (P, 3) in the world, metres.
            start: the head's pose there.
            ways: of the head, in each layout.
            behind: see `Head`.

        Returns:
            Costs (P,): how far the head is from the mount's axis in metres, and `_EXCESS` for each metre that the
            end-effector leaves the workspace by, or is less behind the head than it is to be.
        """
        apart = start.position - places
        # The end-effector in the frame of the head, and how far the head is from its axis.
        back = -apart @ start.rotation_matrix
        aside = np.hypot(*apart[:, :2].T)

        excess = np.zeros(len(places))
        if behind is not None:
            excess += np.maximum(0.0, behind + back[:, 0])

        for positions, turns in ways:
            points = positions + np.einsum("nij,pj->pni", turns, back)
            excess += self.model.workspace.excess(points)

        costs: Array = _EXCESS * excess + aside
        return costs

    def _draw_yaw(self, path: HeadPath, head: Head) -> float:
        """Draw how the end-effector is turned about z at the path's start, radians.

        The head points ahead of the end-effector most often. A clamp's turn is the end-effector's.
        """
        yaw = add_error(draw_head_turn(self.rng), _YAW_RAD, self.rng)
        if head.motion is not None:
            yaw -= _find_middle_turn(path)
        if head.primitive == "clamp":
            return float(path.poses[1].rpy[2])
        if self.direction is not None and not works_above_home(path, self.model):
            return self.direction.turn

        return yaw

    def _find_drops(
        self,
        path: HeadPath,
        head: Head,
        subgoal: Subgoal,
    ) -> tuple[float, float]:
        """Find the least and the greatest height of the tool mount over the head, metres.

        It is low enough for the shaft above the head, and high enough that the head at home is clear of the scene.

        Args:
            path: of the head.
            head: whose attachment must be below the mount.
            subgoal: what it is for.
        """
        top = path.poses[1].rotation.apply(head.attachment)
        least = top[2] + (_FINGER_DROP_M if self.gripper else _DROP_M)
        above_path = self.model.home.position[2] - path.lowest
        room = min(self.model.clearance_at_home, above_path)
        most = max(least + _DROPS_M, min(room - _CLEAR_M, _MOST_DROP_M))

        if works_above_home(path, self.model):
            least = -_MOST_DROP_M
            most = 0.0
        elif self.direction is not None:
            least = max(least, self.direction.drop)
            most = least

        if head.primitive == "clamp" and head.behind is not None:
            most = least + _DROPS_M

        if self.room is not None:
            least = max(least, self.room.lowest - path.lowest)
            most = max(least, min(most, self.room.longest))

        # The hand stays above the container that the fingers reach into.
        if self._reaches_in(head, subgoal):
            most = max(least, room - _REACH_IN_M)
            least = min(most, subgoal.clear_height - path.lowest + _HAND_M)

        return least, most

    def _reaches_in(self, head: Head, subgoal: Subgoal) -> bool:
        """Report whether fingers reach from above into what is around bodies."""
        from_above = head.primitive == "clamp" and head.behind is None
        return from_above and subgoal.is_enclosed
