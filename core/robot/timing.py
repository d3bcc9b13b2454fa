"""Time the arm's way along a path of joints, within its limits of speed and acceleration.

A way between two stops takes the time that is asked for, or longer where a limit asks for that. A way that passes
waypoints without a stop, or that shall be faster than this rule allows, is timed by TOPP-RA (H. Pham and Q.-C. Pham, "A
New Approach to Time-Optimal Path Parameterization Based on Reachability Analysis", IEEE T-RO 2018), which uses the
limits in full. Ruckig would be no help: it knows states to be reached, and no path between them.
"""

from __future__ import annotations

import math
from itertools import accumulate, pairwise
from typing import Any, NamedTuple

import numpy as np

from core.design import DesignError
from core.geometry import Array, running_sums
from core.robot.kinematics import Arm
from core.robot.paths import bend, join_knots, sample_cells

_SAMPLE_S = 0.01  # the longest time between samples
# Per path length: the least slope that a velocity limit is divided by.
_APART_RAD = 1e-6
_STILL_RAD = 1e-5  # where no joint turns farther, TOPP-RA may find no timing
# Of the mean speed: the highest of a way that takes a fifth of its time to speed up, and a fifth to brake.
PEAK = 1.25
_ROUNDS = 20  # of slowing a way until it takes its seconds
_EXACT_S = 1e-3  # by which a way may miss its seconds


class Leg(NamedTuple):
    """A way from stop to stop along N waypoints: all are passed without a stop but the last, at which the arm rests.

    Attributes:
        knots: joints (K, J) along it, radians.
        ends: which of the knots are the stop before it and the waypoints (N + 1).
        grips: how far the gripper is closed at these (N + 1), 0 to 1.
        asked: (N,) seconds that the way to each waypoint is asked to take; above 0.
        seconds: (N,) as the tempo has them, which no way may be shorter than; nan: any.
        hurried: whether it shall take no longer than ``asked``, if the limits allow.
        wait_s: the rest after it, seconds.
    """

    knots: Array
    ends: list[int]
    grips: Array
    asked: Array
    seconds: Array
    hurried: bool
    wait_s: float


class TimedLeg(NamedTuple):
    """A way from stop to stop in time.

    Attributes:
        times: (S,) seconds since it began; the sample at 0 is left out.
        joints: (S, J) at these times, radians.
        reached: when each of its N waypoints is reached, seconds since it began; the last of ``times`` at the end.
    """

    times: Array
    joints: Array
    reached: list[float]


def time_leg(leg: Leg, arm: Arm, speed: float) -> TimedLeg:
    """Time a way from rest to rest.

    Args:
        leg: the way, and how long it shall take.
        arm: gives the limits.
        speed: the share of them to use, 0 to 1.

    Raises:
        DesignError: no timing keeps the limits.

    For example, how long the way to a single waypoint takes::

        timed = time_leg(leg, arm, speed=0.95)
        late_s = timed.reached[-1] - leg.asked[-1]
    """
    if len(leg.asked) > 1:
        return _time_fastest(leg, arm, speed)

    timed = _time_at_rest(leg, arm, speed)
    late = timed.times[-1] > leg.asked[0] + _EXACT_S

    if late and leg.hurried and _moves(leg):
        return _time_fastest(leg, arm, speed)

    return timed


def _moves(leg: Leg) -> bool:
    """Report whether a joint turns so far on a leg that TOPP-RA finds a timing."""
    return float(np.ptp(leg.knots, axis=0).max()) >= _STILL_RAD


def _time_at_rest(leg: Leg, arm: Arm, speed: float) -> TimedLeg:
    """Time a leg in the seconds that are asked for, or longer.

    Without limits the path speed is a trapezoid: a fifth of the time to accelerate, a fifth to brake. Where a joint
    would exceed a limit, the speed is reduced there, before and after: a forward and a backward pass over the squared
    path speed, as in J. Bobrow et al., "Time-optimal control of robotic manipulators along specified paths", IJRR 1985.
    Half of each acceleration limit is for the path's curvature, half for the change of speed.
    """
    asked_s = float(leg.asked[0])
    path = join_knots(leg.knots, arm)
    s = sample_cells(len(leg.knots) - 1)
    slope = np.abs(path(s, 1))
    half = arm.acceleration_limits * speed / 2

    with np.errstate(divide="ignore"):  # where a joint does not move
        fastest = np.minimum(
            (arm.velocity_limits * speed / slope).min(axis=1) ** 2,
            (half / bend(path, s)).min(axis=1),
        )
        gain = np.minimum((half / slope).min(axis=1), 5 * PEAK / asked_s**2)

    square = np.minimum(fastest, (PEAK / asked_s) ** 2)
    square[[0, -1]] = 0.0

    allowed = 2 * s[1] * np.minimum(gain[:-1], gain[1:])
    rate = np.sqrt(_limit_change(square.tolist(), allowed.tolist()))
    lasts = 2 * s[1] / (rate[:-1] + rate[1:])

    times, along = _sample_evenly(s, rate, lasts)
    return TimedLeg(times, path(along), [float(times[-1])])


def _limit_change(square: list[float], allowed: list[float]) -> list[float]:
    """Lower squared speeds until neighbours do not differ by more than is allowed: forward, and then backward.

    Works on Python floats, which are faster one by one than numpy's.

    Args:
        square: (S,) squared speeds; they are changed.
        allowed: (S - 1,) differences.
    """
    last = square[0]
    for k, change in enumerate(allowed, start=1):
        last += change
        if last < square[k]:
            square[k] = last
        else:
            last = square[k]

    for k in reversed(range(len(allowed))):
        last += allowed[k]
        if last < square[k]:
            square[k] = last
        else:
            last = square[k]

    return square


def _time_fastest(leg: Leg, arm: Arm, speed: float) -> TimedLeg:
    """Time a path by TOPP-RA, no faster than asked.

    It is slowed in rounds, until each way takes the seconds that it must.

    Raises:
        DesignError: no timing keeps the limits, or TOPP-RA is not installed.
    """
    toppra = _import_toppra()
    from toppra.algorithm import TOPPRA
    from toppra.constraint import (
        DiscretizationType,
        JointAccelerationConstraint,
        JointVelocityConstraintVarying,
    )

    last = leg.ends[-1]
    path = toppra.SplineInterpolator(np.linspace(0.0, 1.0, len(leg.knots)), leg.knots)

    s = sample_cells(last)
    marks = [end * ((len(s) - 1) // last) for end in leg.ends]
    way = np.searchsorted(leg.ends[1:-1], s * last, side="right")
    both = [-1.0, 1.0]

    acceleration = JointAccelerationConstraint(
        np.outer(arm.acceleration_limits * speed, both),
        discretization_scheme=DiscretizationType.Interpolation,
    )

    def measure_slope(place: float | Array) -> Array:
        return np.maximum(np.abs(path(place, 1)), _APART_RAD)

    quickest = (arm.velocity_limits * speed / measure_slope(s)).min(axis=1)
    asked = leg.asked

    for _ in range(_ROUNDS):
        rates = np.minimum(quickest, (PEAK * np.diff(leg.ends) / last / asked)[way])

        def limit_velocity(place: float, rates: Array = rates) -> Array:
            return np.outer(measure_slope(place) * np.interp(place, s, rates), both)

        limits = [JointVelocityConstraintVarying(limit_velocity), acceleration]
        _, rate, _ = TOPPRA(limits, path, gridpoints=s).compute_parameterization(0, 0)
        if rate is None:
            raise DesignError(
                "no tempo was found that keeps the arm's limits; ask for fewer 'through' or more time"
            )

        lasts = 2 * np.diff(s) / (rate[:-1] + rate[1:])
        took = np.array([lasts[a:b].sum() for a, b in pairwise(marks)])

        short = took < leg.seconds - _EXACT_S
        if not short.any():
            break

        asked = np.where(short, asked * leg.seconds / took, asked)

    times, along = _sample_evenly(s, rate, lasts)
    passed = accumulate(took[:-1].tolist())
    return TimedLeg(times, path(along), [*passed, float(times[-1])])


def _import_toppra() -> Any:
    """Import TOPP-RA, which takes a second.

    Raises:
        DesignError: it is not installed.
    """
    try:
        import toppra
    except ModuleNotFoundError as error:
        raise DesignError(
            "the plan's tempo needs TOPP-RA, which is not installed: pip install toppra (where it has no wheel, this "
            "needs a C++ compiler)"
        ) from error

    toppra.setup_logging("ERROR")
    return toppra


def _sample_evenly(s: Array, rate: Array, lasts: Array) -> tuple[Array, Array]:
    """Sample a timed path evenly.

    Args:
        s: (S,) places on the path.
        rate: (S,) the path speed there.
        lasts: (S - 1,) how long the steps between them take, seconds.

    Returns:
        Times (T,), seconds, and places on the path (T,).
    """
    instants = running_sums(lasts)
    duration = instants[-1]
    count = max(1, math.ceil(duration / _SAMPLE_S))
    times = np.linspace(0.0, duration, count + 1)[1:]

    step = instants.searchsorted(times, side="right") - 1
    step = np.minimum(step, len(lasts) - 1)
    since = times - instants[step]

    growth = (rate[step + 1] - rate[step]) / lasts[step] / 2
    along = s[step] + rate[step] * since + growth * since**2
    return times, np.clip(along, 0.0, 1.0)
