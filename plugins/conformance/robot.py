"""Check the arm and the hand: they follow, hold, yield to forces, and pass through nothing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from core.design import RIGID_MOUNT, Component, Tool
from core.geometry import Array, Box, Cylinder, Pose
from core.interfaces import Simulator
from core.scene import Body, table
from plugins.conformance.checking import between, near
from plugins.conformance.robots import follow, hold
from plugins.conformance.worlds import (
    BARE,
    HAND,
    arm,
    box,
    cube,
    end,
    film,
    make_body,
    move,
    opened,
    stick,
    still,
    turn,
    wait,
)

_THROUGH = 0.003  # metres of penetration that an engine's contacts may allow


def _corners(tool: Tool, joints: Array) -> Array:
    """Where the corners of a rigid tool are over joints (T, J): (T, N, 3)."""
    placed = tool.placed()
    corners = [placed[part.name][1].apply(part.shape.to_trimesh().vertices) for part in tool.components]
    return np.array([arm().forward(each).apply(np.concatenate(corners)) for each in joints])


def check_tool_stops_at_the_table(simulator: Simulator) -> None:
    """A stick at two places, and a thin blade on a shaft."""
    bladed = Tool((*stick(0.28).components, box("blade", (0.15, 0.1, 0.003), (0.05, 0.0, -0.14), "stick")))
    for tool, x, y, below in ((stick(0.3), 0.5, 0.0, 0.25), (stick(0.3), 0.6, 0.2, 0.25), (bladed, 0.5, 0.0, 0.23)):
        plan = [[x, y, 0.32, 0, 0, 0], [x, y, below, 0, 0, 0]]
        outcome = move(simulator, plan, table(), tool=tool, record_hz=100)
        lowest = _corners(tool, film(outcome).arm)[..., 2].min(axis=1)
        between("the lowest height of a tool that is pushed at the table, m", lowest.min(), -_THROUGH)
        between("the height at which a tool ends that presses on the table, m", lowest[-1], high=0.005)
        between("the tracking error of an arm that the table stops, rad", outcome.tracking_error_rad, 0.01)


def check_tool_stops_at_a_wall(simulator: Simulator) -> None:
    wall = make_body("wall", Box((0.4, 0.006, 0.4)), (0.5, 0.193, 0.2))
    plan = [[0.5, -0.1, 0.4, 0, 0, 0], [0.5, 0.35, 0.4, 0, 0, 0]]
    joints = film(move(simulator, plan, wall, tool=stick(0.25), record_hz=100)).arm
    tips = np.array([arm().forward(each).apply((0.0, 0.0, -0.25))[1] for each in joints])
    between("where a sweep begins, y in m", tips.min(), high=-0.08)
    between("how far a tool that is swept at a wall 6 mm thick gets into it, m", tips.max() - 0.18, -0.005, 0.01)


def check_body_pushed_off_centre_turns(simulator: Simulator) -> None:
    """A cube pushed slowly beside its middle turns as it slides, since friction in a slide has less left for the turn.

    The turn lies between those of a load distributed evenly under the cube and of one at its corners. For both see
    I. Kao, K. Lynch and J. Burdick, "Contact Modeling and Manipulation", Springer Handbook of Robotics (2016), on
    ellipsoidal limit surfaces.
    """
    side, beside, way = 0.1, 0.03, 0.04
    edge_on = Pose.xyz_rpy((0, 0, -0.15), (0, 0, np.pi / 4))
    finger = Component("finger", RIGID_MOUNT, edge_on, Box((0.01, 0.01, 0.3)))
    body = cube(at=(0.55, 0.0, side / 2), side=side)
    back = 0.55 - side / 2 - 0.01 / np.sqrt(2)
    plan = [[back - 0.03, beside, 0.35, 0, 0, 0], [back, beside, 0.35, 0, 0, 0], [back + way, beside, 0.35, 0, 0, 0]]
    outcome = move(simulator, plan, table(), body, tool=Tool((finger,)))
    # Levers of friction about the middle: of the corners, and on the mean of the square.
    low, high = (way * beside / (beside**2 + (share * side) ** 2) for share in (0.707, 0.383))
    turned = turn(end(outcome).pose("cube"), body.pose)
    between("the turn of a cube that is pushed 0.04 m beside its middle, rad", turned, 0.8 * low, 1.1 * high)


def check_tool_touches_the_arm_but_not_its_mount(simulator: Simulator) -> None:
    """A box around the flange has no effect; one inside the second link pushes the arm."""
    size = (0.05, 0.05, 0.05)
    inside = arm().forward(still().arm[0]).inverse().apply([0.0, 0.0, 0.4])
    around = wait(simulator, seconds=0.5, tool=Tool((box("box", size, (0.0, 0.0, 0.0)),)))
    between("the tracking error at rest with a box around the flange, rad", around.tracking_error_rad, high=2e-3)
    pushed = wait(simulator, seconds=0.5, tool=Tool((box("bar", size, inside),)))
    between("the tracking error with a tool inside the arm's second link, rad", pushed.tracking_error_rad, 0.01)


def check_joints_hold_against_gravity(simulator: Simulator) -> None:
    for name, tool in (("nothing", BARE), ("the hand", HAND), ("a stick of 1 kg", stick(0.3, mass=1.0))):
        hold(simulator, arm().robot, tool, f"the arm with {name} mounted")


def check_arm_follows_its_trajectory(simulator: Simulator) -> None:
    follow(simulator, arm().robot)


def check_joint_torques_are_limited(simulator: Simulator) -> None:
    """A bar of 0.3 m on the last joint (12 Nm) pushes a block with 40 N at most; friction takes 15 N, and 98 N."""
    post = box("post", (0.02, 0.02, 0.14), (0.0, 0.0, -0.07))
    tool = Tool((post, box("bar", (0.3, 0.02, 0.02), (0.15, 0.0, -0.15))))
    plan = [[0.5, 0, 0.2, 0, 0, 0.6], [0.5, 0, 0.2, 0, 0, 0.0], [0.5, 0, 0.2, 0, 0, -0.6]]
    for mass, low, high in ((3.0, 0.05, 1.0), (20.0, 0.0, 0.01)):
        block = make_body("block", Box((0.08, 0.08, 0.1)), (0.76, -0.06, 0.05), mass=mass)
        place = end(move(simulator, plan, table(), block, tool=tool)).position("block")
        way = float(np.linalg.norm((place - block.pose.position)[:2]))
        between(f"how far the last joint pushes a block of {mass} kg, m", way, low, high)


def check_fingers_reach_their_targets(simulator: Simulator) -> None:
    for grip in (0.0, 0.5, 1.0):
        fingers = film(move(simulator, [[0.5, 0, 0.5, 0, 0, 0, grip]], tool=HAND, record_hz=10)).fingers
        near("where the fingers begin, m", fingers[0], opened(), 1e-3)
        near(f"where the fingers are at grip {grip}, m", fingers[-1], opened() * (1 - grip), 1e-3)


@dataclass(frozen=True)
class Lift:
    """The fingers close around a body, lift it, and hold it for 2 s.

    Attributes:
        what: is lifted, in words.
        body: stands on the table at x = 0.5 m.
        over: the height of the fingers' link at which they close, m.
        up: how far they are lifted, m.
        low, high: between which heights the body is in the last 2 s, m.
        apart: the sum of the fingers' places, m.
        tool: that holds it.
        creep: how far it may creep in 2 s, m.
    """

    what: str
    body: Body
    over: float
    up: float
    low: float
    high: float
    apart: float
    tool: Tool = HAND
    creep: float = 3e-3


_OVER = 0.1034 + 0.02  # metres from the hand's origin to the middle of a held object


def _lifts() -> list[Lift]:
    """The heavy ones: twice 70 N at a friction of sqrt(1.0 * 0.5) hold 10 kg.

    The inner faces of the attachments are 5 mm from the middle when the fingers are closed.
    """
    light, heavy, heavier = (cube(at=(0.5, 0, 0.02), side=0.04, mass=mass) for mass in (0.2, 4.0, 16.0))
    disc = make_body("cube", Cylinder(0.03, 0.014), (0.5, 0.0, 0.007), mass=0.02)
    wide = cube(at=(0.5, 0, 0.025), side=0.05, mass=0.3)
    size = (0.03, 0.006, 0.16)
    left = box("left", size, (0.0, 0.008, 0.11), "left_finger")
    right = box("right", size, (0.0, -0.008, 0.11), "right_finger")
    return [
        Lift("a cube of 0.2 kg", light, _OVER, 0.28, 0.29, 0.31, 0.04),
        Lift("a disc of 20 g", disc, 0.1034 - 0.002, 0.2, 0.15, 0.25, 0.06),
        Lift("a cube of 4 kg", heavy, _OVER, 0.08, 0.06, 0.2, 0.04, creep=0.02),
        Lift("a cube of 16 kg, too heavy for the hand,", heavier, _OVER, 0.08, 0.0, 0.04, 0.04),
        Lift("a cube between attachments", wide, 0.2534, 0.2, 0.2, 0.25, 0.04, Tool((left, right), gripper=True)),
    ]


def check_gripper_lifts_what_it_can(simulator: Simulator) -> None:
    for lift in _lifts():
        plan = [[0.5, 0, lift.over, 0, 0, 0, grip] for grip in (0, 1)]
        plan.append([0.5, 0, lift.over + lift.up, 0, 0, 0, 1])
        outcome = move(simulator, plan, table(), lift.body, tool=lift.tool, record_hz=20, hold_s=2.0)
        recording = film(outcome)
        heights = recording.states.position("cube")[recording.times > recording.times[-1] - 2.0, 2]
        between(f"the lowest height of {lift.what} that is held for 2 s, m", heights.min(), lift.low)
        between(f"the highest height of {lift.what} that is held for 2 s, m", heights.max(), high=lift.high)
        if lift.low:
            near(f"how much {lift.what} creeps in 2 s, m", np.ptp(heights), 0.0, lift.creep)
            near(
                f"how far apart the fingers are that hold {lift.what}, m", recording.fingers[-1].sum(), lift.apart, 4e-3
            )
