"""Check the arm and the hand: they follow, hold, yield to forces, and pass through nothing."""

from __future__ import annotations

import numpy as np

from core.design import RIGID_MOUNT, Component, Tool
from core.geometry import Array, Box, Cylinder, Pose
from core.interfaces import Outcome, Simulator
from core.scene import Body, table
from plugins.conformance.checking import expect
from plugins.conformance.robots import follow, hold
from plugins.conformance.worlds import (
    BARE,
    GREY,
    HAND,
    arm,
    cube,
    end,
    film,
    move,
    opened,
    stick,
    still,
    turn,
    wait,
)

_THROUGH = 0.003  # metres of penetration that an engine's contacts may allow


def _lowest(tool: Tool, joints: Array) -> float:
    """Height of the lowest corner of a rigid tool over joints (T, 7), metres."""
    placed = tool.placed()
    corners = np.concatenate([placed[c.name][1].apply(c.shape.to_trimesh().vertices) for c in tool.components])
    return min(float(arm().forward(q).apply(corners)[:, 2].min()) for q in joints)


def _tip(joints: Array, length: float) -> Array:
    """World positions (T, 3) of the lower end of a tool of this length, over joints (T, 7)."""
    return np.array([arm().forward(q).apply((0.0, 0.0, -length)) for q in joints])


def check_tool_stops_at_the_table(simulator: Simulator) -> None:
    """A stick at two places, and a thin blade on a shaft."""
    blade = Component("blade", "stick", Pose(np.array([0.05, 0.0, -0.14])), Box((0.15, 0.1, 0.003)))
    bladed = Tool((*stick(0.28).components, blade))
    for tool, x, y, below in ((stick(0.3), 0.5, 0.0, 0.25), (stick(0.3), 0.6, 0.2, 0.25), (bladed, 0.5, 0.0, 0.23)):
        outcome = move(simulator, [[x, y, 0.32, 0, 0, 0], [x, y, below, 0, 0, 0]], table(), tool=tool, record_hz=100)
        joints = film(outcome).arm
        deepest, last, lag = _lowest(tool, joints), _lowest(tool, joints[-1:]), outcome.tracking_error_rad
        expect(deepest > -_THROUGH, f"a tool was pushed {-1000 * deepest:.1f} mm into the table")
        expect(last < 0.005, f"a tool that was to press on the table ended {1000 * last:.1f} mm above it")
        expect(lag > 0.01, f"the table keeps the arm from its targets, but the tracking error is {lag:.4f} rad")


def check_body_is_not_pushed_through_the_table(simulator: Simulator) -> None:
    plan = [[0.5, 0, 0.45, 0, 0, 0], [0.5, 0, 0.3, 0, 0, 0]]
    outcome = move(simulator, plan, table(), cube(at=(0.5, 0, 0.05)), tool=stick(0.3), record_hz=100)
    lowest = film(outcome).states.position("cube")[:, 2].min()
    expect(lowest > 0.05 - _THROUGH, f"a cube under the tool was pushed {1000 * (0.05 - lowest):.1f} mm into the table")


def check_tool_stops_at_a_wall(simulator: Simulator) -> None:
    wall = Body.of("wall", Box((0.4, 0.02, 0.4)), (0.5, 0.2, 0.2), mass=0.0, color=GREY)
    plan = [[0.5, -0.1, 0.4, 0, 0, 0], [0.5, 0.35, 0.4, 0, 0, 0]]
    joints = film(move(simulator, plan, wall, tool=stick(0.25), record_hz=100)).arm
    tips = _tip(joints, 0.25)[:, 1]
    expect(tips.min() < -0.08, "the tool did not come to where its sweep begins")
    into = tips.max() - (0.2 - 0.02)  # half the wall and half the stick
    expect(into > -0.005, f"the tool stopped {-1000 * into:.0f} mm before the wall")
    expect(into < 0.01, f"a tool swept at a wall 0.02 m thick came {1000 * into:.0f} mm into it")


def check_leaning_tool_stops_at_a_thin_wall(simulator: Simulator) -> None:
    """A rod pushed at an angle against a low wall 6 mm thick may get over its edge, but never through the wall."""
    half, inner = 0.006, 0.13
    rod = Component("rod", RIGID_MOUNT, Pose(np.array([0.0, 0.0, -0.15])), Box((2 * half, 2 * half, 0.3)))
    wall = Body.of("wall", Box((0.5, 0.006, 0.1)), (0.55, inner + 0.003, 0.055), mass=0.0, color=GREY)
    for angle in (1.2, 1.7, 2.0, 2.2):
        way = (inner + 0.1) / np.sin(angle)
        x, y = 0.55 + way * np.cos(angle), way * np.sin(angle)
        plan = [[0.55, 0, 0.66, 0, 0, 0], [0.55, 0, 0.36, 0, 0, 0], [x, y, 0.36, 0, 0, 0]]
        joints = film(move(simulator, plan, wall, tool=Tool((rod,)), record_hz=100)).arm
        tips = _tip(joints, 0.3)
        low = tips[:, 2] < 0.09
        entered = int(np.argmax(low))
        climbed = np.flatnonzero(~low[entered:])
        inside = tips[entered : entered + climbed[0] if len(climbed) else len(tips)]
        into = inside[:, 1].max() + half - inner
        expect(into > -0.02, "the rod never met the wall")
        expect(into < 0.006, f"a rod pushed at a wall 6 mm thick came {1000 * into:.0f} mm beyond its face")


def check_body_pushed_off_centre_turns(simulator: Simulator) -> None:
    """A cube pushed slowly beside its middle turns as it slides, since friction in a slide has less left for the turn.

    The turn lies between those of a load distributed evenly under the cube and of one at its corners. For both see
    I. Kao, K. Lynch and J. Burdick, "Contact Modeling and Manipulation", Springer Handbook of Robotics (2016), on
    ellipsoidal limit surfaces.
    """
    side, beside, way = 0.1, 0.03, 0.04
    edge_on = Pose.xyz_rpy((0, 0, -0.15), (0, 0, np.pi / 4))
    finger = Component("finger", RIGID_MOUNT, edge_on, Box((0.01, 0.01, 0.3)))
    at = np.array([0.55, 0.0, side / 2])
    back = at[0] - side / 2 - 0.01 / np.sqrt(2)
    plan = [[back - 0.03, beside, 0.35, 0, 0, 0], [back, beside, 0.35, 0, 0, 0], [back + way, beside, 0.35, 0, 0, 0]]
    body = cube(at=tuple(at), side=side)
    outcome = move(simulator, plan, table(), body, tool=Tool((finger,)))
    turned = turn(end(outcome).pose("cube"), body.pose)
    levers = 0.707 * side, 0.383 * side  # of friction about the middle: of the corners, and on the mean of the square
    low, high = (way * beside / (beside**2 + lever**2) for lever in levers)
    found = f"a cube of {side} m, pushed {way} m at a place {beside} m beside its middle, turned {turned:.3f} rad"
    expect(0.8 * low < turned < 1.1 * high, f"{found}; friction lets it turn {low:.3f} to {high:.3f} rad")


def check_tool_touches_the_arm_but_not_its_mount(simulator: Simulator) -> None:
    """A box around the flange has no effect; one inside the second link pushes the arm."""
    around = Tool((Component("box", RIGID_MOUNT, Pose(), Box((0.05, 0.05, 0.05))),))
    lag = wait(simulator, seconds=0.5, tool=around).tracking_error_rad
    expect(lag < 2e-3, f"a box around the flange puts the arm at rest {lag:.4f} rad off its targets; at most 0.002")
    inside = arm().forward(still().arm[0]).inverse().apply([0.0, 0.0, 0.4])
    bar = Tool((Component("bar", RIGID_MOUNT, Pose(inside), Box((0.05, 0.05, 0.05))),))
    lag = wait(simulator, seconds=0.5, tool=bar).tracking_error_rad
    found = f"the arm is {lag:.4f} rad off its targets"
    expect(lag > 0.01, f"a tool inside the arm's second link should push it away; {found}")


def check_joints_hold_against_gravity(simulator: Simulator) -> None:
    for name, tool in (("nothing", BARE), ("the hand", HAND), ("a stick of 1 kg", stick(0.3, mass=1.0))):
        hold(simulator, arm().robot, tool, f"the arm with {name} mounted")


def check_arm_follows_its_trajectory(simulator: Simulator) -> None:
    follow(simulator, arm().robot)


def check_joint_torques_are_limited(simulator: Simulator) -> None:
    """A bar of 0.3 m on the last joint (12 Nm) pushes a block with 40 N at most."""
    bar = Component("bar", RIGID_MOUNT, Pose(np.array([0.15, 0.0, -0.15])), Box((0.3, 0.02, 0.02)))
    post = Component("post", RIGID_MOUNT, Pose(np.array([0.0, 0.0, -0.07])), Box((0.02, 0.02, 0.14)))
    plan = [[0.5, 0, 0.2, 0, 0, 0.6], [0.5, 0, 0.2, 0, 0, 0.0], [0.5, 0, 0.2, 0, 0, -0.6]]
    for mass, has, low, high in ((3.0, "the", 0.05, np.inf), (20.0, "no", 0.0, 0.01)):  # friction: 15 N, and 98 N
        block = Body.of("block", Box((0.08, 0.08, 0.1)), (0.76, -0.06, 0.05), mass=mass, color=GREY)
        outcome = move(simulator, plan, table(), block, tool=Tool((post, bar)))
        way = float(np.linalg.norm(end(outcome).position("block")[:2] - [0.76, -0.06]))
        found = f"the last joint has {has} torque to push a block of {mass} kg; it went {way:.3f} m"
        expect(low <= way < high, found)


def check_fingers_reach_their_targets(simulator: Simulator) -> None:
    for grip in (0.0, 0.5, 1.0):
        fingers = film(move(simulator, [[0.5, 0, 0.5, 0, 0, 0, grip]], tool=HAND, record_hz=10)).fingers
        begin = np.abs(fingers[0] - opened()).max()
        expect(begin < 1e-3, f"the fingers begin {1000 * begin:.1f} mm from open")
        miss = np.abs(fingers[-1] - opened() * (1 - grip)).max()
        expect(miss < 1e-3, f"at grip {grip} the fingers are {1000 * miss:.1f} mm from where they should be")


_OVER = 0.1034 + 0.02  # metres from the hand's origin to the middle of a held object


def _lift(
    simulator: Simulator, held: Body, over: float, high: float, *then: list[float], tool: Tool = HAND, hold: float = 0.5
) -> Outcome:
    """Close the fingers around a body when their link is at ``over``, and lift it so that the link is at ``high``."""
    plan = [[0.5, 0, z, 0, 0, 0, grip] for z, grip in ((over, 0), (over, 1), (high, 1))]
    return move(simulator, [*plan, *then], table(), held, tool=tool, record_hz=20, hold_s=hold)


def check_gripper_lifts_a_cube(simulator: Simulator) -> None:
    held = cube(at=(0.5, 0, 0.02), side=0.04, mass=0.2)
    outcome = _lift(simulator, held, _OVER, 0.4, hold=2.0)
    height, due = end(outcome).position("cube")[2], 0.4 - _OVER + 0.02
    expect(abs(height - due) < 0.01, f"a gripped cube should have been lifted to {due:.3f} m; it is at {height:.3f} m")
    gap = np.abs(film(outcome).fingers[-1] - 0.02).max()
    expect(gap < 2e-3, f"fingers that hold a cube of 0.04 m should be 0.02 m from the middle; {1000 * gap:.1f} mm off")
    dropped = _lift(simulator, held, _OVER, 0.4, [0.5, 0, 0.4, 0, 0, 0, 0], hold=2.0)
    height = end(dropped).position("cube")[2]
    expect(abs(height - 0.02) < 1e-3, f"a cube let go should lie on the table at 0.02 m; it is at {height:.3f} m")


def check_attachments_hold_a_cube(simulator: Simulator) -> None:
    """Two bars pick up a cube that the bare fingers can't reach, and hold it in the air for 2 s.

    Their inner faces are 5 mm from the middle when the fingers are closed.
    """
    bars = (
        Component(f"bar_{side}", f"{side}_finger", Pose(np.array([0.0, y, 0.11])), Box((0.03, 0.006, 0.16)))
        for side, y in (("left", 0.008), ("right", -0.008))
    )
    over, held = 0.0584 + 0.19 + 0.005, cube(at=(0.5, 0, 0.025), side=0.05, mass=0.3)
    recording = film(_lift(simulator, held, over, over + 0.2, tool=Tool(tuple(bars), gripper=True), hold=2.0))
    heights = recording.states.position("cube")[:, 2][recording.times > recording.times[-1] - 2.0]
    lowest, crept = heights.min(), 1000 * float(np.ptp(heights))
    expect(lowest > 0.2, f"a cube between two attachments was lifted to 0.225 m; it sank to {lowest:.3f} m")
    expect(crept < 3, f"a cube held between two attachments crept by {crept:.1f} mm in 2 s")


def check_gripper_lifts_a_light_disc(simulator: Simulator) -> None:
    """A disc of 20 g between fingers that press with 70 N each neither shoots out nor sinks in."""
    disc = Body.of("disc", Cylinder(0.03, 0.014), (0.5, 0.0, 0.007), mass=0.02, color=GREY)
    outcome = _lift(simulator, disc, 0.1034 - 0.009 + 0.007, 0.3)
    height, apart = end(outcome).position("disc")[2], float(film(outcome).fingers[-1].sum())
    expect(height > 0.15, f"a gripped disc of 20 g should have been lifted to 0.2 m; it is at {height:.3f} m")
    expect(abs(apart - 0.06) < 3e-3, f"fingers that hold a disc 0.06 m wide are {apart:.4f} m apart")


def check_gripper_squeezes_as_hard_as_the_hand_can(simulator: Simulator) -> None:
    """Twice 70 N at a friction of sqrt(1.0 * 0.5) hold 10 kg: 4 kg are lifted, 16 kg are not."""
    for mass, can, low, high in ((4.0, "can", 0.06, np.inf), (16.0, "can't", 0.0, 0.04)):
        outcome = _lift(simulator, cube(at=(0.5, 0, 0.02), side=0.04, mass=mass), _OVER, 0.2)
        height = end(outcome).position("cube")[2]
        expect(low < height < high, f"the hand {can} hold {mass} kg; after the lift the cube is at {height:.3f} m")
