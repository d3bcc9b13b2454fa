"""The hand of an arm, a parallel gripper: where its fingers are, and tools that hang from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from core.design import RIGID_MOUNT, Tool
from core.geometry import Array, Pose
from core.interfaces import Robot
from core.robot.description import beyond
from core.robot.extents import Finger, fingers_of
from core.robot.kinematics import link_poses, open_mounts
from core.robot.solids import Solid, robot_solids
from plugins.vlms.offline.heads import Head, Piece
from plugins.vlms.offline.layout import Layout
from plugins.vlms.offline.shafts import HEAD_COLOR, Builder

_SLEEVE_M = (0.024, 0.022, 0.028)  # it covers a fingertip,
_OVERLAP_M = 0.006  # by so much
_ROOM_M = 0.003  # between a body and each open finger
_PRESSED = 0.4  # of its force loads a finger: what it closes on gives no full blow


@dataclass(frozen=True, eq=False)
class Hand:
    """A gripper with its fingers open, in the frame of the tool mount.

    Attributes:
        tips: the middle between the fingertips; y goes from one to the other.
        palm: how far the palm is above them, metres.
        widest: how wide a body can be that bare fingers come down beside, metres.
        press: the load on each finger that closes on a body, newtons.
        solids: its own, and those of what bears it.
    """

    tips: Pose
    palm: float
    widest: float
    press: float
    solids: Sequence[Solid]


@lru_cache(maxsize=8)
def hand_of(robot: Robot) -> Hand:
    """Measure the hand of an arm that has one."""
    fingers = fingers_of(robot)
    left, right = (_find_tip(finger) for finger in fingers)
    x, y, _ = right - left
    tips = Pose.xyz_rpy((left + right) / 2, (0.0, 0.0, np.arctan2(-x, y)))

    root = fingers[0].place(-fingers[0].tip)
    widest = 2 * (robot.opening_m - _ROOM_M)
    assert robot.gripper is not None
    press = _PRESSED * robot.gripper.force_n
    return Hand(tips, float((root - left)[2]), widest, press, _list_solids(robot))


def _find_tip(finger: Finger) -> Array:
    """Find the middle of a finger's end in the frame of the tool mount, (3,)."""
    along = np.abs(finger.tip)
    middle = np.mean(finger.extent, axis=0) * (1 - along)
    return finger.pose.apply(middle + along * finger.face(finger.tip))


def _list_solids(robot: Robot) -> list[Solid]:
    """List the solids of the links that the arm's last joint moves, in the frame of the tool mount."""
    names = beyond(robot, Tool(gripper=True))
    poses = link_poses(robot, True, np.array(robot.home))
    mount = poses[RIGID_MOUNT].inverse()
    return [
        replace(solid, pose=mount @ poses[solid.name] @ solid.pose)
        for solid in robot_solids(robot, True)
        if solid.name in names
    ]


def build_fingers(
    head: Head, mount: Pose, load: float, layout: Layout, name: str
) -> Tool:
    """Build attachments to the fingers: on each a sleeve, bars, and the pieces of the head on its side.

    Args:
        head: its working end.
        mount: the head's pose in the frame of the tool mount.
        load: that it bears, newtons.
        layout: has the hand, and the material.
        name: of the way of using it.
    """
    robot = layout.robot
    load = max(load, hand_of(robot).press)
    builder = Builder(open_mounts(robot, True), load, layout.material)
    for finger in fingers_of(robot):
        opens = finger.pose.rotation.apply(finger.opens)
        for piece in head.pieces:
            side = mount.apply(piece.pose.position) - mount.position
            if side @ opens > 0:  # wherever the head is, one pad hangs from each
                _add_finger(builder, finger, piece, head, mount)

    text = f"{head.text} on long fingers"
    return Tool(tuple(builder.components), True, name=name, description=text)


def _add_finger(
    builder: Builder,
    finger: Finger,
    piece: Piece,
    head: Head,
    mount: Pose,
) -> None:
    """Add a sleeve around a fingertip, bars to above a piece, and the piece; see `build_fingers`."""
    x, y, _ = piece.pose.position
    end = mount.apply([x, y, head.attach[2]])
    tip = _find_tip(finger)
    foot = tip + np.array([0.0, 0.0, _OVERLAP_M - _SLEEVE_M[2]])
    middle = tip + np.array([0.0, 0.0, _OVERLAP_M - _SLEEVE_M[2] / 2])
    pad = mount @ piece.pose

    bearer = builder.add(f"{finger.name}_sleeve", finger.name, Pose(middle), _SLEEVE_M)
    bearer = builder.add_bars(
        f"{finger.name}_bar", bearer, "gantry", foot, end, tip=pad.position
    )
    builder.add(piece.name, bearer, pad, piece.shape.size, HEAD_COLOR)
