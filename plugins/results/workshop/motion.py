"""Sample a motion at a fixed rate for a real arm, smooth and within its limits.

Engines play joint targets that are linear between instants 10 ms apart. An arm that interpolates so at 1 kHz breaks its
acceleration limits several times over. Here the targets are the control points of a cubic B-spline. Its accelerations
are means of those of the targets, so that it keeps the limits without taking longer: what is struck or thrown flies as
it was simulated. A spline through the targets swings about them, and had to be up to 15 % slower.
"""

from __future__ import annotations

import io
import math
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BPoly, BSpline

from core.errors import UsageError
from core.geometry import Array
from core.interfaces import JointTrajectory
from core.robot.kinematics import Arm
from core.values.robots import Robot

SHARE = 0.97
"""Of the velocity and acceleration limits, at most."""

APPROACH = 0.1
"""Of the velocity limits, at most: the first motion from where the arm stands."""

STEP_S = 0.01
"""Between two knots of the spline, which is as much behind the targets, since it begins at rest."""


@dataclass(frozen=True, eq=False)
class Sampled:
    """A motion at a fixed rate.

    Attributes:
        times: (T,) seconds, from 0.
        positions: (T, J) of the arm's joints, radians, or metres where one slides; with ``velocities`` and
            ``accelerations``.
        fingers: (T,) each finger's distance from the middle, metres.
        slower: how many times longer it takes than the motion that was simulated.
    """

    times: Array
    positions: Array
    velocities: Array
    accelerations: Array
    fingers: Array
    slower: float = 1.0

    @property
    def trajectory(self) -> JointTrajectory:
        """The motion as engines play it."""
        return JointTrajectory(self.times, self.positions, self.fingers)

    def every(self, seconds: float) -> list[int]:
        """Return the samples nearest to multiples of ``seconds``, and the last."""
        end = self.times[-1]
        wanted = np.append(np.arange(0.0, end, seconds), end)
        samples = np.unique(np.searchsorted(self.times, wanted - 1e-9))
        chosen: list[int] = samples.tolist()

        return chosen

    def loads(self, arm: Arm) -> tuple[Array, Array]:
        """Return the largest share of each joint's velocity limit and of its acceleration limit: each (J,)."""
        fastest = np.abs(self.velocities).max(axis=0)
        hardest = np.abs(self.accelerations).max(axis=0)
        return fastest / arm.velocity_limits, hardest / arm.acceleration_limits


def sample(
    trajectory: JointTrajectory, arm: Arm, rate_hz: float, speed: float = 1.0
) -> Sampled:
    """Sample a trajectory at a fixed rate.

    Args:
        trajectory: as engines play it.
        arm: whose limits the motion keeps.
        rate_hz: samples a second.
        speed: the motion takes 1 / ``speed`` times as long, or longer where a limit asks for it.

    Raises:
        UsageError: the rate or the speed can't be used.
    """
    if not 10 <= rate_hz <= 10_000:
        raise UsageError(f"rate must be between 10 and 10000 Hz, got {rate_hz}")
    if not 0 < speed <= 1:
        raise UsageError(f"speed must be above 0 and at most 1, got {speed}")

    # The spline waits for two steps at both ends.
    steps = math.ceil(trajectory.duration / STEP_S - 1e-9) + 2
    instants = STEP_S * np.arange(-2, steps + 1, dtype=np.float64)
    targets, _ = trajectory.sample(instants)
    spline = BSpline(STEP_S * np.arange(-3, steps + 4), targets, 3)

    fine = STEP_S / 5 * np.arange(5 * steps + 1)
    fastest = (np.abs(spline(fine, 1)) / arm.velocity_limits).max() / SHARE
    hardest = (np.abs(spline(fine, 2)) / arm.acceleration_limits).max() / SHARE
    slower = max(1.0 / speed, float(fastest), math.sqrt(hardest))

    duration = STEP_S * steps
    times = np.arange(math.ceil(duration * slower * rate_hz - 1e-6) + 1) / rate_hz
    spline_times = np.minimum(times / slower, duration)
    _, fingers = trajectory.sample(spline_times - STEP_S)

    return Sampled(
        times=times,
        positions=np.clip(spline(spline_times), arm.lower, arm.upper),
        velocities=spline(spline_times, 1) / slower,
        accelerations=spline(spline_times, 2) / slower**2,
        fingers=fingers,
        slower=slower,
    )


def approach(
    start: Array, end: Array, opening: float, arm: Arm, rate_hz: float
) -> Sampled:
    """Move slowly from joints to others, all in step, at rest at both ends.

    The course is the polynomial of fifth degree without acceleration at the ends.

    Args:
        start: joints (J,), radians.
        end: joints (J,), radians.
        opening: of the fingers, each from the middle, metres.
        arm: whose limits count.
        rate_hz: samples a second.

    Raises:
        UsageError: the start is beyond a joint's limit.
    """
    low = arm.lower - 1e-6
    high = arm.upper + 1e-6
    if start.shape != end.shape or ((start < low) | (start > high)).any():
        pairs = zip(arm.lower, arm.upper, strict=True)
        limits = ", ".join(
            f"{lowest:.2f} to {highest:.2f}" for lowest, highest in pairs
        )
        raise UsageError(
            f"from must be {len(end)} joint positions, radians or metres, within {limits}; got {start.tolist()}"
        )

    way = end - start
    speeds = APPROACH * arm.velocity_limits
    duration = max(float((1.875 * np.abs(way) / speeds).max()), 1 / rate_hz)

    times = np.arange(math.ceil(duration * rate_hz) + 1) / rate_hz
    rest = np.zeros_like(way)
    course = BPoly.from_derivatives(
        [0, duration], [[start, rest, rest], [end, rest, rest]]
    )
    within = np.minimum(times, duration)

    return Sampled(
        times=times,
        positions=course(within),
        velocities=course(within, 1),
        accelerations=course(within, 2),
        fingers=np.full(len(times), opening),
    )


def cut(
    trajectory: JointTrajectory, arrivals: Array, instant: float, arm: Arm
) -> JointTrajectory | None:
    """Return the part of a trajectory up to the last rest before an instant.

    Args:
        trajectory: as engines play it.
        arrivals: when the waypoints are reached (W,), s; the arm rests at some of them.
        instant: s.
        arm: whose limits tell what a rest is.

    Returns:
        The part; None if the arm never rests before.
    """
    most = arm.acceleration_limits * STEP_S**2

    for end in np.sort(arrivals[arrivals < instant])[::-1].tolist():
        joints, fingers = trajectory.sample(end + STEP_S * np.array([-1.0, 0.0, 1.0]))
        if (np.abs(np.diff(joints, axis=0)) > most).any():
            continue

        before = trajectory.times < end - 1e-9
        return JointTrajectory(
            np.append(trajectory.times[before], end),
            np.vstack([trajectory.arm[before], joints[1]]),
            np.append(trajectory.fingers[before], fingers[1]),
        )

    return None


def to_csv(motion: Sampled, robot: Robot) -> str:
    """Write a row for each sample: time, then positions, velocities and accelerations, and the fingers."""
    units = ["m" if slides else "rad" for slides in robot.slides]
    names = ["time_s"]
    for rate in ("", "_s", "_s2"):
        for joint, unit in zip(robot.arm_joints, units, strict=True):
            names.append(f"{joint}_{unit}{rate}")

    names.append("finger_m")

    text = io.StringIO()
    table = np.column_stack(
        [
            motion.times,
            motion.positions,
            motion.velocities,
            motion.accelerations,
            motion.fingers,
        ]
    )
    np.savetxt(
        text, table, fmt="%.7g", delimiter=",", header=",".join(names), comments=""
    )

    return text.getvalue()
