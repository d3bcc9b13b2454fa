"""Plan motions with a tempo: waypoints passed through without a stop, asked speeds, asked times, waits.

A way that begins and ends at rest is timed as that of plans without a tempo, unless it is to be faster than that
allows. All others are timed by TOPP-RA (H. Pham and Q.-C. Pham, "A New Approach to Time-Optimal Path Parameterization
Based on Reachability Analysis", IEEE T-RO 2018), which uses velocity and acceleration limits in full. Ruckig would be
no help: it knows states to be reached, and no path between them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import accumulate, pairwise

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from core.design import DesignError
from core.geometry import Array
from core.interfaces import JointTrajectory, RolloutSettings, Task, Tempo, Waypoints
from core.robot.kinematics import Arm, arm_of
from core.robot.trajectory import (
    KNOT_M,
    KNOT_RAD,
    Begin,
    Motion,
    grid,
    joined,
    make_motion,
    plan_motion,
    poses_from,
    sampled,
    straight_path,
    time_at_rest,
)

_APART_M, _APART_RAD = 1e-6, 1e-6  # waypoints nearer than this are one place
_STILL_RAD = 1e-5  # where no joint turns farther, TOPP-RA may find no timing
_LEVER_M = 0.2  # a turn of 1 rad is as long as this
_ROUNDS, _EXACT_S = 20, 1e-3  # of slowing a way until it takes its seconds

Leg = tuple[
    Array, Array, list[float]
]  # instants (S,), joints (S, J), and when each of its waypoints is reached


def plan_task_motion(
    plan: Waypoints, task: Task, settings: RolloutSettings, begin: Begin | None = None
) -> Motion:
    """Plan the motion of the task's robot through waypoints, under a run's settings, from home or from ``begin``.

    Raises:
        DesignError: no tempo keeps the arm's limits.
    """
    arm, home = arm_of(task.robot), task.home
    if plan.tempo is None and begin is None:
        return plan_motion(
            plan.poses, home, arm, segment_s=settings.segment_s, speed=settings.speed
        )
    last, grip = begin or Begin(arm.home_for(home))
    grips, positions, rotations = poses_from(
        arm.forward(last) if begin else home, plan.poses, grip
    )
    tempo = plan.tempo or Tempo.usual(len(plan))
    asked = _asked(tempo, positions, settings.segment_s)
    hurried = np.isfinite(tempo.seconds) | np.isfinite(tempo.speeds)
    opening = arm.robot.opening_m
    times, targets, fingers = (
        [np.zeros(1)],
        [last[None]],
        [np.full(1, opening * (1 - grip))],
    )
    knots, errors, ends, arrivals = [last[None]], list[Array](), [0], list[float]()
    stops = [0, *(np.flatnonzero(tempo.through[:-1] == 0) + 1).tolist(), len(plan)]
    for a, b in pairwise(stops):
        points, turns, own = (straight_path if b == a + 1 else _curved_path)(
            positions[a : b + 1], rotations[a : b + 1]
        )
        solved, missed = arm.follow(points[1:], turns[1:], last, arm.jump_rad)
        path = np.vstack([last, solved])
        instants, joints, marks = _timed(
            path, own, asked[a:b], tempo.seconds[a:b], hurried[a], arm, settings.speed
        )
        began, last = times[-1][-1], path[-1]
        times.append(began + instants)
        targets.append(np.clip(joints, arm.lower, arm.upper))
        closed = np.interp(instants, [0.0, *marks], np.clip(grips[a : b + 1], 0.0, 1.0))
        fingers.append(opening * (1 - closed))
        if tempo.waits[b - 1] > 0:
            times.append(times[-1][-1:] + tempo.waits[b - 1])
            targets.append(targets[-1][-1:])
            fingers.append(fingers[-1][-1:])
        arrivals += [began + mark for mark in marks]
        ends += [ends[-1] + end for end in own[1:]]
        knots.append(solved)
        errors.append(missed)
    trajectory = JointTrajectory(
        np.concatenate(times), np.concatenate(targets), np.concatenate(fingers)
    )
    reached = np.array(arrivals)
    slowed = _slowed(trajectory, reached, tempo, arm)
    return make_motion(
        trajectory,
        reached,
        np.vstack(knots),
        np.vstack(errors),
        ends,
        plan.poses,
        slowed,
        arm,
    )


def _asked(tempo: Tempo, positions: Array, segment_s: float) -> Array:
    """The time that each way is asked to take (N,), if it begins and ends at rest.

    A speed is that of the middle of the way, of which a fifth of the time is for each of acceleration and braking.
    """
    ways = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    by_speed = np.where(ways > _APART_M, 1.25 * ways / tempo.speeds, np.nan)
    asked = np.where(np.isfinite(tempo.seconds), tempo.seconds, by_speed)
    return np.where(np.isfinite(asked), asked, segment_s)


def _curved_path(
    positions: Array, rotations: Rotation
) -> tuple[Array, Array, list[int]]:
    """Place knots on a smooth curve through poses (N + 1); see `core.robot.trajectory.straight_path`."""
    ways = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    angles = np.asarray((rotations[:-1].inv() * rotations[1:]).magnitude())
    lengths = np.maximum(ways + _LEVER_M * angles, _APART_M)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    counts = (
        np.ceil(np.maximum(ways / KNOT_M, angles / KNOT_RAD))
        .astype(int)
        .clip(1)
        .tolist()
    )
    places = [
        np.linspace(a, b, n + 1)[1:]
        for (a, b), n in zip(pairwise(along), counts, strict=True)
    ]
    at = np.concatenate([[0.0], *places])
    return (
        CubicSpline(along, positions)(at),
        RotationSpline(along, rotations)(at).as_matrix(),
        [0, *accumulate(counts)],
    )


def _timed(
    knots: Array,
    ends: Sequence[int],
    asked: Array,
    seconds: Array,
    hurried: bool,
    arm: Arm,
    speed: float,
) -> Leg:
    """Time a path (K, J) that begins and ends at rest, with its waypoints at the knots ``ends``.

    ``hurried``: it shall take no longer than ``asked``, if the limits allow.
    """
    if len(asked) == 1:
        path = [(joined(knots, arm), len(knots) - 1)]
        ((instants, joints),) = time_at_rest(path, arm, float(asked[0]), speed)
        still = float(np.ptp(knots, axis=0).max()) < _STILL_RAD
        if instants[-1] <= asked[0] + _EXACT_S or not hurried or still:
            return instants, joints, [float(instants[-1])]
    return _fastest(knots, ends, asked, seconds, arm, speed)


def _fastest(
    knots: Array,
    ends: Sequence[int],
    asked: Array,
    seconds: Array,
    arm: Arm,
    speed: float,
) -> Leg:
    """Time a path by TOPP-RA, no faster than ``asked``; see `_timed`."""
    import toppra  # takes a second
    from toppra.algorithm import TOPPRA
    from toppra.constraint import (
        DiscretizationType,
        JointAccelerationConstraint,
        JointVelocityConstraintVarying,
    )

    toppra.setup_logging("ERROR")
    cells, last = np.diff(ends), ends[-1]
    path, s = (
        toppra.SplineInterpolator(np.linspace(0.0, 1.0, len(knots)), knots),
        grid(last),
    )
    marks = [end * ((len(s) - 1) // last) for end in ends]
    leg = np.searchsorted(ends[1:-1], s * last, side="right")
    most = np.outer(arm.acceleration_limits * speed, [-1.0, 1.0])
    slope = np.maximum(np.abs(path(s, 1)), _APART_RAD)
    quickest = (arm.velocity_limits * speed / slope).min(axis=1)
    for _ in range(_ROUNDS):
        rates = np.minimum(quickest, (1.25 * cells / last / asked)[leg])

        def velocities(at: float, rates: Array = rates) -> Array:
            return np.outer(
                np.maximum(np.abs(path(at, 1)), _APART_RAD) * np.interp(at, s, rates),
                [-1.0, 1.0],
            )

        limits = [
            JointVelocityConstraintVarying(velocities),
            JointAccelerationConstraint(
                most, discretization_scheme=DiscretizationType.Interpolation
            ),
        ]
        _, rate, _ = TOPPRA(limits, path, gridpoints=s).compute_parameterization(0, 0)
        if rate is None:
            raise DesignError(
                "no tempo was found that keeps the arm's limits; ask for fewer 'through' or more time"
            )
        lasts = 2 * np.diff(s) / (rate[:-1] + rate[1:])
        took = np.array([lasts[a:b].sum() for a, b in pairwise(marks)])
        short = took < seconds - _EXACT_S
        if not short.any():
            break
        asked = np.where(short, asked * seconds / took, asked)
    instants, along = sampled(s, rate, lasts)
    return instants, path(along), [*accumulate(took[:-1].tolist()), float(instants[-1])]


def _slowed(
    trajectory: JointTrajectory, reached: Array, tempo: Tempo, arm: Arm
) -> Array:
    """How many times slower than asked each way is (N,), by its seconds or by its highest speed."""
    slowed = np.ones(len(reached))
    begins = np.concatenate([[0.0], reached[:-1] + tempo.waits[:-1]])
    for k in np.flatnonzero(np.isfinite(tempo.seconds)):
        slowed[k] = max(1.0, (reached[k] - begins[k]) / tempo.seconds[k])
    for k in np.flatnonzero(np.isfinite(tempo.speeds) & ~np.isfinite(tempo.seconds)):
        times = np.linspace(
            begins[k], reached[k], max(3, math.ceil((reached[k] - begins[k]) / 0.01))
        )
        places = arm.positions(trajectory.sample(times)[0])
        way = np.linalg.norm(np.diff(places, axis=0), axis=1)
        if way.sum() > _APART_M:
            slowed[k] = max(1.0, tempo.speeds[k] / (way / np.diff(times)).max())
    return slowed
