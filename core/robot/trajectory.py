"""Turn waypoints into a timed joint trajectory, once, before any engine is involved."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline, PchipInterpolator, make_interp_spline
from scipy.spatial.transform import Rotation

from core.geometry import Array, Pose
from core.interfaces import JointTrajectory, Task
from core.robot.kinematics import Arm, arm_of

_ROUNDING = 1e-9  # radians
# Inverse kinematics is solved at knots this close; a cubic spline joins them.
KNOT_M = 0.02
KNOT_RAD = 0.1
_SAMPLE_S = 0.01
SLOWED = 1.05  # from here on it is reported
_NAMED = 3  # waypoints that are


@dataclass(frozen=True, eq=False)
class Motion:
    """A joint trajectory and its figures.

    ``distance_m``: metres travelled by the end-effector's origin from home through all waypoints, along the joint path.
    ``ik_error_m``, ``ik_error_rad``: the largest errors of the inverse kinematics from the first waypoint on.
    ``arrivals``: when each of the N waypoints is reached (N,), seconds. ``misses``: those errors on the way to each, at
    most (N, 2), metres and radians; for the first only on arrival. ``plan``: the waypoints (N, 6) or (N, 7).
    ``slowed``: how many times longer each way takes than asked (N,); 1 where nothing was asked.
    """

    trajectory: JointTrajectory
    distance_m: float
    ik_error_m: float
    ik_error_rad: float
    arrivals: Array
    misses: Array
    plan: Array
    slowed: Array

    def slowdowns(self) -> list[str]:
        """Say in a line which waypoints were reached later than asked; none: all were in time."""
        late = np.flatnonzero(self.slowed > SLOWED)
        if len(late) == 0:
            return []
        names = ", ".join(str(k + 1) for k in late[:_NAMED])
        names += f" and {len(late) - _NAMED} more" if len(late) > _NAMED else ""
        many, way = ("", "its way") if len(late) == 1 else ("s", "their ways up to")
        slower = f"{self.slowed.max():.1f} times slower than asked"
        return [f"waypoint{many} {names}: the arm's limits make {way} {slower}"]


class Begin(NamedTuple):
    """How a motion begins: the arm's joints (J,), at rest, and how far the gripper is closed, 0 to 1."""

    joints: Array
    grip: float = 0.0


def plan_motion(
    plan: Array, home: Pose, arm: Arm, *, segment_s: float = 0.5, speed: float = 0.95
) -> Motion:
    """Plan the motion from the home pose through all waypoints, at rest at each.

    In a segment the position moves on a straight line, the orientation by SLERP and the fingers linearly. It lasts
    ``segment_s``, or longer if a joint would exceed its velocity or acceleration limit (times ``speed``).

    Args:
        plan: (N, 6) or (N, 7), see `core.values.plans.Waypoints`.
        home: where the end-effector starts.
        arm: gives kinematics and limits.
        segment_s: the shortest time of a segment, seconds.
        speed: the share of the velocity and acceleration limits to use, 0..1.
    """
    grips, positions, rotations = poses_from(home, plan)
    points, turns, ends = straight_path(positions, rotations)
    opening = arm.robot.opening_m
    start = arm.home_for(home)
    solved, errors = arm.follow(points[1:], turns[1:], start, arm.jump_rad)
    knots = np.vstack([start, solved])
    segments = [(joined(knots[a : b + 1], arm), b - a) for a, b in pairwise(ends)]
    times, targets, fingers = [np.zeros(1)], [start[None]], [np.full(1, opening)]
    for i, (instants, joints) in enumerate(
        time_at_rest(segments, arm, segment_s, speed)
    ):
        times.append(times[-1][-1] + instants)
        targets.append(np.minimum(np.maximum(joints, arm.lower), arm.upper))
        closed = grips[i] + (grips[i + 1] - grips[i]) * instants / instants[-1]
        fingers.append(opening * (1 - np.minimum(np.maximum(closed, 0.0), 1.0)))

    trajectory = JointTrajectory(
        np.concatenate(times), np.concatenate(targets), np.concatenate(fingers)
    )
    arrivals = np.array([instants[-1] for instants in times[1:]])
    return make_motion(
        trajectory, arrivals, knots, errors, ends, plan, np.ones(len(plan)), arm
    )


def poses_from(
    home: Pose, plan: Array, grip: float = 0.0
) -> tuple[Array, Array, Rotation]:
    """Return grips (N + 1,), positions (N + 1, 3) and rotations (N + 1) of home and the waypoints."""
    grips = np.concatenate(
        [[grip], plan[:, 6] if plan.shape[1] == 7 else np.zeros(len(plan))]
    )
    positions = np.vstack([home.position, plan[:, :3]])
    return (
        grips,
        positions,
        Rotation.concatenate([home.rotation, Rotation.from_euler("xyz", plan[:, 3:6])]),
    )


def make_motion(
    trajectory: JointTrajectory,
    arrivals: Array,
    knots: Array,
    errors: Array,
    ends: Sequence[int],
    plan: Array,
    slowed: Array,
    arm: Arm,
) -> Motion:
    """Add the figures to a trajectory along joint knots (K, J), solved with errors (K - 1, 2).

    ``ends`` are the knots of home and the waypoints (N + 1).
    """
    distance = float(
        np.linalg.norm(np.diff(arm.positions(knots), axis=0), axis=1).sum()
    )
    starts = [ends[1] - 1, *ends[1:-1]]  # errors before the first waypoint do no harm
    misses = np.maximum.reduceat(errors, starts, axis=0)
    worst = misses.max(axis=0)
    return Motion(
        trajectory,
        distance,
        float(worst[0]),
        float(worst[1]),
        arrivals,
        misses,
        plan,
        slowed,
    )


def straight_path(
    positions: Array, rotations: Rotation
) -> tuple[Array, Array, list[int]]:
    """Place knots along the poses (N + 1): positions (K, 3), rotations (K, 3, 3), and the poses' indices among them."""
    ways, turns = np.diff(positions, axis=0), rotations[:-1].inv() * rotations[1:]
    angles = np.asarray(turns.magnitude())
    ends, legs, along = [0], [np.zeros(1, dtype=int)], [np.zeros(1)]
    for number, (way, angle) in enumerate(zip(ways, angles, strict=True)):
        count = max(
            1,
            math.ceil(
                max(float(np.linalg.norm(way)) / KNOT_M, float(angle) / KNOT_RAD)
            ),
        )
        ends.append(ends[-1] + count)
        legs.append(np.full(count, number))
        along.append(np.linspace(0.0, 1.0, count + 1)[1:])
    leg, share = np.concatenate(legs), np.concatenate(along)[:, None]
    turned = rotations[leg] * Rotation.from_rotvec(
        turns.as_rotvec()[leg] * share
    )  # SLERP
    quaternions = turned.as_quat(scalar_first=True)
    quaternions /= np.linalg.norm(
        quaternions, axis=1, keepdims=True
    )  # as a `Pose` would have them, to the last bit
    matrices = Rotation.from_quat(quaternions, scalar_first=True).as_matrix()
    return positions[leg] + share * ways[leg], matrices, ends


def joined(knots: Array, arm: Arm) -> BSpline | PchipInterpolator:
    """Join knots (K, J) over s in [0, 1]: a cubic spline, or one without overshoot if that would exceed a limit."""
    s, own, degree, more = _places(len(knots))
    path = make_interp_spline(s, knots, degree, own)
    between = path(more)
    if ((between < arm.lower - _ROUNDING) | (between > arm.upper + _ROUNDING)).any():
        return PchipInterpolator(s, knots, axis=0)
    return path


@lru_cache(maxsize=256)
def _places(count: int) -> tuple[Array, Array, int, Array]:
    """Say where K knots are along a path: s (K,), the knots of SciPy's spline, its degree, and s (8 K,) between."""
    s, degree = np.linspace(0.0, 1.0, count), min(3, count - 1)
    return (
        s,
        make_interp_spline(s, s, degree).t,
        degree,
        np.linspace(0.0, 1.0, 8 * count),
    )


@lru_cache(maxsize=256)
def grid(cells: int) -> Array:
    """Sample a segment: s (S,) from 0 to 1, including the knots, where curvature is largest."""
    return np.linspace(0.0, 1.0, cells * max(16, -(-40 // cells)) + 1)


def _bend(path: BSpline | PchipInterpolator, s: Array) -> Array:
    """Compute the size of a path's second derivative (S, J) at s (S,)."""
    bend: Array = np.abs(path(s, 2))
    if isinstance(
        path, PchipInterpolator
    ):  # its second derivative jumps at a knot: take both sides
        bend = np.maximum(bend, np.abs(path(np.maximum(s - 1e-9, 0.0), 2)))
    return bend


def time_at_rest(
    segments: list[tuple[BSpline | PchipInterpolator, int]],
    arm: Arm,
    segment_s: float,
    speed: float,
) -> Iterator[tuple[Array, Array]]:
    """Time each path (joints over s in [0, 1], and its number of cells), at rest at both ends.

    Yields times (S,) in seconds and joints (S, J). Without limits the path speed is a trapezoid: a fifth of the time to
    accelerate, a fifth to brake. Where a joint would exceed a limit, the speed is reduced there, before and after: a
    forward and a backward pass over the squared path speed, as in J. Bobrow et al., "Time-optimal control of robotic
    manipulators along specified paths", IJRR 1985. Half of each acceleration limit is for the path's curvature, half
    for the change of speed.
    """
    placed = [(path, grid(cells)) for path, cells in segments]
    slope = np.abs(np.concatenate([path(s, 1) for path, s in placed]))
    bend = np.concatenate([_bend(path, s) for path, s in placed])
    sizes = [len(s) for _, s in placed]
    ends = np.cumsum(sizes)
    step = np.repeat([s[1] for _, s in placed], sizes)
    half = arm.acceleration_limits * speed / 2
    with np.errstate(
        divide="ignore"
    ):  # where a joint does not move, and between two segments
        fastest = np.minimum(
            _least(arm.velocity_limits * speed / slope) ** 2, _least(half / bend)
        )
        gain = np.minimum(_least(half / slope), 6.25 / segment_s**2)
        square = np.minimum(fastest, (1.25 / segment_s) ** 2)
        square[0] = square[ends[:-1]] = square[ends - 1] = 0.0
        rate = np.sqrt(
            _within(
                square.tolist(),
                (2 * step[:-1] * np.minimum(gain[:-1], gain[1:])).tolist(),
            )
        )
        lasts = 2 * step[:-1] / (rate[:-1] + rate[1:])
    for (path, s), end in zip(placed, ends, strict=True):
        own = slice(end - len(s), end)
        instants, along = sampled(s, rate[own], lasts[own][: len(s) - 1])
        yield instants, path(along)


def _least(values: Array) -> Array:
    """The minimum of each row; fast for many short rows."""
    least: Array = np.ascontiguousarray(values.T).min(axis=0)
    return least


def _within(square: list[float], allowed: list[float]) -> list[float]:
    """Lower squared speeds (S,) until neighbours differ by no more than ``allowed`` (S - 1,).

    Works on Python floats, which are faster one by one than numpy's.
    """
    count, last = len(allowed), square[0]
    for k in range(count):
        last += allowed[k]
        if last < square[k + 1]:
            square[k + 1] = last
        else:
            last = square[k + 1]
    for k in range(count - 1, -1, -1):
        last += allowed[k]
        if last < square[k]:
            square[k] = last
        else:
            last = square[k]
    return square


def sampled(s: Array, rate: Array, lasts: Array) -> tuple[Array, Array]:
    """Sample a timed path evenly: times (T,) in seconds and path positions (T,).

    The path speed is ``rate`` (S,) at ``s`` (S,); the steps between take ``lasts`` (S - 1,) seconds.
    """
    instants = np.concatenate([[0.0], np.cumsum(lasts)])
    duration = instants[-1]
    times = np.linspace(0.0, duration, max(2, math.ceil(duration / _SAMPLE_S) + 1))[1:]
    at = np.minimum(np.searchsorted(instants, times, side="right") - 1, len(lasts) - 1)
    since = times - instants[at]
    along = (
        s[at] + rate[at] * since + (rate[at + 1] - rate[at]) / lasts[at] / 2 * since**2
    )
    return times, np.minimum(np.maximum(along, 0.0), 1.0)


def at_home(task: Task) -> JointTrajectory:
    """Make a trajectory without motion: the arm at the task's home pose, the fingers open."""
    joints = arm_of(task.robot).home_for(task.home)
    return JointTrajectory(np.zeros(1), joints[None], np.array([task.robot.opening_m]))
