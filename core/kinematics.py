"""Forward and inverse kinematics of the arm up to ``panda_virtual``, by Pinocchio."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pinocchio as pin

from core.design import RIGID_MOUNT, Tool
from core.geometry import Array, Pose
from core.robot import HOME_JOINTS, assemble

# Levenberg-Marquardt: a radian of orientation weighs as much as this many metres, so that out of reach the position
# comes first.
_RADIAN_WEIGHT = 0.3
_POSITION_TOLERANCE = 1e-5
_MAX_STEPS = 60


@dataclass(frozen=True)
class Solution:
    """Joints (7,) in radians, and by how much they miss: metres and radians."""

    joints: Array
    error_m: float
    error_rad: float


class Arm:
    """The seven joints, with their limits: ``lower``, ``upper`` (7,) in radians, ``velocity_limits`` (7,) in rad/s."""

    def __init__(self) -> None:
        self._model = pin.buildModelFromXML(assemble(Tool(), visuals=False))
        self._data = self._model.createData()
        self._frame = self._model.getFrameId(RIGID_MOUNT)
        self.lower: Array = self._model.lowerPositionLimit.copy()
        self.upper: Array = self._model.upperPositionLimit.copy()
        self.velocity_limits: Array = self._model.velocityLimit.copy()
        self.home: Array = np.array(HOME_JOINTS)

    def forward(self, joints: Array) -> Pose:
        """The pose of ``panda_virtual`` in the world."""
        pin.framesForwardKinematics(self._model, self._data, np.asarray(joints, dtype=np.float64))
        return Pose.from_matrix(self._data.oMf[self._frame].homogeneous)

    def positions(self, joints: Array) -> Array:
        """Positions (T, 3) of ``panda_virtual`` at joints (T, 7)."""
        out = np.empty((len(joints), 3))
        for row, q in zip(out, joints, strict=True):
            pin.framesForwardKinematics(self._model, self._data, q)
            row[:] = self._data.oMf[self._frame].translation
        return out

    def inverse(self, pose: Pose, seed: Array) -> Solution:
        """The joints near ``seed`` whose end-effector comes closest to ``pose``, within the joint limits.

        Damped least squares on the pose error (position and rotation vector). A joint that presses against its limit
        is held there while the others go on. A pose out of reach gives the nearest that was found, and its miss.
        """
        model, data, frame = self._model, self._data, self._frame
        target = pin.SE3(pose.rotation.as_matrix(), pose.position)
        weight = np.array([1.0, 1.0, 1.0, *[_RADIAN_WEIGHT] * 3])

        def miss(q: Array) -> Array:
            pin.framesForwardKinematics(model, data, q)
            here = data.oMf[frame]
            error = np.empty(6)
            error[:3] = here.rotation.T @ (target.translation - here.translation)
            error[3:] = pin.log3(here.rotation.T @ target.rotation)
            weighted: Array = error * weight
            return weighted

        q = np.clip(seed, self.lower, self.upper)
        error = miss(q)
        cost, damping = float(error @ error), 1e-4
        for count in range(_MAX_STEPS):
            if cost < _POSITION_TOLERANCE**2:
                break
            jacobian = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL) * weight[:, None]
            gradient = jacobian.T @ error
            held = ((q <= self.lower) & (gradient < 0)) | ((q >= self.upper) & (gradient > 0))
            jacobian[:, held] = 0.0
            # What the pose leaves free drifts home, away from the joint limits; only at first, so that it converges.
            idle = np.where(held, 0.0, (0.05 if count < 4 else 0.0) * (self.home - q))
            square = jacobian @ jacobian.T + damping * np.eye(6)
            step = idle + jacobian.T @ np.linalg.solve(square, error - jacobian @ idle)
            trial = np.clip(q + np.clip(step, -0.5, 0.5), self.lower, self.upper)
            trial_error = miss(trial)
            trial_cost = float(trial_error @ trial_error)
            if trial_cost < cost:
                small = cost - trial_cost < 1e-6 * cost
                q, error, cost, damping = trial, trial_error, trial_cost, max(damping / 5, 1e-8)
                if small:
                    break
            else:
                damping *= 10
                if damping > 1e3:
                    break
                miss(q)  # put the model back to where the next Jacobian is taken
        return Solution(q, float(np.linalg.norm(error[:3])), float(np.linalg.norm(error[3:]) / _RADIAN_WEIGHT))

    def home_for(self, pose: Pose) -> Array:
        """The joints with which the arm starts at ``pose``.

        Raises:
            ValueError: the arm can't be there.
        """
        solution = self.inverse(pose, self.home)
        if solution.error_m > 1e-3 or solution.error_rad > 1e-2:
            raise ValueError(
                f"home {pose.position} is out of the arm's reach by {solution.error_m:.3f} m and "
                f"{solution.error_rad:.2f} rad"
            )
        return solution.joints


@lru_cache(maxsize=1)
def arm() -> Arm:
    """The arm, built once per process."""
    return Arm()
