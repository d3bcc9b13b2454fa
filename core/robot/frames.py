"""Place the joints and links of the robot at many instants at once.

numpy needs a tenth of the time that Pinocchio takes for one instant after the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import pinocchio as pin

from core.design import Tool
from core.geometry import Array, Pose
from core.robot.description import ARM_JOINTS, FINGER_JOINTS, assemble


@dataclass(frozen=True, eq=False)
class RobotModel:
    """The kinematic model of the arm, with the gripper or without.

    Joints are numbered as in Pinocchio: 0 is the world, and joint j has column j - 1 of the joints' values.

    Attributes:
        model: Pinocchio's, and its ``data``.
        axes: for each joint, the direction that it turns about (3,), and that it moves along (3,), in its frame.
        supports: for each joint, itself and the joints before it.
        links: the number of the joint that moves a link, and the link's pose in that joint's frame.
    """

    model: Any
    data: Any
    axes: tuple[tuple[Array, Array], ...]
    supports: tuple[frozenset[int], ...]
    links: dict[str, tuple[int, Pose]]

    @cached_property
    def reach(self) -> float:
        """How far a link's frame can be from the axis of any joint before it, at most, metres."""
        chain = [float(np.linalg.norm(placement.translation)) for placement in list(self.model.jointPlacements)[2:]]
        return sum(chain) + max(float(np.linalg.norm(pose.position)) for _, pose in self.links.values())


@lru_cache(maxsize=2)
def robot_model(gripper: bool) -> RobotModel:
    """Load the robot's kinematic model."""
    model = pin.buildModelFromXML(assemble(Tool(gripper=gripper), visuals=False))
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
    return RobotModel(model, model.createData(), tuple(axes), supports, links)


def joint_values(robot: RobotModel, arm: Array, fingers: Array) -> Array:
    """Order the arm's joints (T, 7) and the fingers' (T, 2) as the model has them: (T, J - 1)."""
    columns = dict(zip((*ARM_JOINTS, *FINGER_JOINTS), (*arm.T, *fingers.T), strict=True))
    return np.column_stack([columns[name] for name in list(robot.model.names)[1:]])


def joint_frames(robot: RobotModel, joints: Array) -> tuple[Array, Array]:
    """Compute rotations (J, T, 3, 3) and positions (J, T, 3) of the joints' frames in the world.

    ``joints`` are as `joint_values` orders them.
    """
    count = len(joints)
    rotations, positions = np.empty((robot.model.njoints, count, 3, 3)), np.zeros((robot.model.njoints, count, 3))
    rotations[0] = np.eye(3)
    for joint in range(1, robot.model.njoints):
        parent, placement = robot.model.parents[joint], robot.model.jointPlacements[joint]
        about, along = robot.axes[joint]
        rotation, position = compose(rotations[parent], positions[parent], placement.rotation, placement.translation)
        values = joints[:, joint - 1, None]
        cross = pin.skew(about)
        turn = np.eye(3).ravel() + np.sin(values) * cross.ravel() + (1 - np.cos(values)) * (cross @ cross).ravel()
        rotations[joint] = rotation @ turn.reshape(-1, 3, 3)
        positions[joint] = position + values * times(rotation, along)
    return rotations, positions


def link_frames(gripper: bool, arm: Array, fingers: Array) -> dict[str, tuple[Array, Array]]:
    """Compute for each link the rotations (T, 3, 3) and positions (T, 3) of its frame in the world.

    ``arm`` (T, 7) and ``fingers`` (T, 2) are the joints; without the gripper the fingers do not matter.
    """
    robot = robot_model(gripper)
    rotations, positions = joint_frames(robot, joint_values(robot, arm, fingers))
    return {
        name: compose(rotations[joint], positions[joint], pose.rotation.as_matrix(), pose.position)
        for name, (joint, pose) in robot.links.items()
    }


def compose(rotations: Array, positions: Array, rotation: Array, position: Array) -> tuple[Array, Array]:
    """Place in the world what has a ``rotation`` (3, 3) and a ``position`` (3,) in frames that move.

    Returns:
        Rotations (T, 3, 3) and positions (T, 3).
    """
    return times(rotations, rotation), positions + times(rotations, position)


def times(rotations: Array, other: Array) -> Array:
    """Multiply rotations (T, 3, 3) by a matrix (3, 3) or a vector (3,): as one matrix, in a tenth of the time."""
    product: Array = rotations.reshape(-1, 3).dot(other)
    return product.reshape(len(rotations), 3, *other.shape[1:])
