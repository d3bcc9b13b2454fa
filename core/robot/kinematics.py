"""Place the joints and links of the robot, and compute forward and inverse kinematics up to its tool mount."""

from __future__ import annotations

import math
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.lib.stride_tricks import as_strided
from scipy.linalg.lapack import dgesv
from scipy.spatial.transform import Rotation

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Tool
from core.errors import UserError
from core.geometry import Array, Pose
from core.robot.description import assemble, joint_name
from core.values.robots import Robot


class RobotModel:
    """The kinematic model of an arm with what its tool adds: the gripper, and the tool's own joints.

    It places all links at many instants; `Arm` solves for the joints of the arm alone.

    Joints are numbered as in Pinocchio: 0 is the world, and joint j has column j - 1 of the joints' values.

    Attributes:
        model: Pinocchio's.
        data: of the model.
        supports: for each joint, itself and the joints before it.
        links: the number of the joint that moves a link, and the link's pose in that joint's frame.
    """

    def __init__(self, robot: Robot, tool: Tool) -> None:
        urdf = assemble(robot, tool, fused=True, visuals=False)
        self.model = pin.buildModelFromXML(urdf)
        self.data = self.model.createData()
        self.supports = [{*joints} - {0} for joints in self.model.supports]
        self.links: dict[str, tuple[int, Pose]] = {}

        for frame in self.model.frames:
            if frame.type == pin.FrameType.BODY:
                pose = Pose.from_matrix(frame.placement.homogeneous)
                self.links[frame.name] = frame.parentJoint, pose

        self._slides_m = sum(
            max(map(abs, robot.description.named[name].range))
            for name, slides in zip(robot.arm_joints, robot.slides, strict=True)
            if slides
        )
        loose = [joint_name(bearer.name) for bearer in tool.bearers]
        known = [*robot.arm_joints, *robot.finger_joints, *loose]
        self._columns = [known.index(name) for name in self.model.names[1:]]

        self._frames = _view_frames(self.data.oMi)

    @cached_property
    def reach(self) -> float:
        """How far a link's frame can be from the axis of any joint before it, at most, metres."""
        placements = list(self.model.jointPlacements)[2:]
        chain = sum(float(np.linalg.norm(place.translation)) for place in placements)
        chain += self._slides_m
        links = [np.linalg.norm(pose.position) for _, pose in self.links.values()]

        return chain + float(max(links))

    def order(self, arm: Array, fingers: Array) -> Array:
        """Order joints as the model has them.

        Args:
            arm: (T, J) the arm's joints.
            fingers: (T, F + K) the fingers' joints, and then the tool's.

        Returns:
            All joints (T, Q).
        """
        return np.column_stack([arm, fingers]).take(self._columns, axis=1)

    def place_joints(self, joints: Array) -> tuple[Array, Array]:
        """Compute where the joints' frames are in the world.

        Args:
            joints: (T, Q) as the model orders them.

        Returns:
            Rotations (J, T, 3, 3) and positions (J, T, 3).
        """
        frames = np.empty((len(joints), *self._frames.shape))
        for k, values in enumerate(joints):
            pin.forwardKinematics(self.model, self.data, values)
            frames[k] = self._frames

        # Pinocchio has rotations by column, and the position behind them.
        shape = (*frames.shape[:2], 3, 3)
        rotations = frames[..., :9].reshape(shape).transpose(1, 0, 3, 2)
        return rotations.copy(), frames[..., 9:].swapaxes(0, 1).copy()


def _view_frames(frames: Any) -> Array:
    """View Pinocchio's frames (J, 12), which it keeps up to date: a rotation's columns, and the position.

    They lie one after another in memory: all are copied at once, which is twice as fast as parts of them.
    """
    first, second, *_ = frames
    begin = first.rotation.ctypes.data
    step = second.rotation.ctypes.data - begin
    assert first.rotation.strides == (8, 24)
    assert first.translation.ctypes.data == begin + 72

    return as_strided(first.rotation, (len(frames), 12), (step, 8))


def robot_model(robot: Robot, tool: Tool) -> RobotModel:
    """Return the kinematic model of an arm with a tool; a process builds it once."""
    return _build_model(robot, jointed(tool))


_build_model = lru_cache(maxsize=8)(RobotModel)


def jointed(tool: Tool) -> Tool:
    """Return what kinematics depend on: the tool if it has joints, else no more than whether the gripper is there."""
    return tool if tool.bearers else Tool(gripper=tool.gripper)


def finger_values(robot: Robot, tool: Tool, opening: Array) -> Array:
    """Return the fingers' joints, with the tool's own joints at 0.

    Args:
        robot: has F fingers.
        tool: has K joints.
        opening: (T,) of each finger, metres.

    Returns:
        Joints (T, F + K).
    """
    shares = [1.0] * len(robot.finger_joints) + [0.0] * len(tool.bearers)
    return np.outer(opening, shares)


def link_frames(
    robot: Robot,
    tool: Tool,
    arm: Array,
    fingers: Array,
) -> dict[str, tuple[Array, Array]]:
    """Compute where the links' frames are in the world.

    Args:
        robot: the arm.
        tool: what it holds.
        arm: (T, J) the arm's joints.
        fingers: (T, F + K) those of the fingers and the tool; without the gripper the fingers do not matter.

    Returns:
        Rotations (T, 3, 3) and positions (T, 3) by the names of the links and of the tool's bearers.
    """
    model = robot_model(robot, tool)
    rotations, positions = model.place_joints(model.order(arm, fingers))

    return {
        name: place(
            rotations[joint], positions[joint], pose.rotation_matrix, pose.position
        )
        for name, (joint, pose) in model.links.items()
    }


def link_poses(robot: Robot, gripper: bool, joints: Array) -> dict[str, Pose]:
    """Place each link in the world, with the fingers open.

    Args:
        robot: the arm.
        gripper: whether it has its gripper.
        joints: (J,) of the arm.
    """
    tool = Tool(gripper=gripper)
    fingers = finger_values(robot, tool, np.array([robot.opening_m]))

    frames = link_frames(robot, tool, np.asarray(joints)[None], fingers)
    return {
        name: Pose.from_rotation(positions[0], Rotation.from_matrix(rotations[0]))
        for name, (rotations, positions) in frames.items()
    }


@lru_cache(maxsize=8)
def open_mounts(robot: Robot, gripper: bool) -> dict[str, Pose]:
    """Place each mount in the frame of the tool mount, with the fingers open."""
    poses = link_poses(robot, gripper, np.array(robot.home))
    return {
        name: poses[RIGID_MOUNT].inverse() @ poses[name]
        for name in (RIGID_MOUNT, *GRIPPER_MOUNTS)
        if name in poses
    }


def place(
    rotations: Array,
    positions: Array,
    rotation: Array,
    position: Array,
) -> tuple[Array, Array]:
    """Place in the world what has a rotation (..., 3, 3) and a position (..., 3) in each of frames that move.

    Args:
        rotations: (..., T, 3, 3), of the frames.
        positions: (..., T, 3), of the frames.
        rotation: (..., 3, 3), in each frame.
        position: (..., 3), in each frame.

    Returns:
        Rotations (..., T, 3, 3) and positions (..., T, 3).
    """
    turned = (_rows(rotations) @ rotation).reshape(rotations.shape)
    return turned, positions + rotate(rotations, position)


def rotate(rotations: Array, vectors: Array) -> Array:
    """Rotate vectors (..., 3) by rotations (..., T, 3, 3): (..., T, 3)."""
    return (_rows(rotations) @ vectors[..., None]).reshape(rotations.shape[:-1])


def _rows(rotations: Array) -> Array:
    """Stack the rows of rotations (..., T, 3, 3): (..., 3 T, 3). One large product is much faster than T small ones."""
    return rotations.reshape(*rotations.shape[:-3], 3 * rotations.shape[-3], 3)


# Levenberg-Marquardt: a radian weighs as much as this many metres, so that out of reach the position comes first.
_RADIAN_WEIGHT = 0.3
_POSITION_TOLERANCE = 1e-5
_MAX_STEPS = 60  # of a pose
# Of a whole sequence; reference solutions need some hundred. Beyond it each pose gets few, and may be missed by more.
_MAX_STEPS_ALL = 50_000
_FEW_STEPS = 3

_EYE = np.eye(6)
_WEIGHTS = np.array([1.0] * 3 + [_RADIAN_WEIGHT] * 3)  # of a pose error
_STRIDE = 0.5  # radians, of each joint in a step
# The share of the way home that joints go in a step where the pose doesn't ask for another; only in the first steps.
_DRIFT = 0.05
_DRIFTING = 4
# A joint that turns more between two knots of a path, 2 cm or 0.1 rad apart, is at a singularity, or on its way to
# another branch. Halfway between knots that far apart, what it moves bows out by 4 % of its radius.
_JUMP_RAD = 0.6


class Solution(NamedTuple):
    """Joints (J,) in radians, and the remaining error in metres and radians."""

    joints: Array
    error_m: float
    error_rad: float


class Arm:
    """The kinematics of a robot's arm of J joints.

    Limits are ``lower``, ``upper`` (J,) in radians, ``velocity_limits`` (J,) in rad/s, ``effort_limits`` (J,) in N m
    and ``acceleration_limits`` (J,) in rad/s^2; where a joint slides, in metres and newtons. ``jump_rad`` is the most
    that a joint may turn between two knots of a path, so that an arm without a spare joint keeps its elbow and wrist as
    they are: infinity with a spare one, which leads around singularities.
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self._model = robot_model(robot, Tool()).model
        self._data = self._model.createData()
        self._frame = self._model.getFrameId(RIGID_MOUNT)
        # Views of memory that Pinocchio keeps up to date.
        self._mount = self._data.oMf[self._frame]
        self._here = self._mount.translation
        self._back = self._mount.rotation.T
        self.lower: Array = self._model.lowerPositionLimit.copy()
        self.upper: Array = self._model.upperPositionLimit.copy()
        self.velocity_limits: Array = self._model.velocityLimit.copy()
        self.effort_limits: Array = self._model.effortLimit.copy()
        self.acceleration_limits: Array = np.array(robot.acceleration_limits)
        self.home: Array = np.array(robot.home)
        self.jump_rad = _JUMP_RAD if len(self.home) <= len(_EYE) else math.inf

    def share_torques(self, torques: Array | None) -> dict[str, float]:
        """Return what share of its limit each joint's torque is, of (J,) N m; without those that have no limit."""
        if torques is None:
            return {}

        shares = {}
        for name, torque, limit in zip(
            self.robot.arm_joints, torques, self.effort_limits, strict=True
        ):
            if 0 < limit < math.inf:
                shares[name] = round(float(torque / limit), 4)

        return shares

    def forward(self, joints: Array) -> Pose:
        """Compute the pose of the tool mount in the world."""
        self._move(np.asarray(joints, dtype=np.float64))
        return Pose.from_matrix(self._mount.homogeneous)

    def _move(self, joints: Array) -> None:
        """Bring the place of the tool mount up to date."""
        pin.forwardKinematics(self._model, self._data, joints)
        pin.updateFramePlacement(self._model, self._data, self._frame)

    def jacobian(self, joints: Array) -> Array:
        """Compute (6, J): what the joints' speeds make of the tool mount's speed and turning, in the world's axes."""
        return pin.computeFrameJacobian(
            self._model, self._data, joints, self._frame, pin.LOCAL_WORLD_ALIGNED
        )

    def positions(self, joints: Array) -> Array:
        """Compute positions (T, 3) of the tool mount at joints (T, J)."""
        positions = np.empty((len(joints), 3))

        for k, q in enumerate(joints):
            self._move(q)
            positions[k] = self._here

        return positions

    def inverse(self, pose: Pose, seed: Array) -> Solution:
        """Find joints near ``seed`` that bring the end-effector closest to ``pose``, within the limits (`follow`)."""
        joints, errors = self.follow(
            pose.position[None], pose.rotation_matrix[None], seed
        )
        return Solution(joints[0], float(errors[0, 0]), float(errors[0, 1]))

    def follow(
        self,
        positions: Array,
        rotations: Array,
        seed: Array,
        jump_rad: float = math.inf,
    ) -> tuple[Array, Array]:
        """Solve a sequence of poses: joints (K, J), and the remaining errors (K, 2) in metres and radians.

        Positions (K, 3) and rotations (K, 3, 3) are those of the tool mount in the world. Each solution starts from
        the one before, the first from ``seed``. The method is damped least squares on the pose error (position and
        rotation vector). A joint that presses against its limit is held there while the others go on. For a pose out
        of reach the nearest pose found is returned, with its error. No joint turns by more than ``jump_rad`` from one
        pose to the next: what would need it is out of reach. Work is bounded: see ``_MAX_STEPS_ALL``.
        """
        left = _MAX_STEPS_ALL
        joints = np.empty((len(positions), len(self.home)))
        missed = np.empty((len(positions), 6))

        for k, position in enumerate(positions):
            most = _MAX_STEPS if left > 0 else _FEW_STEPS
            seed, missed[k], steps = self._closest(
                position, rotations[k], seed, most, jump_rad
            )
            left -= steps
            joints[k] = seed

        errors = np.sqrt((missed.reshape(-1, 2, 3) ** 2).sum(axis=2))
        errors[:, 1] /= _RADIAN_WEIGHT
        return joints, errors

    def _miss(
        self, position: Array, rotation: Array, joints: Array
    ) -> tuple[Array, float]:
        """Compute how far the mount is from where it should be.

        Args:
            position: (3,) where it should be.
            rotation: (3, 3) how it should be turned.
            joints: (J,) of the arm.

        Returns:
            The pose error (6,) in the axes of the mount, metres and weighted radians; and its square.
        """
        self._move(joints)
        error = np.empty(6)
        error[:3] = self._back.dot(position - self._here)
        error[3:] = pin.log3(self._back.dot(rotation))
        error *= _WEIGHTS

        return error, float(error.dot(error))

    def _closest(
        self,
        position: Array,
        rotation: Array,
        seed: Array,
        most: int,
        jump_rad: float,
    ) -> tuple[Array, Array, int]:
        """Solve one pose by damped least squares. The steps stand in docs/physics_explained.md.

        Most planning time is spent here: numpy's fastest calls.
        """

        q = np.minimum(np.maximum(seed, self.lower), self.upper)
        lower = self.lower
        upper = self.upper
        if jump_rad < math.inf:
            lower = np.maximum(lower, q - jump_rad)
            upper = np.minimum(upper, q + jump_rad)

        error, cost = self._miss(position, rotation, q)
        damping = 1e-4
        count = 0

        for count in range(most):
            if cost < _POSITION_TOLERANCE**2:
                break

            jacobian = pin.computeFrameJacobian(
                self._model, self._data, q, self._frame, pin.LOCAL
            )
            jacobian *= _WEIGHTS[:, None]

            # The redundant joint motion drifts home, away from the limits; only at first, so that it converges.
            idle = _DRIFT * (self.home - q)
            if count >= _DRIFTING:
                idle[:] = 0.0

            below = q <= lower
            above = q >= upper
            if np.count_nonzero(below | above):
                gradient = jacobian.T.dot(error)
                held = (below & (gradient < 0)) | (above & (gradient > 0))
                jacobian[:, held] = 0.0
                idle[held] = 0.0

            square = jacobian.dot(jacobian.T) + damping * _EYE
            missing = error - jacobian.dot(idle)
            _, _, solution, _ = dgesv(square.T, missing, True, True)
            step = idle + jacobian.T.dot(solution)
            step = np.minimum(np.maximum(step, -_STRIDE), _STRIDE)

            trial = np.minimum(np.maximum(q + step, lower), upper)
            trial_error, trial_cost = self._miss(position, rotation, trial)

            if not trial_cost < cost:  # nan is not
                damping *= 10
                if damping > 1e3:
                    break
                continue

            settled = cost - trial_cost < 1e-6 * cost
            q = trial
            error = trial_error
            cost = trial_cost
            damping = max(damping / 5, 1e-8)

            if settled:
                break

        return q, error, count

    def home_for(self, pose: Pose) -> Array:
        """Find the joints (J,) with which the arm starts at ``pose``; they are read-only.

        Raises:
            UserError: the pose is out of reach.
        """
        return _find_home(self, pose)


@lru_cache(maxsize=16)  # all plans of a task begin there
def _find_home(arm: Arm, pose: Pose) -> Array:
    """Find the joints of `Arm.home_for`."""
    solution = arm.inverse(pose, arm.home)
    if solution.error_m > 1e-3 or solution.error_rad > 1e-2:
        where = ", ".join(f"{number:g}" for number in pose.position)
        raise UserError(
            f"robot {arm.robot.name} can't reach the task's home ({where}), by {solution.error_m:.3f} m and "
            f"{solution.error_rad:.2f} rad; place it elsewhere with robot.base=[x,y,z,yaw], or choose another robot"
        )

    solution.joints.setflags(write=False)
    return solution.joints


@lru_cache(maxsize=8)
def arm_of(robot: Robot) -> Arm:
    """Build a robot's arm once per process."""
    return Arm(robot)
