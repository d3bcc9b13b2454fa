"""Compute the frames of a hand from what its fingers do: files turn a hand, and its fingers in it, as they like."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from core.errors import UserError
from core.geometry import Array, Pose
from core.interfaces import Gripper, Robot
from core.robot.meshes import solid_of
from core.robot.solids import corners, solid_geometry
from core.values.descriptions import DIGITS, Inertial, Origin, RobotLink

_ALONG = (
    0.9  # cosine: fingers that open along the last joint's axis have no way to a body
)


@dataclass(frozen=True)
class HandFrame:
    """Where a hand's fingers meet, and how they are turned.

    Its origin is between the closed fingers, at their bases; y is the way in which the first finger opens, and z goes
    to the tips.

    Attributes:
        pose: in the frame of the gripper's link.
        mount: how a tool mount that is square to the fingers is turned in the flange's frame: its z goes away from the
            tips, and the first finger opens toward its -y.
    """

    pose: Pose
    mount: Rotation


def find_hand_frame(robot: Robot, gripper: Gripper, axis: Array) -> HandFrame:
    """Find how a hand is turned.

    Args:
        robot: made by `plugins.robots.own_arm.build_unmounted`.
        gripper: its hand; the first finger chooses the frame's y.
        axis: the last joint's (3,) in the flange's frame.

    Raises:
        UserError: a finger has no collision shape, or they open along the last joint's axis.
    """
    flange = gripper.mount
    points = [_find_points(robot, link) for link in gripper.links]
    ways = [_find_way(robot, joint) for joint in gripper.joints]
    opens = ways[0] - ways[1]
    opens /= np.linalg.norm(opens)

    last = flange.rotation.apply(axis)
    if abs(last @ opens) > _ALONG:
        raise UserError(
            f"the fingers {' and '.join(gripper.links)} open along the axis of {robot.arm_joints[-1]!r}; leave the "
            "gripper away, robot.without=[LINK]"
        )

    # The tips are where the fingers lie, seen from the flange, by right angles from the last joint's axis.
    straight = last - (last @ opens) * opens
    straight /= np.linalg.norm(straight)
    aside = np.cross(opens, straight)
    toward = np.vstack(points).mean(axis=0) - flange.position
    tips = max((straight, aside, -straight, -aside), key=lambda way: way @ toward)

    across = np.cross(opens, tips)
    turn = Rotation.from_matrix(np.column_stack([across, opens, tips]))
    first, second = (turn.inv().apply(found) for found in points)
    both = np.vstack([first, second])
    origin = (
        (both[:, 0].min() + both[:, 0].max()) / 2,
        (first[:, 1].min() + second[:, 1].max()) / 2,
        both[:, 2].min(),
    )
    half_turn = Rotation.from_euler("x", np.pi)
    return HandFrame(
        Pose.from_rotation(turn.apply(origin), turn),
        flange.rotation.inv() * turn * half_turn,
    )


def frame_fingers(robot: Robot, gripper: Gripper, frame: HandFrame) -> Robot:
    """Give a robot a hand whose fingers, while it is closed, both have the hand's frame."""
    description = robot.description
    links = dict(description.links)
    joints = dict(description.joints)
    for name in gripper.links:
        old = joints[name]
        # The old frame in the new one.
        pose = frame.pose.inverse() @ old.origin.pose
        axis = tuple(pose.rotation.apply(old.direction).round(12).tolist())
        joints[name] = replace(
            old, origin=Origin.from_pose(frame.pose, DIGITS), axis=axis
        )
        links[name] = _move_link(links[name], pose)

    description = replace(description, links=links, joints=joints)
    return replace(robot, description=description, gripper=gripper)


def swap_fingers(gripper: Gripper) -> Gripper:
    """Make the first finger the second."""
    joints: tuple[str, str] = (gripper.joints[1], gripper.joints[0])
    links: tuple[str, str] = (gripper.links[1], gripper.links[0])
    return replace(gripper, joints=joints, links=links)


def _find_points(robot: Robot, link: str) -> Array:
    """Find the corners (N, 3) of a closed finger in the frame of the gripper's link."""
    finger = robot.description.links[link]
    if not finger.collisions:
        raise UserError(
            f"finger {link!r} has no collision shape; let it collide as it is drawn, robot.collision=visual"
        )

    found = [
        shape.origin.pose.apply(corners(solid_geometry(solid_of(shape))))
        for shape in finger.collisions
    ]
    placed: Array = robot.description.joints[link].origin.pose.apply(np.vstack(found))
    return placed


def _find_way(robot: Robot, joint: str) -> Array:
    """Find the way (3,) in which a finger opens in the frame of the gripper's link."""
    slide = robot.description.named[joint]
    way: Array = slide.origin.pose.rotation.apply(slide.direction)
    return way


def _move_link(link: RobotLink, pose: Pose) -> RobotLink:
    """Write a link in another frame, in which its own has a pose."""
    collisions = tuple(shape.placed(pose) for shape in link.collisions)
    visuals = tuple(shape.placed(pose) for shape in link.visuals)
    inertial = Inertial.from_tensor(*link.inertial.placed(pose), form=DIGITS)
    return replace(link, inertial=inertial, collisions=collisions, visuals=visuals)
