"""Turn a body between the pads of a gripper: about the line on which they close, while it is in the air.

What is long gets upright into a hollow, what lies is stood up, and what stands is laid down or turned over. The hand is
tilted to one side before it closes and to the other in the end, so that it need not tilt by the whole turn to one side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from scipy.spatial.transform import Rotation

from core.geometry import Array, Pose
from core.scene import Soft
from plugins.vlms.offline.boxes import LEVEL, UP, heading_axes
from plugins.vlms.offline.chance import Range
from plugins.vlms.offline.guided import find_level_turn
from plugins.vlms.offline.heads import SIDES, Head, make_piece
from plugins.vlms.offline.paths import HeadPath
from plugins.vlms.offline.raycast import find_tops
from plugins.vlms.offline.subgoals import Subgoal

# Which bodies, and how far.
_WIDEST_M = 0.2  # between pads
# Times as long as wide and as high: what is to get into a hollow by its end.
_LONG = 1.5
# Beside the end of what gets into a hollow, both sides and walls together.
_FITS_M = 0.01
_NEARLY_OVER = 0.2  # the sine of turns that are half ones, and have no direction
_FAR_RAD = 2.0  # what is to be turned by more falls the rest
# From so near on, of how far it may lean and still fall back on its foot, it falls by itself.
_TIPS_BACK = Range(0.1, 0.7)
_OFF_RAD = Range(-0.06, 0.06)  # of others
_SHARE = Range(0.35, 0.65)  # of the turn by which the hand is tilted back at first

# The pads.
_ROOM_M = Range(0.01, 0.04)  # between bodies and open pads, both together
_THICK_M = Range(0.016, 0.02)  # thicker than the shafts, which touch nothing
_PAD_M = Range(0.016, 0.036)  # long and high
_DROP_M = Range(0.15, 0.22)  # below the flange
_OFF_GROUND_M = 0.003

# The way.
# Of its length that what is long is held off its middle, toward the end that will be upper.
_TOWARD_END = Range(0.0, 0.3)
_PASS_M = Range(0.01, 0.04)  # above what is near
_STEP_RAD = 0.3  # between waypoints
_LIFT_M_S = 0.25
_CARRY_M_S = Range(0.15, 0.35)
_LOWER_M_S = 0.15
_FOOT_M = 0.004  # what is no higher is a body's foot
_SET_DOWN_M = Range(0.002, 0.012)  # above what it will stand on
_OVER_RIM_M = 0.004  # of a hollow, for pads
_LEAVE_M = 0.06  # along the hand
_RISE_M = 0.1


@dataclass(frozen=True, eq=False)
class _Turn:
    """A turn about a level axis.

    Attributes:
        axis: a unit vector (3,).
        angle: about it, radians.
    """

    axis: Array
    angle: float

    def part(self, share: float) -> Rotation:
        """Return a share of the turn."""
        return Rotation.from_rotvec(share * self.angle * self.axis)


def turns_in_hand(subgoal: Subgoal) -> bool:
    """Report whether a subgoal's only body can be turned between pads, and is to be: by its goal, or to get in.

    Args:
        subgoal: of any bodies.
    """
    return bool(_find_turns(subgoal))


def make_turning_clamp(subgoal: Subgoal, rng: Generator) -> Head:
    """Make two pads that close on a body along the axis that it is to be turned about.

    Args:
        subgoal: one that `turns_in_hand`.
        rng: random numbers.
    Returns:
        A head with a pad for each finger, its origin in the middle between them.
    """
    turns = _find_turns(subgoal)
    turn = turns[rng.integers(len(turns))]
    yaw = _find_yaw(turn.axis, rng)

    extent = subgoal.extent(yaw)
    gap = extent.across + _ROOM_M.draw(rng)
    thick = _THICK_M.draw(rng)
    length = _PAD_M.draw(rng)
    height = _PAD_M.draw(rng)

    pads = []
    for name, side in SIDES:  # the left finger is at the negative y
        y = -side * (gap + thick) / 2
        pads.append(make_piece(f"{name}_pad", 0.0, y, 0.0, (length, thick, height)))

    turning = _Turning(
        subgoal,
        turn,
        yaw=yaw,
        share=_SHARE.draw(rng),
        radius=float(np.hypot(length, height)) / 2,
    )
    return Head(
        "clamp",
        "clamp",
        tuple(pads),
        np.array([0.0, (gap + thick) / 2, height / 2]),
        length / 2,
        gap,
        motion=turning.carry,
        mount_pose=Pose(-_DROP_M.draw(rng) * UP),
    )


def _find_turns(subgoal: Subgoal) -> list[_Turn]:
    """Find the turns that a subgoal may ask of its body, each about a line on which pads can close.

    Args:
        subgoal: of any bodies.
    """
    goal = subgoal.goal
    if goal is None or goal.joint is not None or goal.breaks:
        return []
    if len(subgoal.solids) > 1 or isinstance(subgoal.solids[0].body, Soft):
        return []
    if subgoal.riders or subgoal.loose_container is not None or goal.steady:
        return []

    turns = _find_turns_in(subgoal)
    if goal.axis is not None:
        turns = _find_turns_to(subgoal)

    return [turn for turn in turns if _measure_across(subgoal, turn) < _WIDEST_M]


def _find_turns_to(subgoal: Subgoal) -> list[_Turn]:
    """Find the turns that bring a body's axis to where its goal wants it, four ways for half a turn."""
    found = find_level_turn(subgoal)
    if found is None:
        return []

    axis, angle = found
    if np.linalg.norm(axis) > _NEARLY_OVER:
        level = axis * LEVEL
        return [_Turn(level / np.linalg.norm(level), angle)]

    ahead, side = heading_axes(subgoal.workspace.direction(subgoal.center))
    return [_Turn(way, angle) for way in (ahead, -ahead, side, -side)]


def _find_turns_in(subgoal: Subgoal) -> list[_Turn]:
    """Find the two quarter turns that stand up what is too long to lie in the hollow that it is to get into."""
    assert subgoal.goal is not None
    if subgoal.goal.container is None:
        return []

    hollow = subgoal.model.solids[subgoal.goal.container]
    opening = float(np.ptp(hollow.points[:, :2], axis=0).min()) - _FITS_M

    extent = subgoal.extent(subgoal.grip_heading)
    thickest = max(extent.across, subgoal.height)
    if extent.along < max(opening, _LONG * thickest) or thickest > opening:
        return []

    return [_Turn(sign * extent.side, np.pi / 2) for sign in (1.0, -1.0)]


def _measure_across(subgoal: Subgoal, turn: _Turn) -> float:
    """Measure a body along the axis of a turn, metres."""
    return float(np.ptp(subgoal.points @ turn.axis))


def _find_yaw(axis: Array, rng: Generator) -> float:
    """Find how the hand is turned about z to close along an axis: as near to how it is at home as can be.

    Args:
        axis: a level unit vector (3,).
        rng: random numbers, where both ways are as near.
    """
    yaw = float(np.arctan2(axis[1], axis[0])) + np.pi / 2
    yaw = (yaw + np.pi / 2) % np.pi - np.pi / 2
    if abs(abs(yaw) - np.pi / 2) < 1e-6:
        return float(rng.choice([-1.0, 1.0])) * np.pi / 2

    return yaw


@dataclass(frozen=True, eq=False)
class _Turning:
    """How pads turn a body and bring it to its goal.

    Attributes:
        subgoal: the body.
        turn: of it.
        yaw: of the hand, before it is tilted, radians.
        share: of the turn, by which the hand is tilted back at first.
        radius: of the pads about their middle, metres.
    """

    subgoal: Subgoal
    turn: _Turn
    yaw: float
    share: float
    radius: float

    def carry(self, path: HeadPath, rng: Generator) -> str:
        """Close on the body, lift it, turn it, carry it to its goal, set it down there, and leave; or hold it."""
        subgoal = self.subgoal
        angle = self.turn.angle + _OFF_RAD.draw(rng)
        if self.turn.angle > _FAR_RAD:
            angle = self.turn.angle - _TIPS_BACK.draw(rng) * self._find_lean()

        turn = _Turn(self.turn.axis, angle)
        hand = Rotation.from_euler("z", self.yaw)
        grasp = self._draw_grasp(rng)
        tilted = turn.part(-self.share) * hand
        start = Pose.from_rotation(grasp, tilted)

        path.descend(subgoal, start, grasp)
        path.go(start, grasp, grip=1.0, touch=True)
        path.hold()

        farthest = np.linalg.norm(subgoal.points - grasp, axis=1).max()
        height = subgoal.height_on_way + farthest + _PASS_M.draw(rng)
        lifted = np.array([*grasp[:2], max(height, grasp[2])])
        path.move(lifted, start, _LIFT_M_S, grip=1.0)

        count = int(np.ceil(angle / _STEP_RAD))
        for share in np.linspace(0.0, 1.0, count + 1)[1:]:
            pose = Pose.from_rotation(lifted, turn.part(share) * tilted)
            path.add(pose, grip=1.0, touch=True)

        end = path.poses[-1]
        place = self._find_place(turn, grasp, float(lifted[2]))
        place = place + _SET_DOWN_M.draw(rng) * UP
        over = np.array([*place[:2], max(lifted[2], place[2])])
        path.move(over, end, _CARRY_M_S.draw(rng), grip=1.0)
        path.move(place, end, _LOWER_M_S, grip=1.0)

        text = (
            f"closes on the body, and turns it by {np.degrees(angle):.0f} degrees "
            "between the pads"
        )
        if subgoal.is_held:
            return text

        path.go(end, place, touch=True)
        back = place + _LEAVE_M * end.rotation.apply(UP)
        path.go(end, back, back + _RISE_M * UP, touch=True)

        return f"{text}, sets it down and leaves"

    def _find_lean(self) -> float:
        """Find by how much the body may lean about the turn's axis and still fall back on its foot, radians."""
        along = np.cross(self.turn.axis, UP)
        length = np.ptp(self.subgoal.points @ along)
        return float(np.arctan2(length, self.subgoal.height))

    def _draw_grasp(self, rng: Generator) -> Array:
        """Draw where the body is held, (3,): in its middle, or toward the end that will be upper in a hollow."""
        subgoal = self.subgoal
        grasp = subgoal.center.copy()
        grasp[2] = max(grasp[2], subgoal.lower[2] + self.radius + _OFF_GROUND_M)

        assert subgoal.goal is not None
        if subgoal.goal.axis is None:
            upper = self.turn.part(1.0).inv().apply(UP)
            length = float(np.ptp(subgoal.points @ upper))
            grasp = grasp + _TOWARD_END.draw(rng) * length * upper * LEVEL

        return grasp

    def _find_place(self, turn: _Turn, grasp: Array, high: float) -> Array:
        """Find where the pads let go of the body, (3,): with its foot on what is below, or with it over a rim.

        Args:
            turn: of the body.
            grasp: where it was held, (3,).
            high: of the pads over the goal, metres.
        """
        subgoal = self.subgoal
        goal = subgoal.goal
        assert goal is not None
        points = turn.part(1.0).apply(subgoal.points - grasp)
        middle = (points.min(axis=0) + points.max(axis=0)) / 2
        frame = turn.part(1.0).apply(subgoal.solids[0].position - grasp)

        # On the level it is the body's frame that has a place, or its middle in a hollow, or where it was.
        place: Array = subgoal.center - middle
        wanted = goal.place or (None, None, None)
        reference = frame if goal.container is None else middle
        for axis, coordinate in enumerate(wanted[:2]):
            if coordinate is not None:
                place[axis] = coordinate - reference[axis]

        if goal.held and wanted[2] is not None:
            place[2] = wanted[2] - frame[2]
            return place

        lowest = float(points[:, 2].min())
        foot = points[points[:, 2] < lowest + _FOOT_M] + place * LEVEL
        foot[:, 2] = high + lowest
        ground = float(find_tops(subgoal.obstacles, foot).max())
        if not np.isfinite(ground):
            ground = float(subgoal.lower[2])

        place[2] = ground - lowest
        place[2] = max(place[2], ground + self.radius + _OFF_GROUND_M)
        if goal.container is not None:
            rim = float(subgoal.model.solids[goal.container].points[:, 2].max())
            place[2] = max(place[2], rim + self.radius + _OVER_RIM_M)

        return place
