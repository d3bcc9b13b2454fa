"""Find joints at which the flange of one's own arm looks down."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import RIGID_MOUNT, Tool
from core.errors import UserError
from core.geometry import Array, Pose
from core.interfaces import JointTrajectory, Robot
from core.robot.kinematics import Arm, Solution, arm_of, link_poses
from core.robot.solids import corners, robot_solids
from core.solids.self_collision import find_self_collision
from core.support.text import short_numbers
from plugins.robots.mounting import stand_nearer, turn_mount, wrist_height
from plugins.robots.reading import Unmounted
from plugins.robots.settings import ArmSettings

_ONWARD = 0.7  # cosine between a tool's direction and the last link's
_UPRIGHT = 0.94  # of the last joint's axis, where a square flange looks down
_REACHES = (0.7, 0.6, 0.5, 0.4, 0.35, 0.3, 0.25, 0.2)  # metres
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
    """An arm with its mount, at a home; words that are needed beside it, and by how much they move the base (3,)."""

    robot: Robot
    words: tuple[str, ...] = ()
    moved: Array = field(default_factory=lambda: np.zeros(3))


def find_smaller(arm: Unmounted, chosen: ArmSettings, place: Array) -> Found:
    """Find a home at ``place`` (3,) from the base, or where it is from the base of a smaller arm.

    Raises:
        UserError: see `find_home`.
    """
    missed: UserError | None = None
    try:
        found = find_home(arm, chosen, place)
        if _reaches_face(found.robot, place):
            return found
    except UserError as error:
        missed = error

    for reach in _REACHES:
        moved = stand_nearer(reach, []).position
        try:
            found = find_home(arm, chosen, place - moved)
        except UserError:
            continue
        if not _reaches_face(found.robot, place - moved):
            continue
        arm.notes.append(
            "most tasks begin at (0.5, 0, 0.5), which is out of its reach; robot.reach brings them nearer"
        )
        words = (*found.words, f"robot.reach={reach}")
        return replace(found, words=words, moved=moved)
    raise missed or UserError(
        "no reach brings the face of the flange to where tasks begin; choose at=[x,y,z]"
    )


def _reaches_face(robot: Robot, place: Array) -> bool:
    """Tell whether the flange's face can be where its frame is at home, too."""
    beyond = robot.mount @ Pose(np.array([0.0, 0.0, -measure_depth(robot)]))
    arm = Arm(replace(robot, mount=beyond))
    solution = arm.inverse(Pose(place), arm.home)
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
    last link's own direction.

    Raises:
        UserError: none is found; says what came nearest.
    """
    model = arm_of(arm.robot)
    square = Rotation.create_group("O")
    upright = np.abs(square.inv().apply(arm.axis)[:, 2]) > _UPRIGHT
    outward = _find_outward(arm.robot)
    onward = -square.apply((0.0, 0.0, 1.0)) @ outward > _ONWARD
    turns = [square[upright], square[onward & ~upright]]
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
    problem = problem or _describe_miss(arm, model, nearest)
    where = short_numbers(place, 3, ", ")
    raise UserError(f"no joints bring the flange to ({where}), looking down: {problem}")


def _find_outward(robot: Robot) -> Array:
    """Find the direction (3,) in which the last link leads on from its joint, in the flange's frame."""
    poses = link_poses(robot, False, np.array(robot.home))
    head = robot.near_mount[0]
    mount = poses[RIGID_MOUNT]
    points = [mount.position]
    for solid in robot_solids(robot, False):
        if solid.name == head:
            middle, _ = solid.bounds()
            points.append(poses[head].apply(middle))

    way = np.mean(points, axis=0) - poses[head].position
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
            if solution.error_m < _NEAR_M and solution.error_rad < _NEAR_RAD:
                found.append((solution, turn))
    return sorted(found, key=lambda pair: -_rate(arm, pair[0].joints))


def _mount(
    robot: Robot, axis: Array, rpy: Sequence[float] | None, face_m: float
) -> Robot:
    """Mount tools at a home.

    Raises:
        UserError: the flange does not look down there, or the arm meets itself.
    """
    upright = turn_mount(robot, axis, rpy, face_m)
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


def _describe_miss(arm: Unmounted, model: Arm, nearest: Solution) -> str:
    """Say how far the wanted pose is beyond reach, which joints are at their limits there, and what mends it."""
    room = np.minimum(nearest.joints - model.lower, model.upper - nearest.joints)
    held = [repr(arm.joints[i]) for i in np.flatnonzero(room < _NEAR_RAD)]
    missed = (
        f"the nearest misses it by {nearest.error_m:.3f} m and "
        f"{math.degrees(nearest.error_rad):.0f} degrees"
    )
    if held:
        missed += f", with {', '.join(held)} at the limit"
    if nearest.error_m < _NEAR_M:
        return (
            f"{missed}: the place is reached, the direction is not; choose another at="
        )
    return f"{missed}; choose another at=, nearer to the arm, or place the arm elsewhere with robot.base=[x,y,z,yaw]"


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
