"""Make of the arm's description what PhysX needs: few links, each with its inertia and shapes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import Tool
from core.geometry import Pose, Shape
from core.robot.description import assembled, merge_inertias
from core.values.descriptions import RobotJoint, Weight
from core.values.robots import Robot
from plugins.simulators.inertia import Inertia, principal


@dataclass(frozen=True, eq=False)
class PlacedShape:
    """A collision shape at a pose in rigidly joined links; ``part`` is its own link in the description.

    A mesh file collides as its convex hull.
    """

    shape: Shape | Path
    pose: Pose
    part: str


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


@lru_cache(maxsize=16)
def robot_links(robot: Robot, tool: Tool) -> tuple[ArticulationLink, ...]:
    """List the links of the arm with a tool, parents first. Rigidly joined links become one."""
    arm = assembled(robot, tool, fused=True)
    parts = arm.rigid_parts(
        child for child, joint in arm.joints.items() if joint.kind != "fixed"
    )
    heads = {head for head, _ in parts.values()}
    order = sorted(
        (name for name in arm.links if name in heads),
        key=lambda name: len(arm.above(name)),
    )
    found = []
    for name in order:
        links = [
            (arm.links[part], pose)
            for part, (head, pose) in parts.items()
            if head == name
        ]
        collisions = tuple(
            PlacedShape(shape.shape, pose @ shape.origin.pose, link.name)
            for link, pose in links
            for shape in link.collisions
        )
        inertia = _inertia(
            [
                link.inertial.placed(pose)
                for link, pose in links
                if link.inertial.mass > 0
            ]
        )
        parent = None
        joint = None
        if name in arm.joints:
            head, pose = parts[arm.joints[name].parent]
            parent = order.index(head)
            joint = _along_x(arm.joints[name], pose)

        found.append(ArticulationLink(name, parent, joint, inertia, collisions))

    return tuple(found)


def _along_x(joint: RobotJoint, parent: Pose) -> AxisJoint:
    turn, _ = Rotation.align_vectors([joint.axis], [[1.0, 0.0, 0.0]])
    in_child = Pose.from_rotation(np.zeros(3), turn)
    return AxisJoint(joint, parent @ joint.origin.pose @ in_child, in_child)


def _inertia(weights: Sequence[Weight]) -> Inertia:
    if not weights:  # a base that stands for the ground
        return Inertia(1.0, Pose(), np.ones(3))
    return principal(*merge_inertias(weights))
