"""Find joints at which the flange of one's own arm looks down."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import Tool
from core.errors import UserError
from core.geometry import Array, Pose
from core.interfaces import JointTrajectory, Robot
from core.robot.kinematics import Arm, Solution, arm_of, link_poses
from core.solids.self_collision import find_self_collision
from core.support.text import short_numbers
from plugins.robots.mounting import turn_mount, wrist_height
from plugins.robots.settings import ArmSettings

HOME_DIGITS = 3  # of a joint
_TRIES = 10  # starts for each way the flange may be turned
_NEAR_M = 1e-3
_NEAR_RAD = 1e-2
# Share of a joint's range, and a singular value, beyond which more is no better.
_ROOM = 0.1
_STRAIGHT = 0.08
_RADIAN_M = 0.3  # a turn of the flange weighs as much as this way


def find_home(robot: Robot, axis: Array, chosen: ArmSettings, place: Array) -> Robot:
    """Find a home at which the flange is at ``place`` (3,) in the base's frame, and looks down with its mount.

    Prefer one far from the joints' limits and from singularities, with the links high above the base.

    Args:
        robot: made by `plugins.robots.reading.build_unmounted`, as ``axis`` is.
        axis: the last joint's (3,) in the flange's frame.
        chosen: the settings of the arm.
        place: metres.

    Raises:
        UserError: none is found; says what came nearest.
    """
    arm = arm_of(robot)
    tried = []
    for goal in _goals(axis, chosen.mount_rpy, place):
        for start in _starts(arm):
            tried.append(arm.inverse(goal, start))

    found = [s for s in tried if s.error_m < _NEAR_M and s.error_rad < _NEAR_RAD]
    found.sort(key=lambda solution: -_rate(arm, solution.joints))

    nearest = min(tried, key=lambda solution: solution.error_m + solution.error_rad)
    problem = _describe_miss(arm, nearest)
    for solution in found:
        home = tuple(solution.joints.round(HOME_DIGITS).tolist())
        try:
            upright = turn_mount(replace(robot, home=home), axis, chosen.mount_rpy)
        except UserError as error:
            problem = str(error)
            continue

        still = JointTrajectory(np.zeros(1), np.array([upright.home]), np.zeros(1))
        met = find_self_collision(upright, Tool(), still)
        if met is None:
            return upright
        problem = f"there {met.describe(np.zeros(1))}"

    where = short_numbers(place, 3, ", ")
    raise UserError(
        f"no joints bring the flange to ({where}) from its base, looking down: {problem}; choose another at=, or place "
        "the arm elsewhere with robot.base=[x,y,z,yaw]"
    )


def _goals(
    axis: Array, rpy: tuple[float, float, float] | None, place: Array
) -> Iterator[Pose]:
    """Yield the flange's poses at which a mount on it can have the axes of the base."""
    if rpy is not None:
        yield Pose.from_rotation(place, Rotation.from_euler("xyz", rpy).inv())
        return
    for turn in Rotation.create_group("O").inv():
        if abs(turn.apply(axis)[2]) > 0.94:
            yield Pose.from_rotation(place, turn)


def _starts(arm: Arm) -> Iterator[Array]:
    """Yield joints (J,) from which to search: home, and some at random, the same for each goal."""
    yield arm.home
    lower = np.maximum(arm.lower, -math.pi)
    upper = np.minimum(arm.upper, math.pi)
    yield from np.random.default_rng(0).uniform(lower, upper, (_TRIES, lower.size))


def _describe_miss(arm: Arm, nearest: Solution) -> str:
    """Say how far the wanted pose is beyond reach, and which joints are at their limits where the arm is nearest."""
    room = np.minimum(nearest.joints - arm.lower, arm.upper - nearest.joints)
    held = [repr(arm.robot.arm_joints[i]) for i in np.flatnonzero(room < _NEAR_RAD)]
    missed = (
        f"the nearest misses it by {nearest.error_m:.3f} m and "
        f"{math.degrees(nearest.error_rad):.0f} degrees"
    )
    return f"{missed}, with {', '.join(held)} at the limit" if held else missed


def _rate(arm: Arm, joints: Array) -> float:
    """Rate joints (J,) as a home."""
    room = np.minimum(joints - arm.lower, arm.upper - joints)
    share = float((room / (arm.upper - arm.lower)).min())

    straight = 0.0
    if len(joints) >= 6:
        jacobian = arm.jacobian(joints).copy()
        jacobian[3:] *= _RADIAN_M
        straight = float(np.linalg.svd(jacobian, compute_uv=False)[-1])

    poses = link_poses(arm.robot, False, joints)
    heights = [pose.position[2] for pose in poses.values()]
    return float(
        10 * (wrist_height(arm.robot, joints) > 0)
        + min(share, _ROOM) / _ROOM
        + min(straight, _STRAIGHT) / _STRAIGHT
        + np.mean(heights)
        + 20 * min(min(heights), 0.0)
        - 0.05 * np.abs(joints).sum()
    )
