"""Bring a body in below something, such as the upper board of a shelf, and let go of it there.

A rigid tool tips it into a cup whose mouth then points the way in. Inside, the cup leans forward and is drawn off along
itself, so that the body slides out, and comes to lie on another side. A gripper holds it by pads ahead of the hand.
What carries the cup or the pads is behind them, and stays outside.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator
from scipy.spatial.transform import Rotation

from core.geometry import Array, Pose
from plugins.vlms.offline.boxes import LEVEL, UP, heading_axes
from plugins.vlms.offline.chance import Range
from plugins.vlms.offline.cups import (
    draw_plain_cup,
    draw_side,
    find_heading,
    hang,
    tip_over_edge,
)
from plugins.vlms.offline.guided import QUARTERS
from plugins.vlms.offline.head_sampling import draw_clamp
from plugins.vlms.offline.heads import Head, Piece
from plugins.vlms.offline.paths import HeadPath
from plugins.vlms.offline.raycast import find_tops
from plugins.vlms.offline.sheltered import (
    Passage,
    find_depth,
    find_passage,
    find_rise,
    is_sheltered,
)
from plugins.vlms.offline.subgoals import Subgoal

# The way in.
_INS_M = (0.02, 0.01)  # above its place, where a body goes in
_HEADROOM_M = 0.03  # above it
_PASS_M = Range(0.01, 0.03)  # above what is on the way
_AS_NEAR_RAD = 0.3  # ways in for which a body is turned by so little more are as good
_TURN_STEP_RAD = 0.3
_LIFT_M_S = Range(0.1, 0.25)
_CARRY_M_S = Range(0.15, 0.35)
_LOWER_M_S = 0.1
_LEAVE_M = 0.05  # up, outside

# What carries a cup or pads.
_BAR_M = Range(0.02, 0.05)  # from what is above to the shaft
_BAR_THICK_M = 0.016
_INTO_M = 0.003  # how far a bar goes into what it carries
_ARM_M = 0.07  # from the shaft to the middle of the flange, which is outside, too

# A cup.
# By which it is tipped to carry a body: about a right angle, so that nothing slides out.
_LEVEL_RAD = Range(1.5, 1.75)
# By which it is tipped still as the body slides out: its floor is steeper than friction bears.
_SLIDES_RAD = Range(0.6, 0.95)
_TILT_RAD = Range(0.4, 1.0)  # of the flange at first
_SHORT = Range(0.0, 0.6)  # of its height that a body slides on
_LIP_M = Range(0.003, 0.008)  # above what bears the body then
_SLIDING = 2  # segments
_OFF_M = 0.01  # farther than a body is high the cup is drawn off

# Pads.
_FOOT_M = Range(0.003, 0.008)  # above the ground
_SET_DOWN_M = 0.002  # above what is to bear the body


@dataclass(frozen=True, eq=False)
class _WayIn:
    """How a body gets in below something.

    Attributes:
        passage: of the body as it is carried.
        yaw: by which it is turned about the vertical before, radians.
        board: the height of what is to bear it, in the world, metres.
        over: the body as it is carried, over where it is now, to be moved to its place.
        depth: from its middle to where a shaft has to stay, metres.
    """

    passage: Passage
    yaw: float
    board: float
    over: Subgoal
    depth: float


def goes_below(subgoal: Subgoal) -> bool:
    """Report whether a subgoal's only body is to be let go below something that is higher than where it is now."""
    goal = subgoal.goal
    if goal is None or len(subgoal.solids) > 1 or subgoal.riders or subgoal.is_held:
        return False
    if goal.steady or goal.axis is not None:  # it ends on another side
        return False

    return subgoal.rises and is_sheltered(subgoal)


def make_shelver(
    subgoal: Subgoal, rng: Generator, thickness_factor: float
) -> Head | None:
    """Make a cup out of which a body slides below something; None: no way in is free.

    Args:
        subgoal: one that `goes_below`, and whose body walls can turn.
        rng: random numbers.
        thickness_factor: how many times as thick as of the stiff default material walls are.
    """
    side = draw_side(rng)
    heading = find_heading(subgoal, side)
    level = _LEVEL_RAD.draw(rng)

    # Its mouth points back once it is tipped.
    ahead, _ = heading_axes(heading)
    tip = Rotation.from_rotvec(np.pi / 2 * np.cross(UP, ahead))
    way_in = _find_way_in(subgoal, tip, heading + np.pi, rng)
    if way_in is None:
        return None

    walls = draw_plain_cup(subgoal, heading, rng, thickness_factor)
    lid = walls.pieces[1]
    top = float(lid.pose.position[2] + lid.size[2] / 2)
    bar = max(_BAR_THICK_M, way_in.depth - subgoal.height / 2) + _BAR_M.draw(rng)
    cup = _put_bar(walls, top, level, bar)
    cup = hang(cup, side, _TILT_RAD.draw(rng), rng)

    def shelve(path: HeadPath, rng: Generator) -> str:
        """Tip the body into the cup, lift it, bring it in, let it slide out, and leave."""
        extent = subgoal.extent(heading)
        poses = tip_over_edge(subgoal, extent, cup, level, rng)
        path.descend(subgoal, poses[0], poses[0].position)
        for pose in poses[1:]:
            path.add(pose, touch=True)
        path.hold()

        tipped = poses[-1]
        middle = (tipped @ poses[0].inverse()).apply(subgoal.center)
        lip = cup.depth * np.array([1.0, 0.0, 0.0])
        low = float(tipped.apply(lip)[2])
        slide = _SHORT.draw(rng) * subgoal.height
        inward, _ = heading_axes(way_in.passage.heading)
        place = (subgoal.center + subgoal.shift) * LEVEL - slide * inward
        drop = way_in.board + _LIP_M.draw(rng) - low
        there = place - middle * LEVEL + drop * UP
        turned = _carry_in(path, way_in, middle, there, rng)

        # It leans about its lip.
        slides = level - _SLIDES_RAD.draw(rng)
        edge = turned.apply(lip)
        axis = np.cross(inward, UP)
        leaning = path.turn_about(edge, -slides * axis, _TURN_STEP_RAD)
        path.go(leaning, *[path.end] * _SLIDING, touch=True)
        off = path.end + (subgoal.height + _OFF_M) * leaning.rotation.apply(UP)
        path.move(off, leaning, _LOWER_M_S)
        back = path.end + way_in.passage.on
        path.go(leaning, back, back + _LEAVE_M * UP, touch=True)
        return "tips the body into a cup, brings it in below what is above, and lets it slide out there"

    return replace(cup, motion=shelve, primitive="guided")


def _put_bar(cup: Head, top: float, level: float, length: float) -> Head:
    """Put a bar on a cup in place of its knob, which is level and behind the lid when the cup is tipped.

    Args:
        cup: whose first piece is its knob.
        top: of its lid, metres.
        level: by how much it is tipped then, radians.
        length: of the bar, metres.
    """
    way = np.array([np.cos(level), 0.0, np.sin(level)])
    start = np.array([cup.depth / 2, 0.0, top - _INTO_M])
    turn = (0.0, np.pi / 2 - level, 0.0)
    size = (_BAR_THICK_M, _BAR_THICK_M, length)
    bar = Piece("bar", Pose.xyz_rpy(start + length / 2 * way, turn), size)
    end = start + (length - _INTO_M) * way
    return replace(cup, pieces=(bar, *cup.pieces[1:]), attachment=end)


def make_reaching_clamp(subgoal: Subgoal, rng: Generator) -> Head | None:
    """Make two pads ahead of a hand that set a body down below something; None: no way in is free.

    Args:
        subgoal: one that `goes_below`.
        rng: random numbers.
    """
    heading = subgoal.grip_heading
    way_in = _find_way_in(subgoal, Rotation.identity(), heading, rng)
    if way_in is None:
        return None

    pads = draw_clamp(subgoal, rng)
    low = float(subgoal.lower[2])

    def carry(path: HeadPath, rng: Generator) -> str:
        """Close on the body, lift it, bring it in, set it down, and leave."""
        grasp = np.array([*subgoal.center[:2], low + _FOOT_M.draw(rng)])
        path.descend(subgoal, heading, grasp)
        path.go(heading, grasp, grip=1.0, touch=True)
        path.hold()

        there = subgoal.shift * LEVEL + (way_in.board - low + _SET_DOWN_M) * UP
        turned = _carry_in(path, way_in, subgoal.center, there, rng, grip=1.0)
        path.go(turned, path.end, touch=True)
        back = path.end + way_in.passage.on
        path.go(turned, back, back + _LEAVE_M * UP, touch=True)
        return "closes the fingers, brings the body in below what is above, and opens"

    return replace(pads, motion=carry, behind=way_in.depth + _ARM_M)


def _carry_in(
    path: HeadPath,
    way_in: _WayIn,
    middle: Array,
    there: Array,
    rng: Generator,
    grip: float = 0.0,
) -> Pose:
    """Lift a body, turn it, and bring it in to its place; return how the head is there.

    Args:
        path: that waypoints are added to, with the body in its hold.
        way_in: of the body.
        middle: of the body as it is held, about which it is turned, (3,).
        there: from where it is held to its place, (3,) metres.
        rng: random numbers.
        grip: the gripper's value.
    """
    passage = way_in.passage
    rise = passage.rise * UP
    before = there + passage.on
    clear = find_rise(way_in.over, np.zeros(3), before * LEVEL, _PASS_M.draw(rng))
    high = max(clear, there[2] + passage.rise)

    here = path.end
    turn = path.poses[-1]
    path.move(here + high * UP, turn, _LIFT_M_S.draw(rng), grip=grip)
    if way_in.yaw:
        about = middle + high * UP
        turn = path.turn_about(about, way_in.yaw * UP, _TURN_STEP_RAD, grip=grip)

    here = path.end - high * UP
    path.move(here + before * LEVEL + high * UP, turn, _CARRY_M_S.draw(rng), grip=grip)
    for place in (before + rise, there + rise, there):
        path.move(here + place, turn, _LOWER_M_S, grip=grip)

    return path.poses[-1]


def _find_way_in(
    subgoal: Subgoal, tip: Rotation, mouth: float, rng: Generator
) -> _WayIn | None:
    """Find how a body gets in, with the least turn about the vertical; None: it does not.

    Args:
        subgoal: the body.
        tip: of the body, before it is carried.
        mouth: the heading that is to point in, before the body is turned, radians.
        rng: random numbers, between ways that are as good.
    """
    place = subgoal.center + subgoal.shift
    board = float(find_tops(subgoal.obstacles, place[None])[0])
    if not np.isfinite(board):
        return None

    ways = []
    for heading in QUARTERS:
        yaw = (heading - mouth + np.pi) % (2 * np.pi) - np.pi
        over = _turn_body(subgoal, Rotation.from_rotvec(yaw * UP) * tip)
        ground = float(over.lower[2])
        over = replace(over, shift=subgoal.shift * LEVEL + (board - ground) * UP)
        passage = find_passage(over, heading, _INS_M, _HEADROOM_M)
        if passage is None or passage.off.any():
            continue

        depth = find_depth(over, over.center, heading, over.shift)
        ways.append(_WayIn(passage, float(yaw), board, over, depth))

    if not ways:
        return None

    least = min(abs(way.yaw) for way in ways)
    near = [way for way in ways if abs(way.yaw) < least + _AS_NEAR_RAD]
    return near[rng.integers(len(near))]


def _turn_body(subgoal: Subgoal, turn: Rotation) -> Subgoal:
    """Turn a body about its middle, and raise it so that its foot is as high as before."""
    middle = Pose(subgoal.center)
    by = middle @ Pose.from_rotation(np.zeros(3), turn) @ middle.inverse()
    turned = replace(subgoal, solids=[solid.moved_by(by) for solid in subgoal.solids])
    raised = Pose((subgoal.lower[2] - turned.lower[2]) * UP)
    return replace(turned, solids=[solid.moved_by(raised) for solid in turned.solids])
