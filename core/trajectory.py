"""Waypoints to a timed joint trajectory, once, before any engine is involved."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator, PPoly
from scipy.spatial.transform import Rotation, Slerp

from core.geometry import Array, Pose
from core.interfaces import JointTrajectory, Task
from core.kinematics import Arm
from core.kinematics import arm as panda_arm
from core.robot import ACCELERATION_LIMITS, FINGER_OPEN

# Inverse kinematics is solved at knots this close; a cubic spline joins them.
_KNOT_M = 0.02
_KNOT_RAD = 0.1
_SAMPLE_S = 0.01


@dataclass(frozen=True, eq=False)
class Motion:
    """A joint trajectory and what is known of it beforehand.

    ``distance_m``: the way of the end-effector's origin from the first waypoint to the last, as the joints go.
    ``ik_error_m``, ``ik_error_rad``: the largest misses of the inverse kinematics at the knots of that way.
    """

    trajectory: JointTrajectory
    distance_m: float
    ik_error_m: float
    ik_error_rad: float


def plan_motion(plan: Array, home: Pose, arm: Arm, *, segment_s: float = 0.5, speed: float = 0.95) -> Motion:
    """The motion from the home pose through all waypoints, at rest at each.

    In a segment the position goes straight, the orientation by SLERP and the fingers linearly. It lasts
    ``segment_s``, or longer where a joint would pass its velocity or acceleration limit (times ``speed``).

    Args:
        plan: (N, 6) or (N, 7), see `core.design.Candidate`.
        home: where the end-effector starts.
        arm: whose kinematics and limits count.
        segment_s: the least time of a segment, seconds.
        speed: the share of the velocity and acceleration limits to use, 0..1.
    """
    count = len(plan)
    grip = plan[:, 6] if plan.shape[1] == 7 else np.zeros(count)
    grips = np.concatenate([[0.0], grip])
    positions = np.vstack([home.position, plan[:, :3]])
    rotations = Rotation.concatenate([home.rotation, Rotation.from_euler("xyz", plan[:, 3:6])])

    joints = arm.home_for(home)
    knots: list[Array] = [joints[None]]
    errors: list[tuple[float, float]] = []
    for i in range(count):
        points, turns = _path(positions[i : i + 2], rotations[i : i + 2])
        solved = [joints]
        for k, (point, turn) in enumerate(zip(points[1:], turns[1:], strict=True), start=1):
            solution = arm.inverse(Pose.from_rotation(point, turn), joints)
            joints = solution.joints
            solved.append(joints)
            if i > 0 or k == len(points) - 1:
                errors.append((solution.error_m, solution.error_rad))
        knots.append(np.array(solved))

    times, targets, fingers = [np.zeros(1)], [knots[0]], [np.full(1, FINGER_OPEN)]
    for i, segment in enumerate(knots[1:]):
        path = _joined(segment, arm)
        instants, along = _time(path, arm, segment_s, speed)
        times.append(times[-1][-1] + instants)
        targets.append(np.clip(path(along), arm.lower, arm.upper))
        closed = grips[i] + (grips[i + 1] - grips[i]) * instants / instants[-1]
        fingers.append(FINGER_OPEN * (1 - np.clip(closed, 0.0, 1.0)))

    way = np.concatenate([knots[1][-1:], *(segment[1:] for segment in knots[2:])])
    distance = float(np.linalg.norm(np.diff(arm.positions(way), axis=0), axis=1).sum())
    worst = np.max(errors, axis=0)
    trajectory = JointTrajectory(np.concatenate(times), np.concatenate(targets), np.concatenate(fingers))
    return Motion(trajectory, distance, float(worst[0]), float(worst[1]))


def _joined(knots: Array, arm: Arm) -> PPoly:
    """Joints over s in [0, 1] through knots (K, 7): smooth; where that would swing past a limit, without overshoot."""
    s = np.linspace(0.0, 1.0, len(knots))
    path = CubicSpline(s, knots, axis=0)
    between = path(np.linspace(0.0, 1.0, 8 * len(knots)))
    if ((between < arm.lower) | (between > arm.upper)).any():
        return PchipInterpolator(s, knots, axis=0)
    return path


def _path(positions: Array, rotations: Rotation) -> tuple[Array, Rotation]:
    """Knots from one pose to the next, both included: positions (K, 3) and K rotations."""
    length = float(np.linalg.norm(positions[1] - positions[0]))
    angle = float((rotations[0].inv() * rotations[1]).magnitude())
    count = max(2, int(np.ceil(max(length / _KNOT_M, angle / _KNOT_RAD))) + 1)
    along = np.linspace(0.0, 1.0, count)
    points = positions[0] + along[:, None] * (positions[1] - positions[0])
    return points, Slerp([0.0, 1.0], rotations)(along)


def _time(path: PPoly, arm: Arm, segment_s: float, speed: float) -> tuple[Array, Array]:
    """When to be where along ``path`` (joints over s in [0, 1]), at rest at both ends: instants (S,) in seconds, and
    s (S,).

    Without limits it is a trapezoid of the path's speed: a fifth of the time to speed up, a fifth to slow down. Where
    a joint would pass a limit, the speed is lower there and before and after (forward and backward pass over the
    squared path speed, as in J. Bobrow et al., "Time-optimal control of robotic manipulators along specified paths",
    IJRR 1985; half of each acceleration limit for the path's bend, half for the change of speed).
    """
    cells = len(path.x) - 1
    s = np.linspace(0.0, 1.0, cells * max(16, -(-40 // cells)) + 1)  # the knots, where it bends most, are among them
    step = s[1]
    slope = np.abs(path(s, 1))
    curve = np.maximum(np.abs(path(s, 2)), np.abs(path(np.maximum(s - 1e-9, 0.0), 2)))  # on both sides of a knot
    half = ACCELERATION_LIMITS * speed / 2
    with np.errstate(divide="ignore"):
        fastest = np.minimum((arm.velocity_limits * speed / slope).min(axis=1) ** 2, (half / curve).min(axis=1))
        gain = np.minimum((half / slope).min(axis=1), 6.25 / segment_s**2)
    square = np.minimum(fastest, (1.25 / segment_s) ** 2)
    square[[0, -1]] = 0.0
    allowed = 2 * step * np.minimum(gain[:-1], gain[1:])
    for k in range(len(allowed)):
        square[k + 1] = min(square[k + 1], square[k] + allowed[k])
    for k in reversed(range(len(allowed))):
        square[k] = min(square[k], square[k + 1] + allowed[k])
    rate = np.sqrt(square)
    lasts = 2 * step / (rate[:-1] + rate[1:])
    instants = np.concatenate([[0.0], np.cumsum(lasts)])
    duration = instants[-1]

    times = np.linspace(0.0, duration, max(2, int(np.ceil(duration / _SAMPLE_S)) + 1))[1:]
    at = np.clip(np.searchsorted(instants, times, side="right") - 1, 0, len(lasts) - 1)
    since = times - instants[at]
    along = s[at] + rate[at] * since + (rate[at + 1] - rate[at]) / lasts[at] / 2 * since**2
    return times, np.clip(along, 0.0, 1.0)


def at_home(task: Task) -> JointTrajectory:
    """No motion: the arm stays at the task's home pose, the fingers open."""
    joints = panda_arm().home_for(task.home)
    return JointTrajectory(np.zeros(1), joints[None], np.array([FINGER_OPEN]))
