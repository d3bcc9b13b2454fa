"""``vlmgineer home robot=urdf robot.path=FILE ...``: find joints at which the flange of one's own arm looks down."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from omegaconf import MISSING

from core.config.compose import load, robot_part
from core.design import RIGID_MOUNT
from core.errors import UsageError, UserError
from core.interfaces import Robot
from core.plugins.registry import check_settings
from core.robot.kinematics import arm_of, link_poses
from core.robot.solids import corners, robot_solids
from core.support.cli import arguments, say
from core.support.text import short_numbers
from core.values.descriptions import Description
from plugins.robots.home_search import HOME_DIGITS, find_home
from plugins.robots.normalise import ALSO
from plugins.robots.reading import build_unmounted, describe
from plugins.robots.settings import ArmSettings
from plugins.robots.urdf import urdf

USAGE = (
    "usage: vlmgineer home robot=urdf robot.path=FILE [robot.flange=LINK ...] [at=[x,y,z]]; at: where the flange is to "
    "be in the world, metres"
)
_BEYOND_M = 1e-3  # what reaches less beyond the mount is nothing


@dataclass
class HomeConfig:
    """Settings of ``vlmgineer home``."""

    robot: dict[str, Any] = MISSING
    at: list[float] = field(default_factory=lambda: [0.5, 0.0, 0.5])


def main(words: list[str]) -> None:
    cfg = load("home", arguments(USAGE, words), HomeConfig)
    part = robot_part(cfg.robot)
    if part.name != "urdf":
        raise UsageError(
            f"robot={part.name} has a home; give your own arm: robot=urdf robot.path=FILE"
        )

    if len(cfg.at) != 3 or not all(map(math.isfinite, cfg.at)):
        raise UsageError(f"at must be three numbers, metres, got {list(cfg.at)}")

    chosen = ArmSettings(**check_settings(urdf, dict(part.settings), "robot=urdf", {}))
    place = part.pose.inverse().apply(np.array(cfg.at, dtype=float))
    description = describe(chosen)
    try:
        robot, axis = build_unmounted(description, chosen, anywhere=True)
        robot = find_home(robot, axis, chosen, place)
    except UserError as error:  # a line for each problem
        raise type(error)(str(error).replace(ALSO, "\n- ")) from error

    arm = arm_of(robot)
    room = np.minimum(arm.home - arm.lower, arm.upper - arm.home)
    found = part.pose.apply(arm.forward(arm.home).position)
    say(
        f"the flange {robot.mount_link!r}, borne by {', '.join(robot.arm_joints)}, is at "
        f"({short_numbers(found, 3, ', ')}) and looks down; joint {robot.arm_joints[int(room.argmin())]!r} is nearest "
        f"to a limit, {room.min():.2f} rad from it"
    )
    say(f"robot.home=[{short_numbers(arm.home, HOME_DIGITS, ',')}]")
    if robot.gripper is None:
        _describe_beyond(description, robot)


def _describe_beyond(description: Description, robot: Robot) -> None:
    """Say what is in the way of tools, and how to take it out."""
    flange = robot.mount_link
    beyond = _links_on(description, flange)
    if beyond:
        names = ",".join(beyond)
        say(
            f"{', '.join(beyond)} hang where tools go; leave them out: robot.without=[{names}]"
        )
        return

    depth = _measure_depth(robot)
    if depth > _BEYOND_M:
        x, y, z = robot.mount.apply((0.0, 0.0, -depth))
        say(
            f"tools begin at the frame of {flange!r}, and its shape reaches {1000 * depth:.0f} mm beyond; "
            "if tools go on its face, add this link to the file and choose it with robot.flange=tool0:",
            f'<link name="tool0"/><joint name="tool0_fixed" type="fixed"><origin xyz="{x:.4f} {y:.4f} {z:.4f}"/>'
            f'<parent link="{flange}"/><child link="tool0"/></joint>',
        )


def _links_on(description: Description, flange: str) -> list[str]:
    """List the links on the flange, where a tool is to go, that have shapes or bear some."""
    bearing = set[str]()
    for name, link in description.links.items():
        if link.visuals or link.collisions:
            bearing |= {*description.above(name)}
    return [
        child
        for child, joint in description.joints.items()
        if joint.parent == flange and child in bearing
    ]


def _measure_depth(robot: Robot) -> float:
    """Measure how far the last link's shapes reach beyond the mount, metres, at a home where its axes are upright."""
    poses = link_poses(robot, False, np.array(robot.home))
    mount = poses[RIGID_MOUNT].position[2]
    depth = 0.0
    for solid in robot_solids(robot, False):
        if solid.name in robot.near_mount:
            pose = poses[solid.name] @ solid.pose
            lowest = pose.apply(corners(solid.geometry))[:, 2].min()
            depth = max(depth, float(mount - lowest))
    return depth
