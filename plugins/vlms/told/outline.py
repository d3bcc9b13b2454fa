"""Write a table of the robot's links, and measure the space around the tool mount at home."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Tool
from core.designs.prompt_values import RunFacts
from core.geometry import Array, Pose
from core.interfaces import Brief, Robot
from core.robot.description import assembled
from core.robot.extents import Extent
from core.robot.kinematics import arm_of, link_poses, robot_model
from core.robot.solids import corners, robot_solids
from core.support.text import short_numbers
from core.values.descriptions import RobotJoint
from plugins.vlms.told.tables import phrase, table

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
_NEAR_M = (
    0.3  # from the mount's origin; tools that bend around the arm are seldom larger
)


def outline_value(brief: Brief, mounted: Tool, facts: RunFacts) -> str:
    """Write the outline for templates: their ``urdf``."""
    return outline(brief.task.robot, mounted)


def extents_at_home(robot: Robot, gripper: bool, home: Pose) -> dict[str, Extent]:
    """Measure the links near the tool mount, in its frame, with the arm at ``home`` and the fingers open.

    All links of the gripper but the fingers are one, `GRIPPER`.

    Args:
        robot: with its base where it stands.
        gripper: whether it has its gripper.
        home: pose of the end-effector.

    Raises:
        UserError: the arm can't reach ``home``.
    """
    poses = link_poses(robot, gripper, arm_of(robot).home_for(home))
    mount = poses[RIGID_MOUNT].inverse()
    separate = {*robot_model(robot, Tool()).links, *GRIPPER_MOUNTS}
    placed = []

    for solid in robot_solids(robot, gripper):
        name = solid.name if solid.name in separate else GRIPPER
        pose = mount @ poses[solid.name] @ solid.pose
        placed.append((name, pose.apply(corners(solid.geometry))))

    return {
        name: (low, high)
        for name, (low, high) in extents_of(placed).items()
        if np.linalg.norm(np.maximum(np.maximum(low, -high), 0.0)) < _NEAR_M
    }


def outline(robot: Robot, tool: Tool) -> str:
    """Write a row for each link of the robot with ``tool`` that has a shape or bears another, and for the mount.

    It has the joint that bears the link, as in URDF: its motion, its origin in the parent's frame, its limits. The box
    is the smallest one along the link's axes around all of its collision shapes, from its lowest to its highest corner.

    Args:
        robot: as its description has it.
        tool: which is merged in; its components are links too.
    """
    boxes = {
        name: _describe_box(low.round(3), high.round(3))
        for name, (low, high) in link_extents(robot, tool.gripper).items()
    }

    for component in tool.components:
        middle, size = component.shape.bounds
        boxes[component.name] = _describe_box(middle - size / 2, middle + size / 2)

    arm = assembled(robot, tool)
    shown = {RIGID_MOUNT, *boxes, *(joint.parent for joint in arm.joints.values())}
    rows = []

    for name in arm.links:
        if name in shown:
            cells = _joint_cells(arm.joints.get(name), name)
            rows.append((*cells, boxes.get(name, "-")))

    return table(HEAD, rows)


def _describe_box(low: Array, high: Array) -> str:
    """Write the lowest and the highest corner (3,) of a box.

    Args:
        low: metres.
        high: metres.
    """
    return f"{short_numbers(low, 4)} to {short_numbers(high, 4)}"


def _joint_cells(joint: RobotJoint | None, link: str) -> tuple[str, ...]:
    """Write the cells of a link's row about the joint that bears it; None: nothing does.

    Args:
        joint: as the robot's description has it.
        link: the name of what it bears.
    """
    if joint is None:
        return link, "the base", "-", "-", "-", "-"

    return (
        f"{link} on {joint.parent}",
        phrase("outline", "motion", joint, _name_axis(joint.axis)),
        short_numbers(joint.origin.xyz, 4),
        short_numbers(joint.origin.rpy, 4),
        phrase("outline", "span", joint),
        phrase("outline", "speed", joint),
    )


def _name_axis(axis: Sequence[float]) -> str:
    """Name an axis, such as ``-y``; the numbers of one that is askew.

    Args:
        axis: a unit vector (3,).
    """
    for name, unit in zip("xyz", np.eye(3), strict=True):
        if tuple(axis) == tuple(unit):
            return name
        if tuple(axis) == tuple(-unit):
            return f"-{name}"

    return short_numbers(axis, 4)


def link_extents(robot: Robot, gripper: bool) -> dict[str, Extent]:
    """Measure the collision shapes of each link that has some, in its own frame."""
    return extents_of(
        (solid.name, solid.pose.apply(corners(solid.geometry)))
        for solid in robot_solids(robot, gripper)
    )


def extents_of(placed: Iterable[tuple[str, Array]]) -> dict[str, Extent]:
    """Find the extents of named groups of points (N, 3); several of one name are one."""
    found: dict[str, Extent] = {}
    for name, points in placed:
        low, high = found.get(name, (points[0], points[0]))
        lowest = np.minimum(low, points.min(axis=0))
        found[name] = lowest, np.maximum(high, points.max(axis=0))
    return found
