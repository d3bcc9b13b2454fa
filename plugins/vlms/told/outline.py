"""Write a table of the robot's links, and measure the space around the tool mount at home."""

from __future__ import annotations

import numpy as np

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Tool
from core.geometry import Array, Pose
from core.interfaces import Brief, Robot, RolloutSettings
from core.robot.description import assembled
from core.robot.extents import Extent, extents_of, link_extents
from core.robot.kinematics import arm_of, link_poses, robot_model
from core.robot.solids import corners, robot_solids
from core.support.text import short_numbers, table
from core.values.descriptions import RobotJoint

GRIPPER = "gripper"
HEAD = (
    "link on its parent",
    "joint",
    "xyz",
    "rpy",
    "range",
    "speed",
    "box around the link",
)
_MOTIONS = {
    "revolute": "turns about",
    "continuous": "turns about",
    "prismatic": "slides along",
}
_AXES = tuple(zip("xyz", np.eye(3), strict=True))
_NEAR_M = (
    0.3  # from the mount's origin; tools that bend around the arm are seldom larger
)


def told(brief: Brief, mounted: Tool, rollout: RolloutSettings, engine: str) -> str:
    """Write the outline for templates: their ``urdf``."""
    return outline(brief.task.robot, mounted)


def extents_at_home(robot: Robot, gripper: bool, home: Pose) -> dict[str, Extent]:
    """Measure the links near the tool mount, in its frame, with the arm at ``home`` and the fingers open.

    All links of the gripper but the fingers are one, `GRIPPER`.

    Raises:
        UserError: the arm can't reach ``home``.
    """
    poses = link_poses(robot, gripper, arm_of(robot).home_for(home))
    mount = poses[RIGID_MOUNT].inverse()
    bare = robot_model(robot, Tool()).links
    found = extents_of(
        (
            solid.name
            if solid.name in bare or solid.name in GRIPPER_MOUNTS
            else GRIPPER,
            (mount @ poses[solid.name] @ solid.pose).apply(corners(solid.geometry)),
        )
        for solid in robot_solids(robot, gripper)
    )
    off = {
        name: np.maximum(np.maximum(low, -high), 0.0)
        for name, (low, high) in found.items()
    }
    return {
        name: extent
        for name, extent in found.items()
        if np.linalg.norm(off[name]) < _NEAR_M
    }


def outline(robot: Robot, tool: Tool) -> str:
    """Write a row for each link of the robot with ``tool`` that has a shape or bears another, and for the mount.

    It has the joint that bears the link, as in URDF: its motion, its origin in the parent's frame, its limits. The box
    is the smallest one along the link's axes around all of its collision shapes, from its lowest to its highest corner.
    """
    arm = assembled(robot, tool)
    extents = {
        name: (low.round(3), high.round(3))
        for name, (low, high) in link_extents(robot, tool.gripper).items()
    }
    for component in tool.components:
        middle, size = component.shape.bounds
        extents[component.name] = middle - size / 2, middle + size / 2
    boxes = {
        name: f"{short_numbers(low, 4)} to {short_numbers(high, 4)}"
        for name, (low, high) in extents.items()
    }
    bears = {RIGID_MOUNT, *boxes, *(joint.parent for joint in arm.joints.values())}
    names = [name for name in arm.links if name in bears]
    return table(
        HEAD,
        [
            (*_joint_cells(arm.joints.get(name), name), boxes.get(name, "-"))
            for name in names
        ],
    )


def _joint_cells(joint: RobotJoint | None, link: str) -> tuple[str, ...]:
    if joint is None:
        return link, "the base", "-", "-", "-", "-"
    way = _MOTIONS.get(joint.kind)
    motion = joint.kind if way is None else f"{way} {_axis_name(np.array(joint.axis))}"
    limited = joint.kind != "fixed" and any(limit is not None for limit in joint.limits)
    span = (
        "{:g} to {:g}".format(*joint.range)
        if limited and joint.kind != "continuous"
        else "-"
    )
    speed = f"{joint.limits.velocity or 0.0:g}" if limited else "-"
    xyz, rpy = short_numbers(joint.origin.xyz, 4), short_numbers(joint.origin.rpy, 4)
    return f"{link} on {joint.parent}", motion, xyz, rpy, span, speed


def _axis_name(axis: Array) -> str:
    """Name an axis, such as ``-y``; the numbers of one that is askew."""
    names = {
        tuple(sign * row): f"{'-' if sign < 0 else ''}{name}"
        for sign in (1, -1)
        for name, row in _AXES
    }
    return names.get(tuple(axis), short_numbers(axis, 4))
