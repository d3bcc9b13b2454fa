"""Motion primitives, ways of using a head: each adds the waypoints for one subgoal to a path, and says what it does."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.random import Generator

from core.geometry import Array, Pose
from plugins.vlms.offline.heads import Head
from plugins.vlms.offline.plans import Path
from plugins.vlms.offline.scene_analysis import UP, Subgoal

Primitive = Callable[[Path, Subgoal, Head, Generator], str]

_FALL_M = 0.1  # bodies that go down by more are pushed over an edge


def _over(subgoal: Subgoal, low: float, rng: Generator) -> Array:
    """The vector up from height ``low`` to where the head is clear of everything."""
    return max(0.03, subgoal.clear_z - low + rng.uniform(0.01, 0.05)) * UP


def _about(length: float, rng: Generator) -> float:
    """``length`` with a random error, mostly a large one, which evolution is to correct."""
    return length * rng.normal(1.0, 0.015 if rng.random() < 0.3 else 0.18)


def push(path: Path, subgoal: Subgoal, head: Head, rng: Generator) -> str:
    """Come down behind or around the bodies, and move them horizontally; fast if they are to be thrown or to fall."""
    falls = subgoal.shift[2] < -_FALL_M
    thrown = bool(
        np.hypot(*subgoal.space.from_axis(subgoal.center + subgoal.shift))
        > subgoal.space.farthest
    )
    way = subgoal.extent(subgoal.heading + rng.normal(0.0, 0.06) * (rng.random() < 0.4))
    spare = max(0.001, (head.depth - way.along) / 2)
    gap = spare if head.use == "surround" else rng.uniform(0.004, 0.03)
    slip = rng.normal(0.0, 0.08) * way.across if head.depth == 0 else 0.0
    low = subgoal.lower[2] + rng.uniform(0.002, 0.012)
    if rng.random() < 0.25 and head.use == "push":
        low += rng.uniform(0.0, 0.5) * subgoal.tall
    length = _about(subgoal.length, rng)
    speed = rng.uniform(0.1, 0.4)
    swing = 0.0
    if falls:
        length = subgoal.length * rng.uniform(0.4, 1.3)
        speed = rng.uniform(0.5, 2.0)
    elif thrown:
        length = rng.uniform(0.3, 0.9)
        speed = 2.0
        swing = rng.uniform(-0.8, 0.8)
    start = (way.rear - gap) * way.ahead + way.middle + slip * way.side + low * UP
    end = start + (gap + length) * way.ahead
    over = _over(subgoal, low, rng)
    path.go(way.heading - swing, start + over, start)
    path.move(end, way.heading + swing, speed)
    text = f"comes down {gap * 1000:.0f} mm behind and moves by {length:.2f} m at {speed:.2f} m/s"
    if rng.random() < 0.4 or len(subgoal.solids) > 1 or subgoal.alone:
        if head.use == "push":
            end = end - 0.03 * way.ahead
            path.go(way.heading + swing, end, touch=True)
        path.go(way.heading + swing, end + over, touch=True)
        text += ", then leaves"
    return text


def scoop(path: Path, subgoal: Subgoal, head: Head, rng: Generator) -> str:
    """Slide under the bodies and lift them; or carry them to the goal and tip them out there."""
    heading = subgoal.heading
    if subgoal.length < 0.03:
        heading += float(
            rng.choice([0.0, np.pi, np.pi / 2, -np.pi / 2], p=[0.3, 0.5, 0.1, 0.1])
        )
    way = subgoal.extent(heading + rng.normal(0.0, 0.05))
    low = subgoal.lower[2] + head.level + rng.uniform(0.0005, 0.004)
    gap = rng.uniform(0.005, 0.03)
    speed = rng.uniform(0.08, 0.35)
    start = (way.rear - gap - head.depth) * way.ahead + way.middle + low * UP
    under = start + (gap + head.depth * rng.uniform(0.85, 1.02)) * way.ahead
    path.go(way.heading, start + _over(subgoal, low, rng), start)
    path.move(under, way.heading, speed)
    path.hold()
    rise = _about(max(subgoal.shift[2] + rng.uniform(-0.01, 0.03), 0.0), rng)
    if subgoal.length < 0.03:
        tilt = -rng.uniform(0.0, 0.25) if rng.random() < 0.4 else 0.0
        path.move(under + rise * UP, way.heading, rng.uniform(0.1, 0.4))
        path.add(Pose.xyz_rpy(under + rise * UP, (0.0, tilt, way.heading)), touch=True)
        return f"slides under at {speed:.2f} m/s and lifts by {rise:.2f} m"
    high = max(rise, subgoal.clear_z - subgoal.lower[2] + 0.03)
    there = under + high * UP + subgoal.shift * np.array([1.0, 1.0, 0.0])
    path.move(under + high * UP, way.heading, rng.uniform(0.15, 0.4))
    path.move(there, way.heading, rng.uniform(0.15, 0.5))
    path.add(Pose.xyz_rpy(there, (0.0, rng.uniform(0.5, 1.3), way.heading)), touch=True)
    return f"slides under, lifts by {high:.2f} m, carries by {subgoal.length:.2f} m and tips out"


def hook(path: Path, subgoal: Subgoal, head: Head, rng: Generator) -> str:
    """Come in from the front, beside or over the bodies; move the toe behind them; pull."""
    way = subgoal.extent(subgoal.heading)
    aside = head.aside[1] * way.side + head.aside[2] * UP
    if head.aside[2] > 0:
        edge = way.middle + subgoal.upper[2] * UP
    else:
        toe_middle = max(head.pieces[1].size[2] / 2 - 0.004, 0.0) + rng.uniform(
            0.004, 0.02
        )
        edge = (way.left if head.aside[1] > 0 else way.right) * way.side + (
            subgoal.lower[2] + toe_middle
        ) * UP
    outside = subgoal.length if subgoal.covered else 0.0
    behind = edge + (way.rear - rng.uniform(0.004, 0.02)) * way.ahead
    before = edge + (way.front + outside + rng.uniform(0.01, 0.04)) * way.ahead
    over = 0.05 * UP if subgoal.covered else _over(subgoal, subgoal.lower[2], rng)
    path.go(way.heading, before + aside + over, before + aside, behind + aside, behind)
    length = _about(subgoal.length, rng)
    path.move(
        edge + (way.rear + length) * way.ahead, way.heading, rng.uniform(0.1, 0.4)
    )
    return f"passes {'over' if head.aside[2] > 0 else 'beside'}, gets behind and pulls by {length:.2f} m"


def clamp(path: Path, subgoal: Subgoal, head: Head, rng: Generator) -> str:
    """Come down with the bodies between the fingers, close, drag or carry them, and open at the goal."""
    turn = float(rng.choice([0.0, np.pi / 2, -np.pi / 2], p=[0.8, 0.1, 0.1]))
    yaw = turn + rng.normal(0.0, 0.1) * (rng.random() < 0.5)
    low = subgoal.lower[2] + rng.uniform(0.002, max(0.002, 0.4 * subgoal.tall))
    grasp = np.array([*subgoal.center[:2], low])
    path.go(yaw, grasp + _over(subgoal, low, rng), grasp)
    path.go(yaw, grasp, grip=1.0, touch=True)
    path.hold()
    rises = subgoal.shift[2] > 0.03
    drags = not rises and not subgoal.blocked(subgoal.shift) and rng.random() < 0.6
    over_ground = grasp + _about(1.0, rng) * subgoal.shift * np.array([1.0, 1.0, 0.0])
    lift = (
        0.0
        if drags
        else max(
            subgoal.shift[2],
            subgoal.clear_z - subgoal.lower[2] if subgoal.length > 0.03 else 0.0,
        )
    )
    lift += 0.0 if drags else rng.uniform(0.0, 0.03)
    if rises and (aside := subgoal.detour()).any():  # from under an obstacle
        path.move(grasp + 0.02 * UP, yaw, 0.2, grip=1.0)
        path.move(grasp + aside + 0.04 * UP, yaw, 0.1, grip=1.0)
        grasp = grasp + aside
        over_ground = over_ground + aside
    if not drags:
        path.move(grasp + lift * UP, yaw, 0.3, grip=1.0)
    path.move(over_ground + lift * UP, yaw, rng.uniform(0.1, 0.4), grip=1.0)
    if not rises:
        down = over_ground + min(lift, subgoal.shift[2] + 0.003) * UP
        path.move(down, yaw, 0.2, grip=1.0)
        path.go(yaw, down, touch=True)
    verb = "drags" if drags else "carries"
    return f"closes the fingers and {verb} by {np.linalg.norm(subgoal.shift):.2f} m"


PRIMITIVES: dict[str, Primitive] = {
    "push": push,
    "surround": push,
    "scoop": scoop,
    "hook": hook,
    "clamp": clamp,
}
"""The primitives by a head's use."""
