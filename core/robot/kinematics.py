"""Compute forward and inverse kinematics of an arm up to its tool mount, with Pinocchio."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pinocchio as pin
from scipy.linalg.lapack import dgesv

from core.design import RIGID_MOUNT
from core.errors import UserError
from core.geometry import Array, Pose
from core.robot.frames import robot_model
from core.values.robots import Robot

# Levenberg-Marquardt: a radian weighs as much as this many metres, so that out of reach the position comes first.
_RADIAN_WEIGHT = 0.3
_POSITION_TOLERANCE = 1e-5
_MAX_STEPS = 60
# Of a whole sequence; reference solutions need some hundred. Beyond it each pose gets few, and may be missed by more.
_MAX_STEPS_ALL, _FEW_STEPS = 50_000, 3

_EYE = np.eye(6)
_STRIDE = 0.5  # radians, of each joint in a step
# A joint that turns more between two knots of a path, 2 cm or 0.1 rad apart, is at a singularity, or on its way to
# another branch. Halfway between knots that far apart, what it moves bows out by 4 % of its radius.
_JUMP_RAD = 0.6


@dataclass(frozen=True)
class Solution:
    """Joints (J,) in radians, and the remaining error in metres and radians."""

    joints: Array
    error_m: float
    error_rad: float


class Arm:
    """The kinematics of a robot's arm of J joints.

    Limits are ``lower``, ``upper`` (J,) in radians, ``velocity_limits`` (J,) in rad/s, ``effort_limits`` (J,) in N m
    and ``acceleration_limits`` (J,) in rad/s^2. ``jump_rad`` is the most that a joint may turn between two knots of a
    path, so that an arm without a spare joint keeps its elbow and wrist as they are: infinity with a spare one, which
    leads around singularities.
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self._model = robot_model(robot, False).model
        self._data = self._model.createData()
        self._frame = self._model.getFrameId(RIGID_MOUNT)
        # The frame's placement: views of memory that Pinocchio keeps up to date.
        self._here, self._back = self._data.oMf[self._frame].translation, self._data.oMf[self._frame].rotation.T
        self.lower: Array = self._model.lowerPositionLimit.copy()
        self.upper: Array = self._model.upperPositionLimit.copy()
        self.velocity_limits: Array = self._model.velocityLimit.copy()
        self.effort_limits: Array = self._model.effortLimit.copy()
        self.acceleration_limits: Array = np.array(robot.acceleration_limits)
        self.home: Array = np.array(robot.home)
        self.jump_rad = _JUMP_RAD if len(self.home) <= len(_EYE) else math.inf

    def forward(self, joints: Array) -> Pose:
        """Compute the pose of the tool mount in the world."""
        pin.framesForwardKinematics(self._model, self._data, np.asarray(joints, dtype=np.float64))
        return Pose.from_matrix(self._data.oMf[self._frame].homogeneous)

    def positions(self, joints: Array) -> Array:
        """Compute positions (T, 3) of the tool mount at joints (T, J)."""
        out = np.empty((len(joints), 3))
        for row, q in zip(out, joints, strict=True):
            pin.framesForwardKinematics(self._model, self._data, q)
            row[:] = self._data.oMf[self._frame].translation
        return out

    def inverse(self, pose: Pose, seed: Array) -> Solution:
        """Find joints near ``seed`` that bring the end-effector closest to ``pose``, within the limits (`follow`)."""
        joints, errors = self.follow(pose.position[None], pose.rotation.as_matrix()[None], seed)
        return Solution(joints[0], float(errors[0, 0]), float(errors[0, 1]))

    def follow(
        self, positions: Array, rotations: Array, seed: Array, jump_rad: float = math.inf
    ) -> tuple[Array, Array]:
        """Solve a sequence of poses: joints (K, J), and the remaining errors (K, 2) in metres and radians.

        Positions (K, 3) and rotations (K, 3, 3) are those of the tool mount in the world. Each solution starts from
        the one before, the first from ``seed``. The method is damped least squares on the pose error (position and
        rotation vector). A joint that presses against its limit is held there while the others go on. For a pose out
        of reach the nearest pose found is returned, with its error. No joint turns by more than ``jump_rad`` from one
        pose to the next: what would need it is out of reach. Work is bounded: see ``_MAX_STEPS_ALL``.
        """
        left = _MAX_STEPS_ALL
        joints, errors = np.empty((len(positions), len(self.home))), np.empty((len(positions), 2))
        for k, (position, rotation) in enumerate(zip(positions, rotations, strict=True)):
            most = _MAX_STEPS if left > 0 else _FEW_STEPS
            seed, error, steps = self._closest(position, rotation, seed, most, jump_rad)
            left -= steps
            joints[k] = seed
            errors[k] = math.sqrt(error[:3].dot(error[:3])), math.sqrt(error[3:].dot(error[3:])) / _RADIAN_WEIGHT
        return joints, errors

    def _miss(self, position: Array, rotation: Array, joints: Array) -> Array:
        """Compute the pose error (6,) at these joints, in the axes there: metres, and weighted radians."""
        pin.forwardKinematics(self._model, self._data, joints)
        pin.updateFramePlacement(self._model, self._data, self._frame)
        error = np.empty(6)
        error[:3] = self._back.dot(position - self._here)
        error[3:] = _RADIAN_WEIGHT * pin.log3(self._back.dot(rotation))
        return error

    def _closest(
        self, position: Array, rotation: Array, seed: Array, most: int, jump_rad: float
    ) -> tuple[Array, Array, int]:
        """Solve one pose: joints, their `_miss`, and the steps taken.

        Most planning time is spent here: numpy's fastest calls.
        """
        q = np.minimum(np.maximum(seed, self.lower), self.upper)
        lower, upper = np.maximum(self.lower, q - jump_rad), np.minimum(self.upper, q + jump_rad)
        error = self._miss(position, rotation, q)
        cost, damping = float(error.dot(error)), 1e-4
        count = 0
        for count in range(most):
            if cost < _POSITION_TOLERANCE**2:
                break
            jacobian = pin.computeFrameJacobian(self._model, self._data, q, self._frame, pin.LOCAL)
            jacobian[3:] *= _RADIAN_WEIGHT
            # The redundant joint motion drifts home, away from the limits; only at first, so that it converges.
            idle = (0.05 if count < 4 else 0.0) * (self.home - q)
            if np.count_nonzero((q <= lower) | (q >= upper)):
                gradient = jacobian.T.dot(error)
                held = ((q <= lower) & (gradient < 0)) | ((q >= upper) & (gradient > 0))
                jacobian[:, held] = 0.0
                idle[held] = 0.0
            square = jacobian.dot(jacobian.T) + damping * _EYE
            step = idle + jacobian.T.dot(dgesv(square.T, error - jacobian.dot(idle), True, True)[2])
            trial = np.minimum(np.maximum(q + np.minimum(np.maximum(step, -_STRIDE), _STRIDE), lower), upper)
            trial_error = self._miss(position, rotation, trial)
            trial_cost = float(trial_error.dot(trial_error))
            if trial_cost < cost:
                small = cost - trial_cost < 1e-6 * cost
                q, error, cost, damping = trial, trial_error, trial_cost, max(damping / 5, 1e-8)
                if small:
                    break
            else:
                damping *= 10
                if damping > 1e3:
                    break
        return q, error, count

    def home_for(self, pose: Pose) -> Array:
        """Find the joints with which the arm starts at ``pose``.

        Raises:
            UserError: the pose is out of reach.
        """
        solution = self.inverse(pose, self.home)
        if solution.error_m > 1e-3 or solution.error_rad > 1e-2:
            where = ", ".join(f"{number:g}" for number in pose.position)
            raise UserError(
                f"robot {self.robot.name} can't reach the task's home ({where}), by {solution.error_m:.3f} m and "
                f"{solution.error_rad:.2f} rad; place it elsewhere with robot.base=[x,y,z,yaw], or choose another robot"
            )
        return solution.joints


@lru_cache(maxsize=8)
def arm_of(robot: Robot) -> Arm:
    """Build a robot's arm once per process."""
    return Arm(robot)
