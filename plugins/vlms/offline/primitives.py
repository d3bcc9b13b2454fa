"""Motion primitives: ways of using a head. Each adds the waypoints for one subgoal to a path, and says what it does.

    ========  ======================================  ==========================================
    push      down behind the bodies, or around them  along the ground, sometimes up and away
    scoop     down behind the bodies, and under them  up; or up, over to the goal, and tipped out
    hook      down before the bodies, and past them   behind them, and back
    clamp     down with the bodies between the pads   closed, over to the goal, and opened
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
from plugins.vlms.offline.chance import add_error
from plugins.vlms.offline.heads import Head
from plugins.vlms.offline.paths import HeadPath
from plugins.vlms.offline.subgoals import Subgoal

PrimitiveMotion = Callable[[HeadPath, Subgoal, Head, Generator], str]
"""Adds waypoints to a path, and says in words what they do."""

# Bodies that go down by more are pushed over an edge.
_FALL_M = 0.1

# Bodies whose way on the ground is shorter are only lifted.
_IN_PLACE_M = 0.03

# How far above what is on its way a body is carried, at least.
_PASS_M = 0.01

# How often bodies are let fall into a hollow, rather than set down in it: a hand seldom fits.
_LETS_FALL = 0.7

# Bodies that are so many times as tall as the pads that hold them are gripped above their middle.
_TALL = 2.0


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
        At least 3 cm.
    """
    clearance = subgoal.clear_height - low + rng.uniform(0.01, 0.05)
    return max(0.03, clearance) * UP


def _draw_about(length: float, rng: Generator) -> float:
    """Draw a length with a random error, mostly a large one, which evolution is to correct.

    Args:
        length: that would be right, metres; or a factor.
        rng: random numbers.
    Returns:
        In the unit of the length.
    """
    error = 0.015 if rng.random() < 0.3 else 0.18
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
    extent = subgoal.extent(add_error(subgoal.heading, 0.06, rng, often=0.4))

    # How far behind the bodies the head comes down; a pen comes down around them.
    gap = max(0.001, (head.depth - extent.along) / 2)

    if head.primitive != "surround":
        gap = rng.uniform(0.004, 0.03)

    # How far beside: what has walls must meet the bodies in their middle.
    slip = 0.0
    if head.depth == 0:
        slip = rng.normal(0.0, 0.08) * extent.across

    # How high: clear of the ground, and sometimes well above the bodies' foot.
    low = subgoal.lower[2] + rng.uniform(0.002, 0.012)
    if rng.random() < 0.25 and head.primitive == "push":
        low += rng.uniform(0.0, 0.5) * subgoal.height

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

    leaves = rng.random() < 0.4 or len(subgoal.solids) > 1 or subgoal.alone
    if not (leaves or subgoal.is_released):
        return text

    # A face backs off first, so that it does not drag the bodies up; walls rise straight around them.
    if head.primitive == "push":
        end = end - 0.03 * extent.ahead
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
    speed = rng.uniform(0.1, 0.4)

    # They go over an edge: neither the way nor the speed is critical.
    if subgoal.shift[2] < -_FALL_M:
        length = subgoal.length * rng.uniform(0.4, 1.3)
        speed = rng.uniform(0.5, 2.0)
        return length, speed, 0.0

    # They are thrown.
    if distance > subgoal.workspace.farthest:
        length = rng.uniform(0.3, 0.9)
        return length, 2.0, rng.uniform(-0.8, 0.8)

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
        turns = [0.0, np.pi, np.pi / 2, -np.pi / 2]
        heading += rng.choice(turns, p=[0.3, 0.5, 0.1, 0.1])

    extent = subgoal.extent(heading + rng.normal(0.0, 0.05))
    heading = extent.heading

    ahead = extent.ahead

    # Slide under the bodies.
    # A head with a level goes under an overhang, not on the ground.
    low = subgoal.lower[2] + head.level + rng.uniform(0.0005, 0.004)
    gap = rng.uniform(0.005, 0.03)
    speed = rng.uniform(0.08, 0.35)

    start = (extent.rear - gap - head.depth) * ahead + extent.middle + low * UP
    under = start + (gap + head.depth * rng.uniform(0.85, 1.02)) * ahead

    path.go(heading, start + _draw_rise(subgoal, low, rng), start)
    path.move(under, heading, speed)

    path.hold()

    # From here on the bodies go along.
    lift = max(subgoal.shift[2] + rng.uniform(-0.01, 0.03), 0.0)
    rise = _draw_about(lift, rng)

    if in_place:
        # Lean back at times, so that nothing slides off.
        tilt = 0.0
        if rng.random() < 0.4:
            tilt = -rng.uniform(0.0, 0.25)

        lifted = under + rise * UP
        path.move(lifted, heading, rng.uniform(0.1, 0.4))
        path.add(Pose.xyz_rpy(lifted, (0.0, tilt, heading)), touch=True)

        return f"slides under at {speed:.2f} m/s and lifts by {rise:.2f} m"

    return _carry_on_tray(path, subgoal, heading, rise, rng)


def _carry_on_tray(
    path: HeadPath,
    subgoal: Subgoal,
    heading: float,
    rise: float,
    rng: Generator,
) -> str:
    """Carry bodies that lie on a scoop over everything near; hold them at their place, or tip them out there.

    Args:
        path: that waypoints are added to; at its end the head is under the bodies.
        subgoal: what is carried.
        heading: of the head, radians about z.
        rise: how far the bodies are to rise, metres.
        rng: random numbers.

    Returns:
        What it does, in words, as a part of the sentence that describes the plan.
    """
    under = path.end
    high = max(rise, subgoal.clear_height - subgoal.lower[2] + 0.03)
    if subgoal.is_held:
        high = max(rise, subgoal.height_on_way - subgoal.lower[2] + 0.03)

    lifted = under + high * UP
    there = lifted + subgoal.shift * LEVEL

    path.move(lifted, heading, rng.uniform(0.15, 0.4))
    path.move(there, heading, rng.uniform(0.15, 0.5))

    carried = (
        f"slides under, lifts by {high:.2f} m, carries by {subgoal.length:.2f} m and"
    )
    if subgoal.is_held:
        path.move(there + (rise - high) * UP, heading, 0.2)
        return f"{carried} holds at {rise:.2f} m"

    path.add(Pose.xyz_rpy(there, (0.0, rng.uniform(0.5, 1.3), heading)), touch=True)
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
        toe_middle = max(head.pieces[1].size[2] / 2 - 0.004, 0.0)
        toe_middle += rng.uniform(0.004, 0.02)

        beside = extent.left if head.aside[1] > 0 else extent.right
        edge = beside * extent.side + (subgoal.lower[2] + toe_middle) * UP

    # Come in from outside of what covers the bodies.
    outside = subgoal.length if subgoal.is_covered else 0.0
    behind = edge + (extent.rear - rng.uniform(0.004, 0.02)) * ahead

    before = edge + (extent.front + outside + rng.uniform(0.01, 0.04)) * ahead

    # Under a cover there is no way down from above.
    rise = 0.05 * UP

    if not subgoal.is_covered:
        rise = _draw_rise(subgoal, subgoal.lower[2], rng)

    path.go(extent.heading, before + aside + rise, before + aside)
    path.go(extent.heading, behind + aside, behind)

    # Pull, most often too far or not far enough: that is for evolution to find.
    length = _draw_about(subgoal.length, rng)
    end = edge + (extent.rear + length) * ahead
    path.move(end, extent.heading, rng.uniform(0.1, 0.4))

    passes = "over" if passes_over else "beside"

    return f"passes {passes}, gets behind and pulls by {length:.2f} m"


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
    turn = rng.choice([0.0, np.pi / 2, -np.pi / 2], p=[0.8, 0.1, 0.1])
    if subgoal.extent(turn).across > head.width:
        turn = subgoal.grip_heading

    yaw = add_error(turn, 0.1, rng)  # how the fingers are turned about z

    low = subgoal.lower[2] + _draw_grip_height(subgoal, head, rng)
    grasp = np.array([*subgoal.center[:2], low])

    # Come down, and close them around the bodies.
    path.go(yaw, grasp + _draw_rise(subgoal, low, rng), grasp)
    path.go(yaw, grasp, grip=1.0, touch=True)

    path.hold()

    # Bodies with a free way on the ground may be dragged.
    rises = subgoal.rises
    drags = not rises and not subgoal.is_blocked(subgoal.shift) and rng.random() < 0.6
    goal = grasp + _draw_about(1.0, rng) * subgoal.shift * LEVEL

    lift = 0.0 if drags else _draw_lift(subgoal, rng)

    # Get out from under an obstacle first.
    sidestep = subgoal.find_sidestep() if rises else np.zeros(3)

    if sidestep.any():
        path.move(grasp + 0.02 * UP, yaw, 0.2, grip=1.0)
        path.move(grasp + sidestep + 0.04 * UP, yaw, 0.1, grip=1.0)

        grasp = grasp + sidestep
        goal = goal + sidestep

    # Carry or drag them to the goal.
    if not drags:
        path.move(grasp + lift * UP, yaw, 0.3, grip=1.0)

    path.move(goal + lift * UP, yaw, rng.uniform(0.1, 0.4), grip=1.0)

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

    height = min(lift, subgoal.shift[2] + 0.003)
    if subgoal.falls_in and rng.random() < _LETS_FALL:
        height = lift

    yaw = float(path.poses[-1].rpy[2])
    down = goal + height * UP
    if opens or subgoal.length > _IN_PLACE_M:
        path.move(down, yaw, 0.2, grip=1.0)

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
        return float(rng.uniform(0.5, 0.95) * subgoal.height - pads / 2)

    return float(rng.uniform(0.002, max(0.002, 0.4 * subgoal.height)))


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

    return float(max(subgoal.shift[2], over_obstacles)) + rng.uniform(0.0, 0.03)


PRIMITIVES: dict[str, PrimitiveMotion] = {
    "push": push,
    "surround": push,
    "scoop": scoop,
    "hook": hook,
    "clamp": clamp,
}
"""The motions of heads that have none of their own, by primitive."""
