"""Make of the arm's description what PhysX needs: few links, each with its inertia and shapes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import Tool
from core.geometry import Pose
from core.interfaces import Robot
from core.robot.description import assembled, merge_inertias
from core.values.descriptions import RobotJoint, RobotLink, Weight
from plugins.simulators.inertia import Inertia, principal
from plugins.simulators.sapien.shapes import PlacedShape


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
    """Rigidly joined links, as one.

    Attributes:
        name: of the first of them.
        parent: its number in the list; None: it is the base.
        joint: to the parent; None: it is the base.
        inertia: of all together, in the first one's frame.
        collisions: of all.
    """

    name: str
    parent: int | None
    joint: AxisJoint | None
    inertia: Inertia
    collisions: tuple[PlacedShape, ...]


@lru_cache(maxsize=16)
def robot_links(robot: Robot, tool: Tool) -> tuple[ArticulationLink, ...]:
    """List the links of the arm with a tool, parents first. Rigidly joined links become one."""
    arm = assembled(robot, tool, fused=True)
    moving = [child for child, joint in arm.joints.items() if joint.kind != "fixed"]
    parts = arm.rigid_parts(moving)

    groups: dict[str, list[tuple[RobotLink, Pose]]] = {}
    for part, (head, pose) in parts.items():
        groups.setdefault(head, []).append((arm.links[part], pose))

    heads = [name for name in arm.links if name in groups]
    order = sorted(heads, key=lambda name: len(arm.above(name)))

    found = []
    for name in order:
        weights = []
        collisions: list[PlacedShape] = []
        for link, pose in groups[name]:
            if link.inertial.mass > 0:
                weights.append(link.inertial.placed(pose))

            collisions += _place_shapes(link, pose)

        parent = None
        joint = None
        if name in arm.joints:
            head, pose = parts[arm.joints[name].parent]
            parent = order.index(head)
            joint = _along_x(arm.joints[name], pose)

        inertia = _merge(weights)
        found.append(ArticulationLink(name, parent, joint, inertia, tuple(collisions)))

    return tuple(found)


def _place_shapes(link: RobotLink, pose: Pose) -> Iterator[PlacedShape]:
    """Yield the collision shapes of a link at a pose."""
    for shape in link.collisions:
        yield PlacedShape(shape.shape, pose @ shape.origin.pose, link.name)


def _along_x(joint: RobotJoint, parent: Pose) -> AxisJoint:
    """Turn a joint's frames so that it moves along or about x; ``parent`` is its parent's pose in the joined links."""
    turn, _ = Rotation.align_vectors([joint.axis], [[1.0, 0.0, 0.0]])
    in_child = Pose.from_rotation(np.zeros(3), turn)
    return AxisJoint(joint, parent @ joint.origin.pose @ in_child, in_child)


def _merge(weights: list[Weight]) -> Inertia:
    """Join the inertias of rigidly joined links."""
    if not weights:  # a base that stands for the ground
        return Inertia(1.0, Pose(), np.ones(3))

    return principal(*merge_inertias(weights))
