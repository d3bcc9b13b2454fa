"""Turn the mount of an arm of one's own as its home has it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import RIGID_MOUNT
from core.errors import UserError
from core.geometry import Array, Pose
from core.interfaces import Gripper, Robot
from core.robot.kinematics import Arm, link_poses
from core.robot.solids import robot_solids
from core.support.text import short_numbers
from plugins.robots.hand_frames import (
    HandFrame,
    find_hand_frame,
    frame_fingers,
    swap_fingers,
)

START = (0.5, 0.0, 0.5)  # where most tasks begin
_TILT_RAD = 0.35  # at most between the mount's axes at home and the world's
# Of the middle of the link before the last joint: a flange that looks up is above it.
_UNDER_M = 0.005
_ALONG = 0.5  # cosine: the last joint turns about something like the vertical
_EXACT = 1e-3  # metres and radians
_TURNS_HAND = 0.94  # cosine: a joint whose axis is so near to the vertical turns a hand that looks down
_MEND = "choose a home where the flange looks down (vlmgineer import FILE)"


def turn_mount(
    robot: Robot,
    axis: Array,
    rpy: Sequence[float] | None,
    face_m: float,
    notes: list[str],
) -> Robot:
    """Turn the mount of a robot as its home has it, and the arm in place until the mount is exactly upright.

    The mount of an arm with a gripper is square to the way in which the fingers open.

    Args:
        robot: made by `plugins.robots.own_arm.build_unmounted`.
        axis: the last joint's (3,) in the flange's frame: a flange is square to it.
        rpy: how the mount is turned in the flange's frame, radians; None: by right angles, to be nearest to the world.
        face_m: how far it is beyond the flange's frame.
        notes: gets what was assumed, a line each.

    Raises:
        UserError: at home the flange does not look down (says which way it is off), or can't be turned so near there.
    """
    asked = None if rpy is None else Rotation.from_euler("xyz", rpy)
    flange = Arm(robot).forward(np.array(robot.home)).rotation
    if robot.gripper is not None:
        robot, turn = _turn_with_hand(robot, axis, flange, asked, notes)
        flange = Arm(robot).forward(np.array(robot.home)).rotation
    else:
        turn = asked or _turn_by_right_angles(robot, axis, flange)

    _check_upright(robot, flange, turn)

    mount = Pose.from_rotation(turn.apply((0.0, 0.0, -face_m)), turn)
    gripper = robot.gripper
    if gripper is not None:
        gripper = replace(gripper, mount=gripper.mount @ mount)

    robot = replace(robot, mount=mount, gripper=gripper)

    arm = Arm(robot)
    upright = Pose(arm.forward(arm.home).position)
    solution = arm.inverse(upright, arm.home)
    if solution.error_m > _EXACT or solution.error_rad > _EXACT:
        raise UserError(
            f"near home the arm can't turn the flange straight down: it misses it by {solution.error_m:.3f} m and "
            f"{solution.error_rad:.3f} rad; choose another home"
        )

    return replace(robot, home=tuple(solution.joints.round(6).tolist()))


def _turn_with_hand(
    robot: Robot,
    axis: Array,
    flange: Rotation,
    asked: Rotation | None,
    notes: list[str],
) -> tuple[Robot, Rotation]:
    """Turn the mount as the fingers open, and the hand at home until it is square to the world.

    Args:
        robot: as for `turn_mount`.
        axis: see there.
        flange: at home, in the world.
        asked: how the mount is turned in the flange's frame; None: as the fingers open.
        notes: see there.

    Returns:
        The robot, whose fingers have the hand's frame, and how its mount is turned in the flange's frame.
    """
    wanted = asked or flange.inv()
    hands = list_hands(robot, axis)
    hands.sort(key=lambda hand: (wanted.inv() * hand[1].mount).magnitude())
    if asked is not None:
        return frame_fingers(robot, *hands[0]), asked

    chosen = hands[0]
    for hand in hands:
        x, y, _ = (flange * hand[1].mount).apply((1.0, 0.0, 0.0))
        yaw = math.atan2(y, x)
        home: tuple[float, ...] | None = robot.home
        if abs(yaw) > _TILT_RAD:
            home = _turn_last_joint(robot, yaw)
        if home is None:
            continue

        if home != robot.home:
            words = f"robot.home=[{short_numbers(home, 3, ',')}]"
            notes.append(
                f"at this home the fingers open along a line that is turned by {math.degrees(abs(yaw)):.0f} degrees; "
                f"the hand is turned until it is square; {words} says so"
            )
            robot = replace(robot, home=home)

        chosen = hand
        break

    gripper, frame = chosen
    return _turn_bolts(frame_fingers(robot, gripper, frame), frame), frame.mount


def list_hands(robot: Robot, axis: Array) -> list[tuple[Gripper, HandFrame]]:
    """List both ways to see a hand, of which each finger is the first once; see `find_hand_frame`."""
    assert robot.gripper is not None
    hands = (robot.gripper, swap_fingers(robot.gripper))
    return [(hand, find_hand_frame(robot, hand, axis)) for hand in hands]


def _turn_last_joint(robot: Robot, yaw: float) -> tuple[float, ...] | None:
    """Turn the last joint that turns the hand about the vertical back by ``yaw``, from home.

    None: there is none, or its limits don't allow it.
    """
    arm = Arm(robot)
    vertical = arm.jacobian(arm.home)[5]
    turning = np.flatnonzero(np.abs(vertical) > _TURNS_HAND)
    if not turning.size:
        return None

    last = turning[-1]
    home = arm.home.copy()
    home[last] -= yaw * np.sign(vertical[last])
    inside = arm.lower[last] <= home[last] <= arm.upper[last]
    return tuple(home.tolist()) if inside else None


def _turn_bolts(robot: Robot, frame: HandFrame) -> Robot:
    """Count the angles of the flange's bolts from the mount's x: they are given from the flange's nearest axis."""
    turns = Rotation.create_group("O")
    off = turns.inv() * frame.mount
    angle = float(off[int(off.magnitude().argmin())].as_rotvec()[2])
    bolts = robot.flange.bolt_angle - angle
    return replace(robot, flange=replace(robot.flange, bolt_angle=bolts))


def _turn_by_right_angles(robot: Robot, axis: Array, flange: Rotation) -> Rotation:
    """Turn the mount in the flange's frame by right angles, so that its axes are nearest to the world's."""
    down = flange.apply(axis)
    tilt = math.acos(min(1.0, abs(down[2])))
    if tilt > _TILT_RAD:
        raise UserError(
            f"at home the axis of {robot.arm_joints[-1]!r} is {math.degrees(tilt):.0f} degrees off the vertical; "
            f"{_MEND}, or turn the mount: robot.mount_rpy"
        )

    turns = Rotation.create_group("O")
    off = (turns.inv() * flange.inv()).magnitude()
    return turns[int(off.argmin())]


def _check_upright(robot: Robot, flange: Rotation, turn: Rotation) -> None:
    """Refuse a mount whose axes at home are far from the world's, and a flange that looks up."""
    off = float((flange * turn).magnitude())
    if off > _TILT_RAD:
        same = Pose.from_rotation(np.zeros(3), flange.inv()).rpy
        raise UserError(
            f"at home the mount's axes are {math.degrees(off):.0f} degrees off the world's; {_MEND}, or set "
            f"robot.mount_rpy=[{short_numbers(same, 4, ',')}]"
        )

    height = wrist_height(robot, np.array(robot.home))
    if height < -_UNDER_M:
        raise UserError(
            f"at home the link before {robot.arm_joints[-1]!r} is {-height:.3f} m below flange "
            f"{robot.mount_link!r}, which looks up; {_MEND}"
        )


def wrist_height(robot: Robot, joints: Array) -> float:
    """Measure how far above the mount, along the last joint, the middle of the link before that joint is, metres.

    Of a flange that looks down it is above, whatever the flange's own shape and frame. 0: no link has a shape.
    """
    middles = find_middles(robot, joints)
    poses = link_poses(robot, False, joints)
    last = robot.description.named[robot.arm_joints[-1]]
    for link in robot.description.above(last.parent):
        if link in middles:
            along = poses[last.child].rotation.apply(last.direction)
            if abs(along[2]) < _ALONG:  # the flange is not square to it
                along = np.array([0.0, 0.0, 1.0])

            way = middles[link] - poses[RIGID_MOUNT].position
            return float(way @ along * along[2])

    return 0.0


def find_middles(robot: Robot, joints: Array) -> dict[str, Array]:
    """Find the middle (3,) of each link that has shapes, in the world."""
    poses = link_poses(robot, False, joints)
    middles: dict[str, list[Array]] = {}
    for solid in robot_solids(robot, False):
        middle, _ = solid.bounds()
        middles.setdefault(solid.name, []).append(poses[solid.name].apply(middle))

    return {name: np.mean(some, axis=0) for name, some in middles.items()}
