"""Feel what pushes an arm, decide whether a guard fires, and bring the arm to rest."""

from __future__ import annotations

import math

import numpy as np

from core.geometry import Array
from core.interfaces import Feel, Guard, JointTrajectory
from core.robot.kinematics import Arm
from core.values.jobs import FEEL_S

_NOISE = 9  # keeps these random numbers apart from others of the same seed
_DAMPING = 1e-6  # as a share of the Jacobian's square, so that estimates stay finite at a singularity
_MEDIAN = 3  # readings
_LONGER = 1.2  # times as long, while stopping needs more acceleration than a joint has
_STILL_M = 1e-6  # the mount moves by less between two readings: no direction


class ForceSense:
    """Estimates the force at the flange as an arm does: from the torques of its joints, each with noise.

    Args:
        arm: that feels.
        noise: the standard deviation of each torque, N m.
        seed: of the noise.
    """

    def __init__(self, arm: Arm, noise: float, seed: int) -> None:
        self._arm = arm
        self._noise = noise
        self._random = np.random.default_rng([seed, _NOISE])

    def estimate(self, joints: Array, points: Array, forces: Array) -> Array:
        """Estimate the force (3,), newtons.

        Args:
            joints: of the arm (J,).
            points: (C, 3) where something pushes.
            forces: (C, 3) with which it pushes.
        """
        jacobian = self._arm.jacobian(joints)
        torques = self._noise * self._random.standard_normal(len(joints))

        if len(forces):
            turning = (points - self._arm.positions(joints[None])).T @ forces
            around = turning - turning.T  # the sum of cross products
            moment = [around[1, 2], around[2, 0], around[0, 1]]
            torques += jacobian.T @ np.concatenate([forces.sum(axis=0), moment])

        # Damped least squares.
        square = jacobian @ jacobian.T
        square += _DAMPING * np.trace(square) * np.eye(len(square))
        wrench = np.linalg.solve(square, jacobian @ torques)

        return np.asarray(wrench[:3], dtype=np.float64)


class Watch:
    """Watches for a guard on the way to its waypoint.

    The first reading counts as zero. Of three readings in a row the middle one counts.

    Args:
        guard: says what it waits for.
        arm: that feels.
        feel: has the thresholds.

    Attributes:
        force: (3,) what was felt last, less what was felt at first, newtons.
    """

    def __init__(self, guard: Guard, arm: Arm, feel: Feel) -> None:
        self.guard = guard
        self.force: Array = np.zeros(3)
        self._arm = arm
        self._feel = feel
        self._sensed: list[Array] = []

    def has_fired(
        self,
        trajectory: JointTrajectory,
        time: float,
        joints: Array,
        force: Array,
    ) -> bool:
        """Take a reading, and report whether the guard fires: by the force, or by how far the arm lags.

        Args:
            trajectory: that the arm is driven along.
            time: of it, now, seconds.
            joints: of the arm (J,).
            force: (3,) at the flange, in the world, newtons.
        """
        self._sensed.append(force)
        recent = self._sensed[-_MEDIAN:]
        middle = np.sort(recent, axis=0)[len(recent) // 2]
        self.force = middle - self._sensed[0]

        if self.guard.until == "touch":
            return float(np.linalg.norm(self.force)) > self._feel.threshold

        targets, _ = trajectory.sample(np.array([time - FEEL_S, time]))
        if self.guard.until == "stall":
            return float(np.abs(targets[1] - joints).max()) > self._feel.stall

        before, now = self._arm.positions(targets)
        way = float(np.linalg.norm(now - before))
        against = float(self.force @ (before - now))
        return way > _STILL_M and against / way > self.guard.newtons


def bring_to_rest(
    trajectory: JointTrajectory,
    time: float,
    end: Array | None,
    arm: Arm,
    speed: float,
) -> JointTrajectory:
    """Cut a trajectory, and come to rest.

    Each joint's course is the cubic between the two; it takes as long as the acceleration limits ask for.

    Args:
        trajectory: what is cut.
        time: when, seconds.
        end: joints (J,) that are near; None: where the targets are.
        arm: gives the limits.
        speed: the share of them to use.
    """
    targets, fingers = trajectory.sample(np.array([time - FEEL_S, time]))
    begin = targets[1]
    velocity = (targets[1] - targets[0]) / FEEL_S
    way = np.zeros_like(begin)

    if end is not None:
        way = end - begin

    # As short as the limits allow.
    limits = speed * arm.acceleration_limits
    lasts = FEEL_S

    while True:
        at_first = 6 * way / lasts - 4 * velocity
        at_last = 2 * velocity - 6 * way / lasts
        if not (np.abs([at_first, at_last]) > limits * lasts).any():
            break

        lasts *= _LONGER

    count = max(1, math.ceil(lasts / FEEL_S))
    shares = np.linspace(0.0, 1.0, count + 1)[1:, None]
    course = begin + lasts * velocity * shares * (1 - shares) ** 2
    course = course + way * shares**2 * (3 - 2 * shares)

    before = trajectory.times < time
    cut = JointTrajectory(
        np.append(trajectory.times[before], time),
        np.vstack([trajectory.arm[before], begin]),
        np.append(trajectory.fingers[before], fingers[1]),
    )
    return cut.extended(
        lasts * shares[:, 0],
        np.clip(course, arm.lower, arm.upper),
        np.full(count, fingers[1]),
    )
