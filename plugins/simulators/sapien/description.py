"""Make of the arm's description what PhysX needs: few links, each with its inertia and shapes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import Tool
from core.geometry import Color, Pose, Shape
from core.robot.description import assembled, merged
from core.scene import Inertia
from core.values.descriptions import RobotJoint, RobotShape, Weight
from core.values.robots import Robot

_PALE: Color = (0.9, 0.9, 0.9, 1.0)  # of shapes without a material


@dataclass(frozen=True, eq=False)
class PlacedShape:
    """A collision or visual shape at a pose in rigidly joined links; ``part`` is its own link in the description.

    A mesh file collides as its convex hull, and is drawn in its own colours.
    """

    shape: Shape | Path
    pose: Pose
    part: str
    color: Color


@dataclass(frozen=True, eq=False)
class AxisJoint:
    """How a link moves in its parent: along or about the x axis of ``in_parent``.

    At 0 the joint's frame ``in_child`` coincides with it.
    """

    joint: RobotJoint
    in_parent: Pose
    in_child: Pose


@dataclass(frozen=True, eq=False)
class ArticulationLink:
    """Rigidly joined links: the parent's number and the joint to it (the base has neither), inertia, and shapes."""

    name: str
    parent: int | None
    joint: AxisJoint | None
    inertia: Inertia
    collisions: tuple[PlacedShape, ...]
    visuals: tuple[PlacedShape, ...]


@lru_cache(maxsize=16)
def robot_links(robot: Robot, tool: Tool) -> tuple[ArticulationLink, ...]:
    """List the links of the arm with a tool, parents first. Rigidly joined links become one."""
    arm = assembled(robot, tool, fused=True)
    parts = arm.rigid_parts(child for child, joint in arm.joints.items() if joint.kind != "fixed")
    heads = {head for head, _ in parts.values()}
    order = sorted((name for name in arm.links if name in heads), key=lambda name: len(arm.above(name)))
    made = []
    for name in order:
        links = [(arm.links[part], pose) for part, (head, pose) in parts.items() if head == name]
        collisions = tuple(_placed(shape, pose, link.name) for link, pose in links for shape in link.collisions)
        visuals = tuple(_placed(shape, pose, link.name) for link, pose in links for shape in link.visuals)
        inertia = _inertia([link.inertial.placed(pose) for link, pose in links if link.inertial.mass > 0])
        parent, joint = None, None
        if name in arm.joints:
            head, pose = parts[arm.joints[name].parent]
            parent, joint = order.index(head), _along_x(arm.joints[name], pose)
        made.append(ArticulationLink(name, parent, joint, inertia, collisions, visuals))
    return tuple(made)


def place(links: Sequence[ArticulationLink], joints: Mapping[str, float]) -> list[Pose]:
    """Compute the poses of links in the base for joint values by name; the others are at 0."""
    poses: list[Pose] = []
    for link in links:
        if link.joint is None or link.parent is None:
            poses.append(Pose())
            continue
        along = np.array([joints.get(link.joint.joint.name, 0.0), 0.0, 0.0])
        slides = link.joint.joint.kind == "prismatic"
        moved = Pose(along) if slides else Pose.from_rotation(np.zeros(3), Rotation.from_rotvec(along))
        poses.append(poses[link.parent] @ link.joint.in_parent @ moved @ link.joint.in_child.inverse())
    return poses


def _along_x(joint: RobotJoint, parent: Pose) -> AxisJoint:
    turn, _ = Rotation.align_vectors([joint.axis], [[1.0, 0.0, 0.0]])
    in_child = Pose.from_rotation(np.zeros(3), turn)
    return AxisJoint(joint, parent @ joint.origin.pose @ in_child, in_child)


def _inertia(weights: Sequence[Weight]) -> Inertia:
    if not weights:  # a base that stands for the ground
        return Inertia(1.0, Pose(), np.ones(3))
    mass, center, whole = merged(weights)
    moments, axes = np.linalg.eigh(whole)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    return Inertia(mass, Pose.from_rotation(center, Rotation.from_matrix(axes)), moments)


def _placed(shape: RobotShape, link: Pose, part: str) -> PlacedShape:
    return PlacedShape(shape.shape, link @ shape.origin.pose, part, shape.color or _PALE)
