"""Place the joints and links of the robot at many instants at once.

numpy needs a tenth of the time that Pinocchio takes for one instant after the other.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Tool
from core.geometry import Array, Pose
from core.robot.description import assemble
from core.values.robots import Robot


@dataclass(frozen=True, eq=False)
class RobotModel:
    """The kinematic model of an arm, with its gripper or without.

    Joints are numbered as in Pinocchio: 0 is the world, and joint j has column j - 1 of the joints' values.

    Attributes:
        model: Pinocchio's, and its ``data``.
        axes: for each joint, the direction that it turns about (3,), and that it moves along (3,), in its frame.
        turning: (3, J - 1, 3, 3), the parts of the joints' rotations in their parents' frames: the constant one, the
            one times the sine and the one times 1 - the cosine of the joint's value (Rodrigues).
        moving: (2, J - 1, 3), the same of their positions: the constant part and the one times the value.
        parents: for each joint, the number of the one before it.
        supports: for each joint, itself and the joints before it.
        links: the number of the joint that moves a link, and the link's pose in that joint's frame.
    """

    model: Any
    data: Any
    axes: tuple[tuple[Array, Array], ...]
    turning: Array
    moving: Array
    parents: tuple[int, ...]
    supports: tuple[frozenset[int], ...]
    links: dict[str, tuple[int, Pose]]

    @cached_property
    def joints(self) -> tuple[str, ...]:
        """The joints' names, but for the world's."""
        return tuple(self.model.names)[1:]

    @cached_property
    def reach(self) -> float:
        """How far a link's frame can be from the axis of any joint before it, at most, metres."""
        chain = [float(np.linalg.norm(placement.translation)) for placement in list(self.model.jointPlacements)[2:]]
        return sum(chain) + max(float(np.linalg.norm(pose.position)) for _, pose in self.links.values())


@lru_cache(maxsize=8)
def robot_model(robot: Robot, gripper: bool) -> RobotModel:
    """Load a robot's kinematic model."""
    model = pin.buildModelFromXML(assemble(robot, Tool(gripper=gripper), visuals=False))
    links = {
        frame.name: (frame.parentJoint, Pose.from_matrix(frame.placement.homogeneous))
        for frame in model.frames
        if frame.type == pin.FrameType.BODY
    }
    supports = tuple(frozenset(support.tolist()) - {0} for support in model.supports)
    axes = [(np.zeros(3), np.zeros(3))]
    for joint in list(model.joints)[1:]:
        data = joint.createData()
        joint.calc(data, pin.neutral(model))
        motion = np.asarray(data.S).reshape(6)
        axes.append((motion[3:], motion[:3]))
    placements = list(model.jointPlacements)[1:]
    fixed, cross = np.array([at.rotation for at in placements]), np.array([pin.skew(about) for about, _ in axes[1:]])
    turning = np.array([fixed, fixed @ cross, fixed @ cross @ cross])
    along = [at.rotation @ along for at, (_, along) in zip(placements, axes[1:], strict=True)]
    moving = np.array([[at.translation for at in placements], along])
    return RobotModel(model, model.createData(), tuple(axes), turning, moving, tuple(model.parents), supports, links)


def joint_values(robot: Robot, gripper: bool, arm: Array, fingers: Array) -> Array:
    """Order the arm's joints (T, J) and the fingers' (T, F) as the model has them, one column for each joint of it."""
    columns = dict(zip(robot.arm_joints, arm.T, strict=True)) | dict(zip(robot.finger_joints, fingers.T, strict=False))
    return np.column_stack([columns[name] for name in robot_model(robot, gripper).joints])


def joint_frames(robot: RobotModel, joints: Array) -> tuple[Array, Array]:
    """Compute rotations (J, T, 3, 3) and positions (J, T, 3) of the joints' frames in the world.

    ``joints`` are as `joint_values` orders them.
    """
    values = joints.T[:, :, None]
    shares = np.concatenate([np.ones_like(values), np.sin(values), 1 - np.cos(values)], axis=2)
    turns = (shares @ robot.turning.swapaxes(0, 1).reshape(-1, 3, 9)).reshape(*shares.shape, 3)
    rotations, positions = np.empty((len(turns) + 1, *turns.shape[1:])), np.zeros((len(turns) + 1, *turns.shape[1:3]))
    rotations[0] = np.eye(3)
    for joint, turn in enumerate(turns, start=1):
        np.matmul(rotations[robot.parents[joint]], turn, out=rotations[joint])
    before = rotations[list(robot.parents[1:])]
    shifts = rotate(before, robot.moving[0])
    if (sliding := robot.moving[1].any(axis=1)).any():
        shifts[sliding] += values[sliding] * rotate(before[sliding], robot.moving[1][sliding])
    for joint, shift in enumerate(shifts, start=1):
        np.add(positions[robot.parents[joint]], shift, out=positions[joint])
    return rotations, positions


def link_frames(robot: Robot, gripper: bool, arm: Array, fingers: Array) -> dict[str, tuple[Array, Array]]:
    """Compute for each link the rotations (T, 3, 3) and positions (T, 3) of its frame in the world.

    ``arm`` (T, J) and ``fingers`` (T, F) are the joints; without the gripper the fingers do not matter.
    """
    model = robot_model(robot, gripper)
    rotations, positions = joint_frames(model, joint_values(robot, gripper, arm, fingers))
    return {
        name: place(rotations[joint], positions[joint], pose.rotation.as_matrix(), pose.position)
        for name, (joint, pose) in model.links.items()
    }


def link_poses(robot: Robot, gripper: bool, joints: Array) -> dict[str, Pose]:
    """Place each link in the world, with the arm at joints (J,) and the fingers open."""
    opened = np.full((1, len(robot.finger_joints)), robot.opening_m)
    frames = link_frames(robot, gripper, np.asarray(joints)[None], opened)
    return {
        name: Pose.from_rotation(position[0], Rotation.from_matrix(rotation[0]))
        for name, (rotation, position) in frames.items()
    }


def bearer_frames(
    tool: Tool, values: Array, mounts: Mapping[str, tuple[Array, Array]]
) -> dict[str, tuple[Array, Array]]:
    """Compute the rotations (T, 3, 3) and positions (T, 3) of a tool's `Tool.bearers` in the world.

    ``values`` (T, K) are those of its joints; ``mounts`` holds the mounts' frames.
    """
    frames = dict(mounts)
    for bearer, value in zip(tool.bearers, values.T, strict=True):
        rotations, positions = frames[bearer.parent]
        rotations, positions = place(rotations, positions, bearer.pose.rotation.as_matrix(), bearer.pose.position)
        if bearer.joint.kind == "hinge":
            rotations = rotations @ Rotation.from_rotvec(np.outer(value, bearer.joint.axis)).as_matrix()
        else:
            positions = positions + value[:, None] * (rotations @ bearer.joint.axis)
        frames[bearer.name] = rotations, positions
    return {bearer.name: frames[bearer.name] for bearer in tool.bearers}


def tool_values(robot: Robot, tool: Tool, fingers: Array) -> Array:
    """Return the tool's joints (T, K) from what comes with the fingers in a recording (T, F + K)."""
    return fingers[:, len(robot.finger_joints) : len(robot.finger_joints) + len(tool.bearers)]


@lru_cache(maxsize=8)
def open_mounts(robot: Robot, gripper: bool) -> dict[str, Pose]:
    """Place each mount in the frame of the tool mount, with the fingers open."""
    poses = link_poses(robot, gripper, np.array(robot.home))
    return {
        name: poses[RIGID_MOUNT].inverse() @ poses[name] for name in (RIGID_MOUNT, *GRIPPER_MOUNTS) if name in poses
    }


def place(rotations: Array, positions: Array, rotation: Array, position: Array) -> tuple[Array, Array]:
    """Place in the world what has a rotation (..., 3, 3) and a position (..., 3) in each of frames that move.

    Args:
        rotations: (..., T, 3, 3), of the frames.
        positions: (..., T, 3), of the frames.
        rotation: (..., 3, 3), in each frame.
        position: (..., 3), in each frame.

    Returns:
        Rotations (..., T, 3, 3) and positions (..., T, 3).
    """
    rows = _rows(rotations)
    return (rows @ rotation).reshape(rotations.shape), positions + rotate(rotations, position)


def rotate(rotations: Array, vectors: Array) -> Array:
    """Rotate vectors (..., 3) by rotations (..., T, 3, 3): (..., T, 3)."""
    return (_rows(rotations) @ vectors[..., None]).reshape(rotations.shape[:-1])


def _rows(rotations: Array) -> Array:
    """Stack the rows of rotations (..., T, 3, 3): (..., 3 T, 3). One large product is much faster than T small ones."""
    return rotations.reshape(*rotations.shape[:-3], 3 * rotations.shape[-3], 3)
