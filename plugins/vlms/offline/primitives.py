"""Motion primitives: ways of using a head. Each adds the waypoints for one subgoal to a path, and says what it does.

    ========  ======================================  ==========================================
    push      down behind the bodies, or around them  along the ground, sometimes up and away
    scoop     down behind the bodies, and under them  up; or up, over to the goal, and tipped out
    hook      down before the bodies, and past them   behind them, and back
    clamp     down with the bodies between the pads   closed, over to the goal, and opened
    cup       down over a body                        tipped with it, over to the goal, and back
    ========  ======================================  ==========================================

What a waypoint's place depends on is drawn at random: how far behind, how fast, how far. Lengths are wrong by much at
times, so that evolution has something to correct.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.random import Generator

from core.geometry import Array, Pose
from plugins.vlms.offline.boxes import LEVEL, UP
from plugins.vlms.offline.chance import Range, add_error
from plugins.vlms.offline.cups import tip_in
from plugins.vlms.offline.detours import loses_ground
from plugins.vlms.offline.heads import Head
from plugins.vlms.offline.paths import HeadPath
from plugins.vlms.offline.subgoals import Extent, Subgoal

PrimitiveMotion = Callable[[HeadPath, Subgoal, Head, Generator], str]
"""Adds waypoints to a path, and says in words what they do."""

# What heads move past, and how near.
_CLEAR_M = Range(0.01, 0.05)  # above everything near, on the way down
_LEAST_RISE_M = 0.03  # a way down is at least so long, to be slow at its end
_PASS_M = 0.01  # above what is on its way a body is carried, at least
# How far above everything near a scoop's load is, as it may hang over its edge.
_OVER_M = 0.03
_LEAVE_M = 0.03  # a face backs off by this before it rises

# How fast heads move, m/s: the rules allow more, and what is faster throws what it moves.
_PUSH_M_S = Range(0.1, 0.4)
# What is pushed by a scoop's edge rolls away before it lies on it.
_UNDER_M_S = Range(0.08, 0.35)
_LIFT_M_S = Range(0.1, 0.4)
_TRAY_LIFT_M_S = Range(0.15, 0.4)
_TRAY_M_S = Range(0.15, 0.5)
_CARRY_M_S = Range(0.1, 0.4)  # between fingers
_RISE_M_S = 0.3  # with bodies between the fingers
_LOWER_M_S = 0.2
_SIDE_M_S = 0.1  # past what is close

# How wrong lengths and directions are.
_GOOD_ERROR = 0.015  # of a length, as a share of it: it may do as it is
_LARGE_ERROR = 0.18  # and that of most, which evolution is to correct
_GOOD = 0.3  # how often it is good
_HEADING_RAD = 0.06  # of a push
_HEADINGS_OFF = 0.4  # how often it has that error
_SCOOP_RAD = 0.05  # of a scoop
_GRIP_RAD = 0.1  # of a hand
_SLIP = 0.08  # of how far beside the middle a face meets bodies, in their widths

# A push.
_FALL_WAY = Range(0.4, 1.3)  # of the way to where they fall to: they fly on
_EDGE_WAY = Range(1.0, 1.2)  # of the way over an edge: no less
_FALL_M_S = Range(0.5, 2.0)  # as the speed is not critical
_THROW_WAY_M = Range(0.3, 0.9)  # what is thrown has to get its speed on the way
_THROW_M_S = 2.0  # as fast as the arm's joints let it be
_SWING_RAD = Range(-0.8, 0.8)  # of a head about its path, which throws bodies aside
# Behind bodies: as near as it is sure to come down beside them, and as far as it costs little.
_BEHIND_M = Range(0.004, 0.03)
# The least room behind bodies in a pen that is hardly longer than they are.
_PEN_M = 0.001
# Above the ground: clear of it, and below the middle of what is low.
_GROUND_M = Range(0.002, 0.012)
_MIDDLE = 0.5  # of the height of what is flat, or goes over an edge, at most
_HIGHER = Range(0.0, 0.5)  # of their height, that a face meets bodies above their foot
_HIGH = 0.25  # how often it does
_LEAVES = 0.4  # how often a head rises at the end, and not the arm with it alone

# A scoop.
_IN_PLACE_M = 0.03  # bodies whose way on the ground is shorter are only lifted
# The sides from which bodies are reached, by the way they have to go.
_SIDES_RAD = [0.0, np.pi, np.pi / 2, -np.pi / 2]
# How often each is drawn: the robot's side mostly, where the arm is not above them.
_SIDES = [0.3, 0.5, 0.1, 0.1]
# Above the ground: a body climbs onto what is no thicker.
_FLOOR_M = Range(0.0005, 0.004)
_BEFORE_M = Range(0.005, 0.03)  # behind bodies
# Of its own depth that a scoop goes under bodies: to its wall, and a little less or more.
_DEPTH = Range(0.85, 1.02)
_LIFT_MORE_M = Range(-0.01, 0.03)  # than the goal asks for
_TILTS = 0.4  # how often a scoop leans back, so that nothing slides off
# What is flat lies on it up to a slope of its friction, 0.5 or so.
_TILT_RAD = Range(0.0, 0.25)
_LEAN_RAD = Range(0.0, 0.35)  # what carries bodies to a hollow
_TO_EDGE = Range(
    0.0, 1.2
)  # of the way from their middle to its edge: they fall off there
_TIP_RAD = Range(0.5, 1.3)  # so far forward everything slides off

# A hook.
_TOE_M = Range(0.004, 0.02)  # above the ground
_SUNK_M = 0.004  # into it, at most, that a toe's middle may be for its height
_HOOK_BEHIND_M = Range(0.004, 0.02)  # bodies, to where the toe comes in
_HOOK_BEFORE_M = Range(0.01, 0.04)  # in front of them, from where it comes
_UNDER_COVER_M = 0.05  # it comes down by, where there is no way from above

# A clamp.
_HAND_TURNS_RAD = [0.0, np.pi / 2, -np.pi / 2]
# How often each is drawn: most often as at home, where the arm has room.
_HAND_TURNS = [0.8, 0.1, 0.1]
_DRAGS = 0.6  # how often bodies with a free way on the ground are dragged
_LETS_FALL = 0.7  # how often bodies are let fall into a hollow, rather than set down in it: a hand seldom fits
_OUT_M = 0.02  # up before a step aside, from under what is above
_ASIDE_M = 0.04  # and at its end
_TALL = 2.0  # times as tall as the pads that hold them: such bodies are gripped above their middle
_TALL_GRIP = Range(0.5, 0.95)  # of their height
_LOW_GRIP_M = 0.002  # above the ground, at least
# Of the bodies' height, at most: others stand by themselves when they are let go.
_LOW_GRIP = 0.4
_SET_DOWN_M = 0.003  # above where bodies stood, so that they don't press on the ground
_CARRY_MORE_M = Range(0.0, 0.03)  # than they must be lifted to pass


def _draw_rise(
    subgoal: Subgoal,
    low: float,
    rng: Generator,
) -> Array:
    """Draw the vector (3,) up from the height ``low`` to where the head is clear of everything.

    Args:
        subgoal: what is near.
        low: height of the head in the world, metres.
        rng: random numbers.
    Returns:
        At least `_LEAST_RISE_M`.
    """
    clearance = subgoal.clear_height - low + _CLEAR_M.draw(rng)
    return max(_LEAST_RISE_M, clearance) * UP


def _draw_about(length: float, rng: Generator) -> float:
    """Draw a length with a random error, mostly a large one, which evolution is to correct.

    Args:
        length: that would be right, metres; or a factor.
        rng: random numbers.
    Returns:
        In the unit of the length.
    """
    error = _GOOD_ERROR if rng.random() < _GOOD else _LARGE_ERROR
    return length * rng.normal(1.0, error)


def push(
    path: HeadPath,
    subgoal: Subgoal,
    head: Head,
    rng: Generator,
) -> str:
    """Come down behind or around the bodies, and move them horizontally; fast if they are to be thrown or to fall.

    Args:
        path: that waypoints are added to.
        subgoal: what is moved.
        head: a pusher, which may enclose the bodies.
        rng: random numbers.

    Returns:
        What it does, in words, as a part of the sentence that describes the plan.
    """
    extent = subgoal.extent(
        add_error(subgoal.heading, _HEADING_RAD, rng, often=_HEADINGS_OFF)
    )

    # How far behind the bodies the head comes down; a pen comes down around them.
    gap = max(_PEN_M, (head.depth - extent.along) / 2)

    if head.primitive != "surround":
        gap = _BEHIND_M.draw(rng)

    # How far beside: what has walls must meet the bodies in their middle.
    slip = 0.0
    if head.depth == 0:
        slip = rng.normal(0.0, _SLIP) * extent.across

    # How high: clear of the ground, and sometimes well above the bodies' foot.
    above = _GROUND_M.draw(rng)
    if subgoal.over_edge or subgoal.height < _GROUND_M.high:
        above = min(above, _MIDDLE * subgoal.height)

    low = subgoal.lower[2] + above
    if rng.random() < _HIGH and head.primitive == "push":
        low += _HIGHER.draw(rng) * subgoal.height

    # The stroke, at the end of which the head may swing to the side.
    length, speed, swing = _draw_stroke(subgoal, rng)
    start = (extent.rear - gap) * extent.ahead + extent.middle
    start = start + slip * extent.side + low * UP
    end = start + (gap + length) * extent.ahead

    # Come down from above everything near.
    rise = _draw_rise(subgoal, low, rng)
    path.go(extent.heading - swing, start + rise, start)

    # Segments are as many as the speed asks for.
    path.move(end, extent.heading + swing, speed)

    text = (
        f"comes down {gap * 1000:.0f} mm behind and moves by {length:.2f} m at "
        f"{speed:.2f} m/s"
    )

    leaves = rng.random() < _LEAVES or len(subgoal.solids) > 1 or subgoal.alone
    if not (leaves or subgoal.is_released):
        return text

    # A face backs off first, so that it does not drag the bodies up; walls rise straight around them.
    if head.primitive == "push":
        end = end - _LEAVE_M * extent.ahead
        path.go(extent.heading + swing, end, touch=True)

    path.go(extent.heading + swing, end + rise, touch=True)

    return f"{text}, then leaves"


def _draw_stroke(subgoal: Subgoal, rng: Generator) -> tuple[float, float, float]:
    """Draw how far a head pushes, metres, at which speed, m/s, and by how much it swings about, radians.

    Bodies that are to fall off an edge, or farther away than the arm reaches, are pushed fast.

    Args:
        subgoal: what is moved.
        rng: random numbers.
    Returns:
        The length, the speed and the swing.
    """
    goal = subgoal.center + subgoal.shift
    distance = np.hypot(*subgoal.workspace.from_axis(goal))

    # These are drawn in any case, so that the random numbers after them are the same.
    length = _draw_about(subgoal.length, rng)
    speed = _PUSH_M_S.draw(rng)

    # They go over an edge that is known: slowly, so that they take nothing else along.
    if subgoal.over_edge:
        return subgoal.length * _EDGE_WAY.draw(rng), speed, 0.0

    # They go over some edge: neither the way nor the speed is critical.
    if subgoal.falls:
        length = subgoal.length * _FALL_WAY.draw(rng)
        speed = _FALL_M_S.draw(rng)
        return length, speed, 0.0

    # They are thrown.
    if distance > subgoal.workspace.farthest:
        length = _THROW_WAY_M.draw(rng)
        return length, _THROW_M_S, _SWING_RAD.draw(rng)

    return length, speed, 0.0


def scoop(
    path: HeadPath,
    subgoal: Subgoal,
    head: Head,
    rng: Generator,
) -> str:
    """Slide under the bodies and lift them; or carry them to the goal and tip them out there.

    Args:
        path: that waypoints are added to.
        subgoal: what is lifted.
        head: a scoop or a fork.
        rng: random numbers.

    Returns:
        What it does, in words, as a part of the sentence that describes the plan.
    """
    # Bodies that are only lifted can be reached from any side.
    in_place = subgoal.length < _IN_PLACE_M
    heading = subgoal.heading

    if in_place:
        heading += rng.choice(_SIDES_RAD, p=_SIDES)

    # Between tines below an overhang the foot has little room: they would push it, turned by more.
    under_overhang = head.level > 0.0
    error = rng.normal(0.0, _SCOOP_RAD)
    extent = subgoal.extent(heading if under_overhang else heading + error)
    heading = extent.heading

    ahead = extent.ahead

    # Slide under the bodies.
    # A head with a level goes under an overhang, not on the ground.
    low = subgoal.lower[2] + head.level + _FLOOR_M.draw(rng)
    gap = _BEFORE_M.draw(rng)
    speed = _UNDER_M_S.draw(rng)

    start = (extent.rear - gap - head.depth) * ahead + extent.middle + low * UP
    under = start + (gap + head.depth * _DEPTH.draw(rng)) * ahead

    path.go(heading, start + _draw_rise(subgoal, low, rng), start)
    path.move(under, heading, speed)

    path.hold()

    # From here on the bodies go along.
    lift = max(subgoal.shift[2] + _LIFT_MORE_M.draw(rng), 0.0)
    rise = _draw_about(lift, rng)

    if in_place:
        # Lean back at times, so that nothing slides off.
        tilt = 0.0
        if rng.random() < _TILTS:
            tilt = -_TILT_RAD.draw(rng)

        # What hangs by an overhang does not slide off, and leaning would move it.
        if under_overhang:
            tilt = 0.0

        lifted = under + rise * UP
        path.move(lifted, heading, _LIFT_M_S.draw(rng))
        path.add(Pose.xyz_rpy(lifted, (0.0, tilt, heading)), touch=True)

        return f"slides under at {speed:.2f} m/s and lifts by {rise:.2f} m"

    return _carry_on_tray(path, subgoal, head, extent, rise, rng)


def _carry_on_tray(
    path: HeadPath,
    subgoal: Subgoal,
    head: Head,
    extent: Extent,
    rise: float,
    rng: Generator,
) -> str:
    """Carry bodies that lie on a scoop over everything near; hold them at their place, or tip them out there.

    Args:
        path: that waypoints are added to; at its end the head is under the bodies.
        subgoal: what is carried.
        head: that it lies on.
        extent: of the bodies, along the heading of the head.
        rise: how far the bodies are to rise, metres.
        rng: random numbers.

    Returns:
        What it does, in words, as a part of the sentence that describes the plan.
    """
    heading = extent.heading
    under = path.end
    high = max(rise, subgoal.clear_height - subgoal.lower[2] + _OVER_M)
    if subgoal.is_held:
        high = max(rise, subgoal.height_on_way - subgoal.lower[2] + _OVER_M)

    lifted = under + high * UP
    there = lifted + subgoal.shift * LEVEL

    turn = Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, heading))
    if subgoal.falls_in and len(subgoal.solids) == 1:
        # It leans back, so that nothing rolls off, and its edge is over the hollow where it tips.
        turn = Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, -_LEAN_RAD.draw(rng), heading))
        path.go(turn, under, touch=True)
        middle = (extent.rear + extent.front) / 2 - under @ extent.ahead
        there = there - _TO_EDGE.draw(rng) * (head.depth - middle) * extent.ahead

    path.move(lifted, turn, _TRAY_LIFT_M_S.draw(rng))
    path.move(there, turn, _TRAY_M_S.draw(rng))

    carried = (
        f"slides under, lifts by {high:.2f} m, carries by {subgoal.length:.2f} m and"
    )
    if subgoal.is_held:
        path.move(there + (rise - high) * UP, turn, _LOWER_M_S)
        return f"{carried} holds at {rise:.2f} m"

    tipped = (0.0, _TIP_RAD.draw(rng), heading)
    path.add(Pose.xyz_rpy(there, tipped), touch=True)
    return f"{carried} tips out"


def hook(
    path: HeadPath,
    subgoal: Subgoal,
    head: Head,
    rng: Generator,
) -> str:
    """Come in from the front, beside or over the bodies; move the toe behind them; pull.

    Args:
        path: that waypoints are added to.
        subgoal: what is pulled.
        head: a hook.
        rng: random numbers.

    Returns:
        What it does, in words, as a part of the sentence that describes the plan.
    """
    extent = subgoal.extent(subgoal.heading)
    ahead = extent.ahead

    # The edge of the bodies that the arm passes, and the toe grips.
    passes_over = head.aside[2] > 0
    aside = head.aside[1] * extent.side + head.aside[2] * UP

    if passes_over:
        edge = extent.middle + subgoal.upper[2] * UP
    else:
        # The toe is as low as it can be, a little above the ground.
        toe_middle = max(head.pieces[1].size[2] / 2 - _SUNK_M, 0.0)
        toe_middle += _TOE_M.draw(rng)

        beside = extent.left if head.aside[1] > 0 else extent.right
        edge = beside * extent.side + (subgoal.lower[2] + toe_middle) * UP

    # Come in from outside of what covers the bodies.
    outside = subgoal.length if subgoal.is_covered else 0.0
    behind = edge + (extent.rear - _HOOK_BEHIND_M.draw(rng)) * ahead

    way_in = extent.front + outside + _HOOK_BEFORE_M.draw(rng)
    before = edge + way_in * ahead

    # Under a cover there is no way down from above.
    rise = _UNDER_COVER_M * UP

    if not subgoal.is_covered:
        rise = _draw_rise(subgoal, subgoal.lower[2], rng)

    path.go(extent.heading, before + aside + rise, before + aside)
    path.go(extent.heading, behind + aside, behind)

    # Pull, most often too far or not far enough: that is for evolution to find.
    length = _draw_about(subgoal.length, rng)
    end = edge + (extent.rear + length) * ahead
    path.move(end, extent.heading, _PUSH_M_S.draw(rng))

    passes = "over" if passes_over else "beside"
    text = f"passes {passes}, gets behind and pulls by {length:.2f} m"
    if not subgoal.is_released:
        return text

    path.go(extent.heading, end - _LEAVE_M * ahead, touch=True)

    return f"{text}, then backs off"


def clamp(
    path: HeadPath,
    subgoal: Subgoal,
    head: Head,
    rng: Generator,
) -> str:
    """Come down with the bodies between the fingers, close, drag or carry them, and open at the goal.

    Args:
        path: that waypoints are added to.
        subgoal: what is held.
        head: two pads on the fingers, or the bare hand.
        rng: random numbers.

    Returns:
        What it does, in words, as a part of the sentence that describes the plan.
    """
    # The fingers are most often turned as at home.
    turn = rng.choice(_HAND_TURNS_RAD, p=_HAND_TURNS)
    if subgoal.extent(turn).across > head.width:
        turn = subgoal.grip_heading

    yaw = add_error(turn, _GRIP_RAD, rng)  # how the fingers are turned about z

    low = subgoal.lower[2] + _draw_grip_height(subgoal, head, rng)
    grasp = np.array([*subgoal.center[:2], low])

    # Come down, and close them around the bodies.
    path.go(yaw, grasp + _draw_rise(subgoal, low, rng), grasp)
    path.go(yaw, grasp, grip=1.0, touch=True)

    path.hold()

    # Bodies with a free way on the ground may be dragged.
    rises = subgoal.rises
    is_barred = subgoal.is_blocked(subgoal.shift) or loses_ground(subgoal)
    is_free = not rises and not is_barred
    drags = is_free and rng.random() < _DRAGS
    goal = grasp + _draw_about(1.0, rng) * subgoal.shift * LEVEL

    lift = 0.0 if drags else _draw_lift(subgoal, rng)

    # Get out from under an obstacle first.
    sidestep = subgoal.find_sidestep() if rises else np.zeros(3)

    if sidestep.any():
        path.move(grasp + _OUT_M * UP, yaw, _LOWER_M_S, grip=1.0)
        path.move(grasp + sidestep + _ASIDE_M * UP, yaw, _SIDE_M_S, grip=1.0)

        grasp = grasp + sidestep
        goal = goal + sidestep

    # Carry or drag them to the goal.
    if not drags:
        path.move(grasp + lift * UP, yaw, _RISE_M_S, grip=1.0)

    path.move(goal + lift * UP, yaw, _CARRY_M_S.draw(rng), grip=1.0)

    _set_down(path, subgoal, goal, lift, rng)

    verb = "drags" if drags else "carries"
    distance = np.linalg.norm(subgoal.shift)

    return f"closes the fingers and {verb} by {distance:.2f} m"


def _set_down(
    path: HeadPath,
    subgoal: Subgoal,
    goal: Array,
    lift: float,
    rng: Generator,
) -> None:
    """Set bodies down where the goal is, and open; what must be held stays in hand.

    What is to get into a hollow is mostly let fall from where it was carried.

    Args:
        path: that waypoints are added to, with the bodies over their goal.
        subgoal: what is held.
        goal: where the head is over the goal, as low as it gripped the bodies, (3,).
        lift: how far above that they were carried, metres; 0: they were dragged.
        rng: random numbers.
    """
    is_held = subgoal.rises or subgoal.is_held
    opens = subgoal.is_released or subgoal.falls_in or not is_held

    height = min(lift, subgoal.shift[2] + _SET_DOWN_M)
    if subgoal.falls_in and rng.random() < _LETS_FALL:
        height = lift

    yaw = float(path.poses[-1].rpy[2])
    down = goal + height * UP
    if opens or subgoal.length > _IN_PLACE_M:
        path.move(down, yaw, _LOWER_M_S, grip=1.0)

    if not opens:
        return

    path.go(yaw, down, touch=True)
    if subgoal.is_released:
        path.go(yaw, down + _draw_rise(subgoal, down[2], rng), touch=True)


def _draw_grip_height(
    subgoal: Subgoal,
    head: Head,
    rng: Generator,
) -> float:
    """Draw how far above the bodies' foot the pads' foot is, metres.

    What is much taller than the pads, and leaves the ground, hangs from them: below its middle it would tip over.

    Args:
        subgoal: what is held.
        head: two pads on the fingers, or the bare hand.
        rng: random numbers.
    """
    pads = head.attachment[2]
    if subgoal.rises and subgoal.height > _TALL * pads:
        return float(_TALL_GRIP.draw(rng) * subgoal.height - pads / 2)

    highest = max(_LOW_GRIP_M, _LOW_GRIP * subgoal.height)
    return Range(_LOW_GRIP_M, highest).draw(rng)


def _draw_lift(subgoal: Subgoal, rng: Generator) -> float:
    """Draw how far bodies are lifted to be carried, metres.

    It is as high as the goal asks for, and over what is near where they are carried along.

    Args:
        subgoal: what is carried.
        rng: random numbers.
    Returns:
        From where they are, metres.
    """
    over_obstacles = 0.0
    if subgoal.length > _IN_PLACE_M:
        over_obstacles = subgoal.height_on_way - subgoal.lower[2] + _PASS_M

    return float(max(subgoal.shift[2], over_obstacles)) + _CARRY_MORE_M.draw(rng)


PRIMITIVES: dict[str, PrimitiveMotion] = {
    "push": push,
    "surround": push,
    "scoop": scoop,
    "hook": hook,
    "clamp": clamp,
    "cup": tip_in,
}
"""The motions of heads that have none of their own, by primitive."""
