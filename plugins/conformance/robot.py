"""Check the arm and the hand: they follow, hold, yield to forces, and pass through nothing."""

from __future__ import annotations

import numpy as np

from core.design import Tool
from core.geometry import Box, Vector
from core.interfaces import Simulator
from core.scene import Body, table
from plugins.conformance.robots import follow, hold
from plugins.conformance.scenery import box, cube, make_body, stick
from plugins.conformance.shared import between, near
from plugins.conformance.worlds import (
    BARE,
    HAND,
    arm,
    end,
    film,
    move,
    opened,
    still,
    wait,
)

_WALL = make_body("wall", Box((0.4, 0.006, 0.4)), (0.5, 0.193, 0.2))


PUSHES: list[tuple[str, Body, float, list[list[float]], Vector, float]] = [
    # a stick's way in words, what stops it, its length, waypoints, its direction, and where along that its tip stops
    (
        "down at the table",
        table(),
        0.3,
        [[0.5, 0, 0.32, 0, 0, 0], [0.5, 0, 0.25, 0, 0, 0]],
        (0, 0, -1),
        0.0,
    ),
    (
        "at a thin wall",
        _WALL,
        0.25,
        [[0.5, -0.1, 0.4, 0, 0, 0], [0.5, 0.35, 0.4, 0, 0, 0]],
        (0, 1, 0),
        0.18,
    ),
]


def check_tool_stops_at_what_it_is_pushed_at(simulator: Simulator) -> None:
    for where, body, length, plan, way, face in PUSHES:
        outcome = move(simulator, plan, body, tool=stick(length), record_hz=100)
        tips = np.array(
            [
                arm().forward(joints).apply([0.0, 0.0, -length])
                for joints in film(outcome).arm
            ]
        )
        deep = (tips @ way - face).max()
        between(
            f"how far a stick gets into what it is pushed at, {where}, m",
            deep,
            -0.005,
            0.01,
        )
        between(
            "the tracking error of an arm that is stopped, rad",
            outcome.tracking_error_rad,
            0.01,
        )


def check_tool_touches_the_arm(simulator: Simulator) -> None:
    """A box inside the second link pushes the arm."""
    inside = arm().forward(still().arm[0]).inverse().apply([0.0, 0.0, 0.4])
    bar = Tool((box("bar", (0.05, 0.05, 0.05), inside),))
    pushed = wait(simulator, seconds=0.5, tool=bar)
    between(
        "the tracking error with a tool inside the arm's second link, rad",
        pushed.tracking_error_rad,
        0.01,
    )


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
    plan = [
        [0.5, 0, 0.2, 0, 0, 0.6],
        [0.5, 0, 0.2, 0, 0, 0.0],
        [0.5, 0, 0.2, 0, 0, -0.6],
    ]
    block = make_body("block", Box((0.08, 0.08, 0.1)), (0.76, -0.06, 0.05), mass=20.0)
    outcome = move(simulator, plan, table(), block, tool=tool)
    near(
        "where the last joint pushes a block of 20 kg, m",
        end(outcome).position("block"),
        block.pose.position,
        0.01,
    )
    between(
        "the tracking error of an arm that a block stops, rad",
        outcome.tracking_error_rad,
        0.1,
    )


def check_fingers_reach_their_targets(simulator: Simulator) -> None:
    for grip in (0.0, 0.5, 1.0):
        fingers = film(
            move(simulator, [[0.5, 0, 0.5, 0, 0, 0, grip]], tool=HAND, record_hz=10)
        ).fingers
        near("where the fingers begin, m", fingers[0], opened(), 1e-3)
        near(
            f"where the fingers are at grip {grip}, m",
            fingers[-1],
            opened() * (1 - grip),
            1e-3,
        )


_OVER = 0.1034 + 0.02  # metres from the hand's origin to the middle of a held object


def _lifts() -> list[tuple[Body, Tool, float, float, float]]:
    """Cubes, tools, heights at which the fingers close, and where the cubes are lifted, at least and at most, m.

    Twice 70 N at a friction of sqrt(1.0 * 0.5) hold 10 kg. The inner faces of the attachments are 5 mm from the middle
    when the fingers are closed.
    """
    light, heavy, heavier = (
        cube(at=(0.5, 0, 0.02), side=0.04, mass=mass) for mass in (0.2, 4.0, 16.0)
    )
    wide = cube(at=(0.5, 0, 0.025), side=0.05, mass=0.3)
    size = (0.03, 0.006, 0.16)
    left = box("left", size, (0.0, 0.008, 0.11), "left_finger")
    right = box("right", size, (0.0, -0.008, 0.11), "right_finger")
    attached = Tool((left, right), gripper=True)
    return [
        (light, HAND, _OVER, 0.21, 0.23),
        (heavy, HAND, _OVER, 0.18, 0.23),
        (heavier, HAND, _OVER, 0.0, 0.04),
        (wide, attached, 0.2534, 0.2, 0.25),
    ]


def check_gripper_lifts_what_it_can(simulator: Simulator) -> None:
    """The fingers close around a cube, go up by 0.2 m, and hold it for 2 s."""
    for body, tool, over, low, high in _lifts():
        plan = [[0.5, 0, over, 0, 0, 0, grip] for grip in (0, 1)]
        plan.append([0.5, 0, over + 0.2, 0, 0, 0, 1])
        recording = film(
            move(simulator, plan, table(), body, tool=tool, record_hz=20, hold_s=2.0)
        )
        heights = recording.states.position("cube")[
            recording.times > recording.times[-1] - 2.0, 2
        ]
        what = f"the heights of a cube of {body.mass} kg that the gripper lifts, m"
        near(what, heights, (low + high) / 2, (high - low) / 2)
