"""``vlmgineer home robot=urdf robot.path=FILE ...``: find joints at which the flange of one's own arm looks down."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from omegaconf import MISSING
from scipy.spatial.transform import Rotation

from core.config.compose import load, robot_part
from core.design import RIGID_MOUNT, Tool
from core.errors import UsageError, UserError
from core.geometry import Array, Pose
from core.interfaces import JointTrajectory, Robot
from core.plugins.registry import check_settings
from core.robot.kinematics import Arm, Solution, arm_of, link_poses
from core.robot.solids import corners, robot_solids
from core.solids.self_collision import find_self_collision
from core.support.cli import arguments, say
from core.support.text import short_numbers
from core.values.descriptions import Description
from plugins.robots.normalise import ALSO
from plugins.robots.reading import describe, mounted, unmounted, wrist_height
from plugins.robots.settings import ArmSettings
from plugins.robots.urdf import urdf

USAGE = (
    "usage: vlmgineer home robot=urdf robot.path=FILE [robot.flange=LINK ...] [at=[x,y,z]]; at: where the flange is to "
    "be in the world, metres"
)
_TRIES = 10  # starts for each way the flange may be turned
_DIGITS = 3  # of a joint
_NEAR_M = 1e-3
_NEAR_RAD = 1e-2
# Share of a joint's range, and a singular value, beyond which more is no better.
_ROOM = 0.1
_STRAIGHT = 0.08


@dataclass
class HomeConfig:
    """Settings of ``vlmgineer home``."""

    robot: dict[str, Any] = MISSING
    at: list[float] = field(default_factory=lambda: [0.5, 0.0, 0.5])


def find_home(robot: Robot, axis: Array, chosen: ArmSettings, at: Array) -> Robot:
    """Find a home at which the flange is ``at`` (3,) in the base's frame and looks down, with the mount turned so.

    Prefer one far from the joints' limits and from singularities, with the links high above the base.

    Args:
        robot: made by `plugins.robots.reading.unmounted`, as ``axis`` is.
        axis: the last joint's (3,) in the flange's frame.
        chosen: the settings of the arm.
        at: metres.

    Raises:
        UserError: none is found; says what came nearest.
    """
    arm = arm_of(robot)
    found = list[tuple[float, Array]]()
    tried = list[Solution]()
    ends = np.maximum(arm.lower, -math.pi), np.minimum(arm.upper, math.pi)
    for goal in _goals(axis, chosen.mount_rpy, at):
        for start in (
            arm.home,
            *np.random.default_rng(0).uniform(*ends, (_TRIES, arm.lower.size)),
        ):
            tried.append(solution := arm.inverse(goal, start))
            if solution.error_m < _NEAR_M and solution.error_rad < _NEAR_RAD:
                found.append((_worth(arm, robot, solution.joints), solution.joints))
    problem = _miss(arm, min(tried, key=lambda one: one.error_m + one.error_rad))
    for _, joints in sorted(found, key=lambda one: -one[0]):
        try:
            made = mounted(
                replace(robot, home=tuple(joints.round(_DIGITS).tolist())),
                axis,
                chosen.mount_rpy,
            )
        except UserError as error:
            problem = str(error)
            continue
        if met := find_self_collision(
            made,
            Tool(),
            JointTrajectory(np.zeros(1), np.array([made.home]), np.zeros(1)),
        ):
            problem = f"there {met.describe(np.zeros(1))}"
            continue
        return made
    place = short_numbers(at, 3, ", ")
    raise UserError(
        f"no joints bring the flange to ({place}) from its base, looking down: {problem}; choose another at=, or place "
        "the arm elsewhere with robot.base=[x,y,z,yaw]"
    )


def _miss(arm: Arm, nearest: Solution) -> str:
    """Say how far the wanted pose is beyond reach, and which joints are at their limits where the arm is nearest."""
    room = np.minimum(nearest.joints - arm.lower, arm.upper - nearest.joints)
    ends = [
        repr(name)
        for name, left in zip(arm.robot.arm_joints, room, strict=True)
        if left < _NEAR_RAD
    ]
    held = f", with {', '.join(ends)} at the limit" if ends else ""
    return f"the nearest misses it by {nearest.error_m:.3f} m and {math.degrees(nearest.error_rad):.0f} degrees{held}"


def _goals(
    axis: Array, rpy: tuple[float, float, float] | None, at: Array
) -> Iterator[Pose]:
    """Yield the flange's poses at which a mount on it can have the axes of the base."""
    turns = (
        Rotation.create_group("O") if rpy is None else Rotation.from_euler("xyz", [rpy])
    )
    for turn in turns.inv():
        if rpy is not None or abs(turn.apply(axis)[2]) > 0.94:
            yield Pose.from_rotation(at, turn)


def _worth(arm: Arm, robot: Robot, joints: Array) -> float:
    """Rate joints (J,) as a home."""
    room = float(
        (
            np.minimum(joints - arm.lower, arm.upper - joints) / (arm.upper - arm.lower)
        ).min()
    )
    # Singular values of how the flange's place and direction follow the joints, by differences.
    here = arm.forward(joints)
    steps = 1e-4 * np.eye(len(joints))
    moved = [arm.forward(joints + step) for step in steps]
    ways = [
        np.r_[
            to.position - here.position,
            0.3 * (to.rotation * here.rotation.inv()).as_rotvec(),
        ]
        for to in moved
    ]
    straight = (
        float(np.linalg.svd(np.array(ways) / 1e-4, compute_uv=False)[-1])
        if len(joints) >= 6
        else 0.0
    )
    heights = [pose.position[2] for pose in link_poses(robot, False, joints).values()]
    return float(
        10 * (wrist_height(robot, joints) > 0)
        + min(room, _ROOM) / _ROOM
        + min(straight, _STRAIGHT) / _STRAIGHT
        + np.mean(heights)
        + 20 * min(min(heights), 0.0)
        - 0.05 * np.abs(joints).sum()
    )


def _beyond(description: Description, flange: str) -> list[str]:
    """List the links on the flange, where a tool is to go, that have shapes or bear some."""
    shaped = {
        name
        for name, link in description.links.items()
        if link.visuals or link.collisions
    }
    tops = [
        child for child, joint in description.joints.items() if joint.parent == flange
    ]
    return [
        top for top in tops if any(top in description.above(name) for name in shaped)
    ]


def _depth(robot: Robot) -> float:
    """Measure how far the last link's shapes reach beyond the mount, metres, at a home where its axes are upright."""
    poses = link_poses(robot, False, np.array(robot.home))
    solids = [
        solid for solid in robot_solids(robot, False) if solid.name in robot.near_mount
    ]
    lowest = [
        poses[one.name].apply(one.pose.apply(corners(one.geometry)))[:, 2].min()
        for one in solids
    ]
    return float(poses[RIGID_MOUNT].position[2] - min(lowest)) if lowest else 0.0


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
    at = part.pose.inverse().apply(np.array(cfg.at, dtype=float))
    description = describe(chosen)
    try:
        robot = find_home(*unmounted(description, chosen, anywhere=True), chosen, at)
    except UserError as error:  # a line for each problem
        raise type(error)(str(error).replace(ALSO, "\n- ")) from error
    arm = arm_of(robot)
    home = np.array(robot.home)
    room = np.minimum(home - arm.lower, arm.upper - home)
    place = short_numbers(part.pose.apply(arm.forward(home).position), 3, ", ")
    say(
        f"the flange {robot.mount_link!r}, borne by {', '.join(robot.arm_joints)}, is at ({place}) and looks down; "
        f"joint {robot.arm_joints[int(room.argmin())]!r} is nearest to a limit, {room.min():.2f} rad from it"
    )
    say(f"robot.home=[{short_numbers(home, _DIGITS, ',')}]")
    if not robot.gripper and (beyond := _beyond(description, robot.mount_link)):
        say(
            f"{', '.join(beyond)} hang where tools go; leave them out: robot.without=[{','.join(beyond)}]"
        )
    elif not robot.gripper and (depth := _depth(robot)) > _NEAR_M:
        x, y, z = robot.mount.apply((0.0, 0.0, -depth))
        say(
            f"tools begin at the frame of {robot.mount_link!r}, and its shape reaches {1000 * depth:.0f} mm beyond; "
            "if tools go on its face, add this link to the file and choose it with robot.flange=tool0:",
            f'<link name="tool0"/><joint name="tool0_fixed" type="fixed"><origin xyz="{x:.4f} {y:.4f} {z:.4f}"/>'
            f'<parent link="{robot.mount_link}"/><child link="tool0"/></joint>',
        )
