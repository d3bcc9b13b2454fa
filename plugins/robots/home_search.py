"""Find joints at which the flange of one's own arm looks down."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from core.design import RIGID_MOUNT, Tool
from core.errors import UserError
from core.geometry import Array, Pose
from core.interfaces import JointTrajectory, Robot
from core.robot.kinematics import Arm, Solution, arm_of, link_poses, robot_model
from core.robot.solids import corners, robot_solids
from core.solids.self_collision import find_self_collision
from core.support.text import short_numbers
from plugins.robots.arm_settings import ArmSettings
from plugins.robots.enlarging import REACH_M
from plugins.robots.own_arm import Unmounted
from plugins.robots.turned_mount import (
    START,
    find_middles,
    list_hands,
    turn_mount,
    wrist_height,
)

_ONWARD = 0.7  # cosine between a tool's direction and the last link's
_UPRIGHT = 0.94  # of the last joint's axis, where a square flange looks down
# Metres; of an arm of `REACH_M` that far, with the flange down.
_REACHES = (0.7, 0.6, 0.5, 0.45, 0.4, 0.35, 0.3, 0.25, 0.2, 0.15)
_FAR = (0.7, 0.0, 0.2)
_LIFTS_M = (0.0, 0.2, 0.4)
HOME_DIGITS = 3  # of a joint
_TRIES = 10  # starts for each way the flange may be turned
_NEAR_M = 1e-3
_NEAR_RAD = 1e-2
# Share of a joint's range, and a singular value, beyond which more is no better.
_ROOM = 0.1
_STRAIGHT = 0.08
_RADIAN_M = 0.3  # a turn of the flange weighs as much as this way


@dataclass(frozen=True)
class Found:
    """An arm with its mount, at a home.

    Attributes:
        robot: the arm, as large as it is.
        words: that are needed beside its home.
        factor: how many times larger tasks want it.
        lift_m: by how much its base is to be raised.
    """

    robot: Robot
    words: tuple[str, ...] = ()
    factor: float = 1.0
    lift_m: float = 0.0


def find_for_tasks(arm: Unmounted, chosen: ArmSettings) -> Found:
    """Find a home where tasks begin, of the arm or of one that is larger or raised, so that it reaches tasks.

    Raises:
        UserError: see `find_home`.
    """
    nearest: Found | None = None
    longest = robot_model(arm.robot, Tool()).reach
    for reach, lift_m in itertools.product((REACH_M, *_REACHES), _LIFTS_M):
        factor = REACH_M / reach
        places = (np.array([START, _FAR]) - (0.0, 0.0, lift_m)) / factor
        if np.hypot(*places[1, :2]) > longest:
            continue

        try:
            found = find_home(arm, chosen, places[0])
        except UserError:
            continue

        words = found.words
        if factor > 1:
            words += (f"robot.reach={reach:g}",)
        if lift_m:
            words += (f"robot.base=[0,0,{lift_m:g},0]",)

        found = Found(found.robot, words, factor, lift_m)
        if _works_at(found.robot, places):
            return found

        nearest = nearest or found

    return nearest or find_home(arm, chosen, np.array(START))


def _works_at(robot: Robot, places: Array) -> bool:
    """Tell whether the flange's face, too, reaches places (N, 3) and looks down there."""
    beyond = robot.mount @ Pose(np.array([0.0, 0.0, -measure_depth(robot)]))
    arm = Arm(replace(robot, mount=beyond))
    return all(_is_near(arm.inverse(Pose(place), arm.home)) for place in places)


def _is_near(solution: Solution) -> bool:
    return solution.error_m < _NEAR_M and solution.error_rad < _NEAR_RAD


def measure_depth(robot: Robot) -> float:
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


def find_home(arm: Unmounted, chosen: ArmSettings, place: Array) -> Found:
    """Find a home at which the flange is at ``place`` (3,) from the base, and looks down with its mount.

    Prefer one far from the joints' limits and from singularities, with the links high above the base. The mount is
    square to the last joint. Where that can't look down, it is turned by other right angles, so that tools go on in the
    last link's own direction. With a gripper the mount is square to the way in which the fingers open.

    Raises:
        UserError: none is found; says what came nearest.
    """
    model = arm_of(arm.robot)
    square = Rotation.create_group("O")
    upright = np.abs(square.inv().apply(arm.axis)[:, 2]) > _UPRIGHT
    outward = _find_outward(arm.robot)
    onward = -square.apply((0.0, 0.0, 1.0)) @ outward > _ONWARD
    turns = [square[upright], square[onward & ~upright]]
    if arm.robot.gripper is not None:
        hands = list_hands(arm.robot, arm.axis)
        turns = [Rotation.concatenate([frame.mount for _, frame in hands])]
    if chosen.mount_rpy is not None:
        turns = [Rotation.from_euler("xyz", [chosen.mount_rpy])]

    tried = list[Solution]()
    problem = ""
    for number, group in enumerate(turns):
        for solution, turn in _solve(model, group, place, tried):
            robot = replace(
                arm.robot, home=tuple(solution.joints.round(HOME_DIGITS).tolist())
            )
            rpy = chosen.mount_rpy
            words: tuple[str, ...] = ()
            if number:
                rpy = Pose.from_rotation(np.zeros(3), turn).rpy.round(4).tolist()
                words = (f"robot.mount_rpy=[{short_numbers(rpy, 4, ',')}]",)

            try:
                return Found(_mount(robot, arm.axis, rpy, chosen.face_m), words)
            except UserError as error:
                problem = problem or str(error)

    nearest = min(tried, key=lambda solution: solution.error_m + solution.error_rad)
    problem = problem or _describe_miss(arm, model, nearest, place)
    where = short_numbers(place, 3, ", ")
    raise UserError(f"no joints bring the flange to ({where}), looking down: {problem}")


def _find_outward(robot: Robot) -> Array:
    """Find the direction (3,) in which the last link leads on from its joint, in the flange's frame."""
    joints = np.array(robot.home)
    poses = link_poses(robot, False, joints)
    head = robot.near_mount[0]
    mount = poses[RIGID_MOUNT]
    middle = find_middles(robot, joints).get(head, mount.position)
    way = (middle + mount.position) / 2 - poses[head].position
    outward = mount.rotation.inv().apply(way)
    return np.asarray(outward / max(float(np.linalg.norm(outward)), 1e-3))


def _solve(
    arm: Arm, turns: Rotation, place: Array, tried: list[Solution]
) -> list[tuple[Solution, Rotation]]:
    """Find joints that bring mounts with the world's axes to a place, the best first; note all that was tried."""
    found = []
    with_home = (arm.home, *_starts(arm))
    for turn in turns:
        goal = Pose.from_rotation(place, turn.inv())
        for start in with_home:
            solution = arm.inverse(goal, start)
            tried.append(solution)
            if _is_near(solution):
                found.append((solution, turn))

    return sorted(found, key=lambda pair: -_rate(arm, pair[0].joints))


def _mount(
    robot: Robot, axis: Array, rpy: Sequence[float] | None, face_m: float
) -> Robot:
    """Mount tools at a home.

    Raises:
        UserError: the flange does not look down there, or the arm meets itself.
    """
    upright = turn_mount(robot, axis, rpy, face_m, [])
    still = JointTrajectory(np.zeros(1), np.array([upright.home]), np.zeros(1))
    met = find_self_collision(upright, Tool(), still)
    if met is not None:
        raise UserError(f"there {met.describe(np.zeros(1))}")

    return upright


def _starts(arm: Arm) -> Iterator[Array]:
    """Yield joints (J,) at random, from which to search, the same for each goal."""
    lower = np.maximum(arm.lower, -math.pi)
    upper = np.minimum(arm.upper, math.pi)
    yield from np.random.default_rng(0).uniform(lower, upper, (_TRIES, lower.size))


def _describe_miss(arm: Unmounted, model: Arm, nearest: Solution, place: Array) -> str:
    """Say how far the wanted pose is beyond reach, which joints are at their limits there, and what mends it."""
    room = np.minimum(nearest.joints - model.lower, model.upper - nearest.joints)
    held = [repr(arm.joints[i]) for i in np.flatnonzero(room < _NEAR_RAD)]
    missed = (
        f"the nearest misses it by {nearest.error_m:.3f} m and "
        f"{math.degrees(nearest.error_rad):.0f} degrees"
    )
    if held:
        missed += f", with {', '.join(held)} at the limit"

    def miss(joints: Array) -> Array:
        return model.forward(joints).position - place

    # Of the place alone, whatever the direction.
    reached = least_squares(miss, nearest.joints, bounds=(model.lower, model.upper))
    if np.linalg.norm(reached.fun) < _NEAR_M:
        return (
            f"{missed}: the place is reached, the direction is not; choose another at=, or turn tools in the flange's "
            "frame with robot.mount_rpy=[roll,pitch,yaw]"
        )

    return f"{missed}; choose another at=, nearer to the arm, or place the arm elsewhere with robot.base=[x,y,z,yaw]"


def _rate(arm: Arm, joints: Array) -> float:
    """Rate joints (J,) as a home."""
    room = np.minimum(joints - arm.lower, arm.upper - joints)
    share = float((room / (arm.upper - arm.lower)).min())

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
