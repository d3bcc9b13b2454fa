"""Turn waypoints into a timed joint trajectory, once, before any engine is involved."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import accumulate, pairwise

import numpy as np
import numpy.typing as npt
from scipy.interpolate import BSpline, PchipInterpolator, make_interp_spline
from scipy.spatial.transform import Rotation

from core.geometry import Array, Pose
from core.interfaces import JointTrajectory, RolloutSettings, Task, Tempo, Waypoints
from core.robot.kinematics import Arm, arm_of

_ROUNDING = 1e-9  # radians
# Inverse kinematics is solved at knots this close; a cubic spline joins them.
_KNOT_M = 0.02
_KNOT_RAD = 0.1
_SAMPLE_S = 0.01
_NO_WAY_M = 1e-6
_SLOWED = 1.05  # from here on it is reported
_ROUNDS, _EXACT_S = 12, 1e-3  # of lowering the speed of a way that shall take its seconds


@dataclass(frozen=True, eq=False)
class Motion:
    """A joint trajectory and its figures.

    ``distance_m``: metres travelled by the end-effector's origin from home through all waypoints, along the joint path.
    ``ik_error_m``, ``ik_error_rad``: the largest errors of the inverse kinematics from the first waypoint on.
    ``arrivals``: when each of the N waypoints is reached (N,), seconds. ``misses``: those errors on the way to each, at
    most (N, 2), metres and radians; for the first only on arrival. ``plan``: the waypoints (N, 6) or (N, 7).
    ``slowed``: for each waypoint with a tempo, how many times slower than asked its way is (N,); 1: as asked.
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
        """Say which waypoints were reached slower than asked."""
        late = np.flatnonzero(self.slowed > _SLOWED)
        return [
            f"waypoint {k + 1} was reached {self.slowed[k]:.1f} times slower than asked: the arm's limits" for k in late
        ]


def plan_motion(
    plan: Array, home: Pose, arm: Arm, *, segment_s: float = 0.5, speed: float = 0.95, tempo: Tempo | None = None
) -> Motion:
    """Plan the motion from the home pose through all waypoints, at rest at each unless ``tempo`` says otherwise.

    In a segment the position moves on a straight line, the orientation by SLERP and the fingers linearly. It lasts
    ``segment_s``, or longer if a joint would exceed its velocity or acceleration limit (times ``speed``).

    Args:
        plan: (N, 6) or (N, 7), see `core.plans.Waypoints`.
        home: where the end-effector starts.
        arm: gives kinematics and limits.
        segment_s: the shortest time of a segment, seconds.
        speed: the share of the velocity and acceleration limits to use, 0..1.
        tempo: when waypoints are reached; a waypoint that is passed through rounds its corner within some 2 cm.
    """
    tempo = tempo or Tempo.usual(len(plan))
    grips = np.concatenate([[0.0], plan[:, 6] if plan.shape[1] == 7 else np.zeros(len(plan))])
    positions = np.vstack([home.position, plan[:, :3]])
    rotations = Rotation.concatenate([home.rotation, Rotation.from_euler("xyz", plan[:, 3:6])])

    points, turns, ends = _path(positions, rotations)
    start = arm.home_for(home)
    solved, errors = arm.follow(points[1:], turns[1:], start, arm.jump_rad)
    knots = np.vstack([start, solved])
    asked = _asked(tempo, positions, segment_s)
    trajectory, arrivals = _in_time(knots, ends, grips, asked, tempo, arm, speed)
    distance = float(np.linalg.norm(np.diff(arm.positions(knots), axis=0), axis=1).sum())
    starts = [ends[1] - 1, *ends[1:-1]]  # errors before the first waypoint do no harm
    misses = np.maximum.reduceat(errors, starts, axis=0)
    worst = misses.max(axis=0)
    slowed = _slowed(trajectory, arrivals, tempo, arm)
    return Motion(trajectory, distance, float(worst[0]), float(worst[1]), arrivals, misses, plan, slowed)


def _in_time(
    knots: Array, ends: list[int], grips: Array, asked: Array, tempo: Tempo, arm: Arm, speed: float
) -> tuple[JointTrajectory, Array]:
    """Play joint knots (K, J) in time, and return the trajectory and when each waypoint is reached (N,).

    ``ends`` are the knots of home and the waypoints (N + 1), ``grips`` the gripper there (N + 1,), and ``asked`` the
    seconds of each way (N,).
    """
    opening = arm.robot.opening_m
    stops = [0, *(np.flatnonzero(tempo.through[:-1] == 0) + 1).tolist(), len(tempo.through)]
    segments = [
        (_joined(knots[ends[a] : ends[b] + 1], arm), np.diff(ends[a : b + 1]).tolist()) for a, b in pairwise(stops)
    ]
    times, targets, fingers, arrivals = [np.zeros(1)], [knots[:1]], [np.full(1, opening)], list[float]()
    for (a, b), (instants, joints, marks) in zip(
        pairwise(stops), _timed(segments, arm, asked, tempo.seconds, speed), strict=True
    ):
        began = times[-1][-1]
        times.append(began + instants)
        targets.append(np.minimum(np.maximum(joints, arm.lower), arm.upper))
        closed = _closing(grips[a : b + 1], instants, marks)
        fingers.append(opening * (1 - np.minimum(np.maximum(closed, 0.0), 1.0)))
        arrivals += (began + np.array(marks)).tolist()
        if tempo.waits[b - 1] > 0:
            times.append(times[-1][-1:] + tempo.waits[b - 1])
            targets.append(targets[-1][-1:])
            fingers.append(fingers[-1][-1:])
    trajectory = JointTrajectory(np.concatenate(times), np.concatenate(targets), np.concatenate(fingers))
    return trajectory, np.array(arrivals)


def planned(plan: Waypoints, task: Task, settings: RolloutSettings) -> Motion:
    """Plan the motion of the task's robot through waypoints, under a run's settings."""
    arm = arm_of(task.robot)
    return plan_motion(plan.poses, task.home, arm, segment_s=settings.segment_s, speed=settings.speed, tempo=plan.tempo)


def _path(positions: Array, rotations: Rotation) -> tuple[Array, Array, list[int]]:
    """Place knots along the poses (N + 1): positions (K, 3), rotations (K, 3, 3), and the poses' indices among them."""
    ways, turns = np.diff(positions, axis=0), rotations[:-1].inv() * rotations[1:]
    angles = np.asarray(turns.magnitude())
    ends, legs, along = [0], [np.zeros(1, dtype=int)], [np.zeros(1)]
    for number, (way, angle) in enumerate(zip(ways, angles, strict=True)):
        count = max(1, math.ceil(max(float(np.linalg.norm(way)) / _KNOT_M, float(angle) / _KNOT_RAD)))
        ends.append(ends[-1] + count)
        legs.append(np.full(count, number))
        along.append(np.linspace(0.0, 1.0, count + 1)[1:])
    leg, share = np.concatenate(legs), np.concatenate(along)[:, None]
    turned = rotations[leg] * Rotation.from_rotvec(turns.as_rotvec()[leg] * share)  # SLERP
    quaternions = turned.as_quat(scalar_first=True)
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)  # as a `Pose` would have them, to the last bit
    matrices = Rotation.from_quat(quaternions, scalar_first=True).as_matrix()
    return positions[leg] + share * ways[leg], matrices, ends


def _joined(knots: Array, arm: Arm) -> BSpline | PchipInterpolator:
    """Join knots (K, J) over s in [0, 1]: a cubic spline, or one without overshoot if that would exceed a limit."""
    s = np.linspace(0.0, 1.0, len(knots))
    path = make_interp_spline(s, knots, k=min(3, len(knots) - 1))
    between = path(np.linspace(0.0, 1.0, 8 * len(knots)))
    if ((between < arm.lower - _ROUNDING) | (between > arm.upper + _ROUNDING)).any():
        return PchipInterpolator(s, knots, axis=0)
    return path


@lru_cache(maxsize=256)
def _grid(cells: int) -> Array:
    """Sample a segment: s (S,) from 0 to 1, including the knots, where curvature is largest."""
    return np.linspace(0.0, 1.0, cells * max(16, -(-40 // cells)) + 1)


def _bend(path: BSpline | PchipInterpolator, s: Array) -> Array:
    """Compute the size of a path's second derivative (S, J) at s (S,)."""
    bend: Array = np.abs(path(s, 2))
    if isinstance(path, PchipInterpolator):  # its second derivative jumps at a knot: take both sides
        bend = np.maximum(bend, np.abs(path(np.maximum(s - 1e-9, 0.0), 2)))
    return bend


def _timed(
    segments: list[tuple[BSpline | PchipInterpolator, list[int]]], arm: Arm, asked: Array, exact: Array, speed: float
) -> Iterator[tuple[Array, Array, list[float]]]:
    """Time each path (joints over s in [0, 1], and the number of cells of each of its legs), at rest at both ends.

    Yields times (S,) in seconds, joints (S, J), and when each leg ends. Without limits the path speed of a single leg
    is a trapezoid that takes ``asked`` seconds: a fifth of the time to accelerate, a fifth to brake. Where a joint
    would exceed a limit, the speed is reduced there, before and after: a forward and a backward pass over the squared
    path speed, as in J. Bobrow et al., "Time-optimal control of robotic manipulators along specified paths", IJRR 1985.
    Half of each acceleration limit is for the path's curvature, half for the change of speed. A leg that ends or begins
    in motion is slowed until it takes the seconds that ``exact`` has for it.
    """
    placed = [(path, _grid(sum(cells))) for path, cells in segments]
    slope = np.abs(np.concatenate([path(s, 1) for path, s in placed]))
    bend = np.concatenate([_bend(path, s) for path, s in placed])
    sizes = [len(s) for _, s in placed]
    ends = np.cumsum(sizes)
    step = np.repeat([s[1] for _, s in placed], sizes)
    half = arm.acceleration_limits * speed / 2
    with np.errstate(divide="ignore"):  # where a joint does not move, and between two segments
        fastest = np.minimum(_least(arm.velocity_limits * speed / slope) ** 2, _least(half / bend))
        least = _least(half / slope)
    legs, marks = _legs([cells for _, cells in segments], sizes)
    shares = np.concatenate([np.array(cells) / sum(cells) for _, cells in segments])
    for _ in range(_ROUNDS):
        gain = np.minimum(least, (6.25 * shares / asked**2)[legs])
        square = np.minimum(fastest, (1.25 * shares / asked)[legs] ** 2)
        square[0] = square[ends[:-1]] = square[ends - 1] = 0.0
        rate = np.sqrt(_within(square.tolist(), (2 * step[:-1] * np.minimum(gain[:-1], gain[1:])).tolist()))
        with np.errstate(divide="ignore"):
            lasts = 2 * step[:-1] / (rate[:-1] + rate[1:])
        took = np.array([lasts[begin:end].sum() for begin, end in marks])
        if not (took < exact - _EXACT_S).any():
            break
        asked = np.where(took < exact - _EXACT_S, asked * exact / took, asked)
    durations = iter(took.tolist())
    for (path, s), (_, cells), end in zip(placed, segments, ends, strict=True):
        own = slice(end - len(s), end)
        instants, along = _sampled(s, rate[own], lasts[own][: len(s) - 1])
        reached = list(accumulate(next(durations) for _ in cells))
        yield instants, path(along), [*reached[:-1], float(instants[-1])]


def _legs(cells: list[list[int]], sizes: list[int]) -> tuple[npt.NDArray[np.intp], list[tuple[int, int]]]:
    """Number the leg of each sample (S,), and find the first and the last sample of each leg."""
    legs, marks, first, number = [], list[tuple[int, int]](), 0, 0
    for counts, size in zip(cells, sizes, strict=True):
        fine = (size - 1) // sum(counts)
        begin = first
        for count in counts:
            legs.append(np.full(count * fine, number))
            marks.append((begin, begin + count * fine))
            begin, number = begin + count * fine, number + 1
        legs.append(np.array([number - 1]))
        first += size
    return np.concatenate(legs), marks


def _asked(tempo: Tempo, positions: Array, segment_s: float) -> Array:
    """The time that each way is asked to take (N,), if it begins and ends at rest.

    A ``speed`` is that of the trapezoid's middle.
    """
    ways = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    by_speed = np.where(ways > _NO_WAY_M, 1.25 * ways / tempo.speeds, np.nan)
    asked = np.where(np.isfinite(tempo.seconds), tempo.seconds, by_speed)
    return np.where(np.isfinite(asked), asked, segment_s)


def _closing(grips: Array, instants: Array, marks: list[float]) -> Array:
    """How far the gripper is closed at instants (S,): from one grip to the next until each of the ``marks``."""
    closed, begin = np.empty(len(instants)), 0.0
    for k, end in enumerate(marks):
        now = instants > begin
        closed[now] = grips[k] + (grips[k + 1] - grips[k]) * (instants[now] - begin) / (end - begin)
        begin = end
    return closed


def _slowed(trajectory: JointTrajectory, reached: Array, tempo: Tempo, arm: Arm) -> Array:
    """How many times slower than asked each way is (N,), by its seconds or by its highest speed."""
    slowed = np.ones(len(reached))
    begins = np.concatenate([[0.0], reached[:-1] + tempo.waits[:-1]])
    for k in np.flatnonzero(np.isfinite(tempo.seconds)):
        slowed[k] = max(1.0, (reached[k] - begins[k]) / tempo.seconds[k])
    for k in np.flatnonzero(np.isfinite(tempo.speeds) & ~np.isfinite(tempo.seconds)):
        during = (trajectory.times >= begins[k] - 1e-9) & (trajectory.times <= reached[k] + 1e-9)
        places, times = arm.positions(trajectory.arm[during]), trajectory.times[during]
        highest = (np.linalg.norm(np.diff(places, axis=0), axis=1) / np.diff(times)).max(initial=1e-9)
        slowed[k] = max(1.0, tempo.speeds[k] / highest)
    return slowed


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


def _sampled(s: Array, rate: Array, lasts: Array) -> tuple[Array, Array]:
    """Sample a timed path evenly: times (T,) in seconds and path positions (T,).

    The path speed is ``rate`` (S,) at ``s`` (S,); the steps between take ``lasts`` (S - 1,) seconds.
    """
    instants = np.concatenate([[0.0], np.cumsum(lasts)])
    duration = instants[-1]
    times = np.linspace(0.0, duration, max(2, math.ceil(duration / _SAMPLE_S) + 1))[1:]
    at = np.minimum(np.searchsorted(instants, times, side="right") - 1, len(lasts) - 1)
    since = times - instants[at]
    along = s[at] + rate[at] * since + (rate[at + 1] - rate[at]) / lasts[at] / 2 * since**2
    return times, np.minimum(np.maximum(along, 0.0), 1.0)


def at_home(task: Task) -> JointTrajectory:
    """Make a trajectory without motion: the arm at the task's home pose, the fingers open."""
    joints = arm_of(task.robot).home_for(task.home)
    return JointTrajectory(np.zeros(1), joints[None], np.array([task.robot.opening_m]))
