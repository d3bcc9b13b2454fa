"""Show the robot's URDF, and measure the space around the tool mount at home."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
from lxml import etree

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Tool
from core.designs.prompt_values import RunFacts
from core.geometry import Array, Pose
from core.interfaces import Brief, Robot
from core.robot.description import assemble
from core.robot.extents import Extent
from core.robot.kinematics import arm_of, link_poses, robot_model
from core.robot.solids import corners, robot_solids

GRIPPER = "gripper"
_NEAR_M = (
    0.3  # from the mount's origin; tools that bend around the arm are seldom larger
)


def urdf_value(brief: Brief, mounted: Tool, facts: RunFacts) -> str:
    """Write the URDF of the robot with what is mounted for templates: their ``urdf``."""
    return shorten_urdf(brief.task.robot, mounted)


def shorten_urdf(robot: Robot, tool: Tool) -> str:
    """Write the URDF of the robot with a tool, without what only a simulator needs, and without shapes that are files.

    Args:
        robot: as its description has it.
        tool: which is merged in; its components are links too.
    """
    parser = etree.XMLParser(remove_blank_text=True)
    root = etree.fromstring(assemble(robot, tool, visuals=False), parser)
    for part in [*root.iter("inertial", "dynamics", "collision")]:
        if part.tag != "collision" or part.find("geometry/mesh") is not None:
            part.getparent().remove(part)

    etree.indent(root)
    return str(etree.tostring(root, encoding="unicode"))


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
    points = defaultdict[str, list[Array]](list)

    for solid in robot_solids(robot, gripper):
        name = solid.name if solid.name in separate else GRIPPER
        pose = mount @ poses[solid.name] @ solid.pose
        points[name] += [pose.apply(corners(solid.geometry))]

    found = {}
    for name, groups in points.items():
        low = np.vstack(groups).min(axis=0)
        high = np.vstack(groups).max(axis=0)
        if np.linalg.norm(np.maximum(np.maximum(low, -high), 0.0)) < _NEAR_M:
            found[name] = low, high

    return found
