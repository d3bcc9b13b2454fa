"""Write the arm with its tool for PyBullet, and load it."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from core.design import Tool
from core.errors import UserError
from core.robot.description import assembled
from core.robot.writing import write
from core.values.robots import Robot
from plugins.simulators.inertia import Inertia, principal
from plugins.simulators.pybullet.engine import Client
from plugins.simulators.pybullet.engine import pybullet as p
from plugins.simulators.pybullet.urdf_links import inertial, text_file

# Of no body is a moment of inertia larger than the sum of the two others, and PyBullet reads no such file. A link with
# its motor's inertia is no such body. So files hold these moments, kg m^2, and links get their own once loaded.
_PLACEHOLDER = (1.0, 0.0, 0.0, 1.0, 0.0, 1.0)


@lru_cache(maxsize=4)  # consecutive jobs mostly share it
def robot_file(folder: Path, robot: Robot, tool: Tool, *, visuals: bool) -> Path:
    """Write the arm with its tool to a file: PyBullet reads only files.

    Args:
        folder: where it is written.
        robot: the arm.
        tool: what it holds.
        visuals: with what is drawn, too.
    """
    arm = assembled(robot, tool, fused=True)
    links = dict(arm.links)
    for name, inertia in driven_links(robot).items():
        placeholder = replace(inertial(inertia), moments=_PLACEHOLDER)
        links[name] = replace(links[name], inertial=placeholder)

    text = write(replace(arm, links=links), visuals=visuals)
    return text_file(folder, text, "urdf")


@lru_cache(maxsize=8)
def driven_links(robot: Robot) -> dict[str, Inertia]:
    """Map each link that a motor turns to its inertia with the motor's, which is about the joint's axis alone.

    Bullet has no inertia of a joint. As a link's own, the joints before it carry it too where their axes are parallel.

    Raises:
        UserError: a motor that slides has inertia: as a link's own mass it would weigh.
    """
    arm = assembled(robot, fused=True)
    inertias = {}
    for name, motor in zip(robot.arm_joints, robot.motor_inertia, strict=True):
        joint = arm.named[name]
        if joint.kind == "prismatic":
            if motor:
                raise UserError(
                    f"sim=pybullet has no inertia of a motor that slides, such as {name!r}: give it 0 in "
                    "robot.motor_inertia=[...], or take sim=mujoco"
                )
            continue

        mass, center, tensor = arm.links[joint.child].inertial.placed()
        driven = tensor + motor * np.outer(joint.axis, joint.axis)
        inertias[joint.child] = principal(mass, center, driven)

    return inertias


def load_robot(client: Client, file: Path) -> int:
    """Load the arm and return its number in the world."""
    flags = p.URDF_USE_INERTIA_FROM_FILE | p.URDF_USE_SELF_COLLISION
    return int(client.loadURDF(str(file), useFixedBase=True, flags=flags))


def joint_numbers(client: Client, robot: int) -> tuple[dict[str, int], dict[str, int]]:
    """Map the names of joints, and of links but the base, to PyBullet's numbers."""
    joints = {}
    links = {}
    for number in range(client.getNumJoints(robot)):
        info = client.getJointInfo(robot, number)
        joints[info[1].decode()] = number
        links[info[12].decode()] = number

    return joints, links
