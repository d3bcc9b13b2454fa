"""Check the arm and the hand: they follow, hold, yield to forces, and pass through nothing."""

from __future__ import annotations

from typing import Any

import numpy as np

from core.design import Tool
from core.geometry import Box
from core.interfaces import Simulator
from core.scene import table
from plugins.conformance.robots import follow, hold
from plugins.conformance.sample_tools import box, stick
from plugins.conformance.shared import between, near
from plugins.conformance.worlds import (
    BARE,
    HAND,
    arm,
    cube,
    make_body,
    motion,
    opened,
    still,
    watch,
)

_BRIEF: dict[str, Any] = {"settle_s": 0.1, "hold_s": 0.5}


def check_tool_stops_at_what_it_is_pushed_at(simulator: Simulator) -> None:
    wall = make_body("wall", Box((0.4, 0.006, 0.4)), (0.5, 0.193, 0.2))
    down = [[0.5, 0, 0.32, 0, 0, 0], [0.5, 0, 0.25, 0, 0, 0]]
    aside = [[0.5, -0.1, 0.4, 0, 0, 0], [0.5, 0.35, 0.4, 0, 0, 0]]
    for where, body, length, plan, direction, face in (
        ("down at the table", table(), 0.3, down, (0, 0, -1), 0.0),
        ("at a thin wall", wall, 0.25, aside, (0, 1, 0), 0.18),
    ):
        pushed = watch(simulator, body, tool=stick(length), way=motion(plan), **_BRIEF)
        tips = []
        for joints in pushed.recording.arm:
            tips.append(arm().forward(joints).apply([0.0, 0.0, -length]))

        deep = (np.array(tips) @ direction - face).max()
        between(f"how far a stick gets in, {where}, m", deep, -0.005, 0.01)
        lag = pushed.outcome.tracking_error_rad
        between("the tracking error of an arm that is stopped, rad", lag, 0.01)


def check_tool_touches_the_arm(simulator: Simulator) -> None:
    """A box inside the second link pushes the arm."""
    inside = arm().forward(still().arm[0]).inverse().apply([0.0, 0.0, 0.4])
    bar = Tool((box("bar", (0.05, 0.05, 0.05), inside),))
    lag = watch(simulator, tool=bar, hold_s=0.5).outcome.tracking_error_rad
    between("the tracking error with a tool inside the second link, rad", lag, 0.01)


def check_joints_hold_against_gravity(simulator: Simulator) -> None:
    for name, tool in (
        ("nothing", BARE),
        ("the hand", HAND),
        ("a stick of 1 kg", stick(0.3, mass=1.0)),
    ):
        hold(simulator, arm().robot, tool, f"the arm with {name} mounted")


def check_arm_follows_its_trajectory(simulator: Simulator) -> None:
    follow(simulator, arm().robot)


def check_joint_torques_are_limited(simulator: Simulator) -> None:
    """A bar of 0.3 m on the last joint (12 Nm) pushes a block with 40 N at most, which friction holds."""
    post = box("post", (0.02, 0.02, 0.14), (0.0, 0.0, -0.07))
    tool = Tool((post, box("bar", (0.3, 0.02, 0.02), (0.15, 0.0, -0.15))))
    way = motion([[0.5, 0, 0.2, 0, 0, yaw] for yaw in (0.6, 0.0, -0.6)])
    block = make_body("block", Box((0.08, 0.08, 0.1)), (0.76, -0.06, 0.05), 20.0)
    pushed = watch(simulator, table(), block, tool=tool, way=way, **_BRIEF)
    near(
        "how far the last joint pushes a block of 20 kg, m",
        pushed.moved("block"),
        0.0,
        0.01,
    )
    lag = pushed.outcome.tracking_error_rad
    between("the tracking error of an arm that a block stops, rad", lag, 0.1)


def check_fingers_reach_their_targets(simulator: Simulator) -> None:
    for grip in (0.0, 0.5, 1.0):
        way = motion([[0.5, 0, 0.5, 0, 0, 0, grip]])
        played = watch(simulator, tool=HAND, way=way, record_hz=10, **_BRIEF)
        first, *_, last = played.recording.fingers
        near("where the fingers begin, m", first, opened(), 1e-3)
        due = opened() * (1 - grip)
        near(f"where the fingers are at grip {grip}, m", last, due, 1e-3)


def check_gripper_lifts_what_it_can(simulator: Simulator) -> None:
    """The fingers close around a cube, go up by 0.2 m, and hold it for 2 s.

    Twice 70 N at a friction of sqrt(1.0 * 0.5) hold 10 kg. The inner faces of the attachments are 5 mm from the middle
    when the fingers are closed.
    """
    over = 0.1034 + 0.02  # m: from the hand's origin to the middle of a held object
    size = (0.03, 0.006, 0.16)
    left = box("left", size, (0.0, 0.008, 0.11), "left_finger")
    right = box("right", size, (0.0, -0.008, 0.11), "right_finger")
    attached = Tool((left, right), gripper=True)

    for mass, side, tool, closes, low, high in (
        (0.2, 0.04, HAND, over, 0.21, 0.23),
        (4.0, 0.04, HAND, over, 0.18, 0.23),
        (16.0, 0.04, HAND, over, 0.0, 0.04),
        (0.3, 0.05, attached, 0.2534, 0.2, 0.25),
    ):
        body = cube(at=(0.5, 0, side / 2), side=side, mass=mass)
        plan = [[0.5, 0, closes, 0, 0, 0, 0], [0.5, 0, closes, 0, 0, 0, 1]]
        way = motion([*plan, [0.5, 0, closes + 0.2, 0, 0, 0, 1]])
        lifted = watch(
            simulator, table(), body, tool=tool, way=way, settle_s=0.1, hold_s=2.0
        )
        heights = lifted.path("cube")[lifted.times > lifted.times[-1] - 2.0, 2]
        near(
            f"the heights of a cube of {mass} kg that the gripper lifts, m",
            heights,
            (low + high) / 2,
            (high - low) / 2,
        )
