"""Check bodies: they fall, slide, roll, bounce, topple and come to rest."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import trimesh
from scipy.integrate import solve_ivp

from core.geometry import Box, Capsule, Cylinder, Mesh, Shape, Sphere
from core.interfaces import Simulator
from core.scene import Body, Geom, table
from plugins.conformance.checking import expect
from plugins.conformance.worlds import GRAVITY, GREY, compound, cube, end, film, part, slope, start, turn, wait


def check_free_fall(simulator: Simulator) -> None:
    state = end(wait(simulator, cube(at=(3, 3, 5)), seconds=0.5))
    x, y, z = state.position("cube")
    speed, due = -state.linear_velocity("cube")[2], GRAVITY * 0.5
    expect(abs(speed - due) < 1e-4 * due, f"after 0.5 s of free fall the speed is {speed:.5f} m/s instead of {due:.5f}")
    drop, due = 5 - z, GRAVITY * 0.5**2 / 2
    expect(abs(drop - due) < 0.02, f"after 0.5 s of free fall a body is {drop:.4f} m down instead of {due:.4f}")
    expect(max(abs(x - 3), abs(y - 3)) < 1e-6, "a falling body went sideways")


def check_friction_is_the_geometric_mean(simulator: Simulator) -> None:
    """A block stays on a slope 15 % below the friction angle, and slides as it must on one 15 % above it."""
    for one, other in ((0.5, 0.5), (0.1, 0.9), (1.0, 0.25)):
        mean = math.sqrt(one * other)
        for steepness in (0.85, 1.15):
            tilt = math.atan(steepness * mean)
            hill = slope(tilt, one)
            at = hill.pose.apply([0, 0, 0.05 + 0.02])
            size, rpy = Box((0.2, 0.2, 0.04)), (0.0, tilt, 0.0)
            block = Body.of("block", size, at, mass=1.0, color=GREY, rpy=rpy, friction=other)
            slid = float(np.linalg.norm(end(wait(simulator, hill, block)).position("block") - at))
            due = GRAVITY * (math.sin(tilt) - mean * math.cos(tilt)) / 2 if steepness > 1 else 0.0
            found = f"frictions {one} and {other}, a slope of {math.degrees(tilt):.1f} degrees: in one second a block "
            expect(abs(slid - due) < 5e-3 + 0.15 * due, found + f"slid {slid:.4f} m instead of {due:.4f} m")


def check_rolling_friction_is_an_arm(simulator: Simulator) -> None:
    """An arm of 0.01 m holds a ball of radius 0.1 m on a slope of up to a tenth, and slows it on a steeper one."""
    for steepness in (0.4, 3.0):
        tilt = math.atan(steepness * 0.01 / 0.1)
        hill = slope(tilt, 0.5)
        at = hill.pose.apply([0, 0, 0.05 + 0.1])
        ball = Body.of("ball", Sphere(0.1), at, mass=3.0, color=GREY, rolling_friction=0.01)
        rolled = float(np.linalg.norm(end(wait(simulator, hill, ball, seconds=1.2)).position("ball") - at))
        due = 5 / 7 * GRAVITY * (math.sin(tilt) - 0.1 * math.cos(tilt)) * 1.2**2 / 2 if steepness > 1 else 0.0
        found = f"an arm of 0.01 m, a slope of {tilt:.3f} rad: in 1.2 s a ball of radius 0.1 m rolled {rolled:.3f} m"
        expect(abs(rolled - due) < 0.02 + 0.05 * due, f"{found} instead of {due:.3f} m")


def check_round_bodies_roll_without_slipping(simulator: Simulator) -> None:
    """A ball, and a cylinder and a capsule that lie, roll down a slope as solid ones do; a block would slide."""
    upright, lying = (0.0, 0.0, 0.0), (math.pi / 2, 0.0, 0.0)
    for shape, radius, mass, rpy, tilt, share, most in (
        (Sphere(0.1), 0.1, 3.0, upright, 0.2, 5 / 7, 0.05),
        (Cylinder(0.06, 0.2), 0.06, 1.0, lying, 0.15, 2 / 3, 0.1),
        (Capsule(0.06, 0.2), 0.06, 1.0, lying, 0.15, 0.6796, 0.1),
    ):
        hill = slope(tilt, 1.0)
        at = hill.pose.apply([0, 0, 0.05 + radius])
        body = Body.of("body", shape, at, mass=mass, color=GREY, rpy=rpy, friction=1.0)
        rolled = float(np.linalg.norm(end(wait(simulator, hill, body)).position("body") - at))
        due = share * GRAVITY * math.sin(tilt) / 2
        expect(abs(rolled - due) < most * due, f"{shape} rolled {rolled:.4f} m down a slope instead of {due:.4f} m")


def check_ball_without_rolling_friction_keeps_rolling(simulator: Simulator) -> None:
    """A ball that rolls off a slope keeps its speed over a second on level ground."""
    ground = Body.of("ground", Box((6.0, 2.0, 0.1)), (3.0, 3.0, -0.05), mass=0.0, color=GREY)
    ramp = Body.of("ramp", Box((1.0, 1.0, 0.1)), (0.9, 3.0, 0.0), mass=0.0, color=GREY, rpy=(0, 0.2, 0))
    ball = Body.of("ball", Sphere(0.1), ramp.pose.apply([-0.3, 0, 0.15]), mass=1.0, color=GREY)
    recording = film(wait(simulator, ground, ramp, ball, seconds=2.5, record_hz=10))
    speeds = np.linalg.norm(recording.states.linear_velocity("ball"), axis=-1)[recording.times > 1.4]
    expect(speeds[0] > 1.0, f"the ball came down the ramp with {speeds[0]:.2f} m/s only")
    lost = 1 - speeds[-1] / speeds[0]
    expect(abs(lost) < 0.03, f"a ball without rolling friction lost {100 * lost:.0f} % of its speed on level ground")


def check_restitution(simulator: Simulator) -> None:
    """Dropped from 0.5 m a ball rises to (e1 * e2)^2 of the height: a contact has the product of both restitutions."""
    for e in (0.0, 0.8):
        plate = Body.of("plate", Box((1.0, 1.0, 0.1)), (3.0, 3.0, -0.05), mass=0.0, color=GREY)
        plate = replace(plate, restitution=0.8)
        ball = replace(Body.of("ball", Sphere(0.05), (3.0, 3.0, 0.55), mass=0.5, color=GREY), restitution=e)
        recording = film(wait(simulator, plate, ball, seconds=1.2, record_hz=200))
        heights = recording.states.position("ball")[:, 2] - 0.05
        struck = int(np.argmax(heights < 0.01))
        expect(struck > 0, "a dropped ball did not come down")
        rise, due = float(heights[struck:].max()), 0.5 * (0.8 * e) ** 2
        found = f"a ball with restitution {e}, dropped on a plate with 0.8, rose {rise:.3f} m instead of {due:.3f} m"
        expect(abs(rise - due) < 0.01 + 0.2 * due, found)


def _fall(lean: float, rate: float, seconds: float) -> float:
    """The lean of an inverted pendulum that starts at rest: lean'' = rate * sin(lean)."""
    way = solve_ivp(lambda _, s: [s[1], rate * math.sin(s[0])], (0, seconds), [lean, 0.0], rtol=1e-8)
    return float(way.y[0, -1])


def check_falling_bodies_turn_by_their_inertia(simulator: Simulator) -> None:
    """A body that falls over an edge without slipping turns as fast as its inertia lets it."""
    ground = Body.of("ground", Box((2.0, 2.0, 0.1)), (3.0, 3.0, -0.05), mass=0.0, color=GREY, friction=4.0)
    rod = (part(Box((0.04, 0.2, 0.8)), 0.0, 0.0, 0.4),)
    hammer = (part(Box((0.04, 0.2, 0.6)), 0.0, 0.0, 0.3), part(Box((0.2, 0.4, 0.2)), 0.0, 0.0, 0.7))
    for name, parts in (("rod", rod), ("hammer", hammer)):
        tilt = 0.35
        # Its lower right edge is on the ground, and it leans to the right, over it.
        corner = np.array([math.cos(tilt) * 0.02, 0.0, -math.sin(tilt) * 0.02])
        at = np.array([3.0, 3.0, 0.0]) - corner
        body = replace(compound(name, *parts, at=at, mass=2.0, rpy=(0.0, tilt, 0.0)), friction=4.0)
        inertia = body.inertia()
        lever = inertia.frame.position - [0.02, 0.0, 0.0]
        away = float(np.linalg.norm(lever))
        axes = inertia.frame.rotation.as_matrix()
        about_edge = float((axes @ np.diag(inertia.moments) @ axes.T)[1, 1]) + body.mass * away**2
        lean = tilt + math.atan2(lever[0], lever[2])
        rate = body.mass * GRAVITY * away / about_edge
        due = _fall(lean, rate, 0.4) - lean
        turned = turn(end(wait(simulator, ground, body, seconds=0.4)).pose(name), body.pose)
        found = f"in 0.4 s a {name} fell over by {turned:.3f} rad; its inertia lets it fall by {due:.3f} rad"
        expect(abs(turned - due) < 0.06 * due, found)


def check_hollow_body_is_hollow(simulator: Simulator) -> None:
    wall = 0.01
    parts = (
        part(Box((0.3, 0.3, wall)), 0, 0, wall / 2),
        *(part(Box((wall, 0.3, 0.2)), x, 0, 0.1) for x in (-0.145, 0.145)),
        *(part(Box((0.3, wall, 0.2)), 0, y, 0.1) for y in (-0.145, 0.145)),
    )
    ball = Body.of("ball", Sphere(0.03), (0.5, 0, 0.1), mass=0.1, color=GREY)
    for mass in (0.0, 0.5):
        state = end(wait(simulator, table(), compound("bin", *parts, at=(0.5, 0, 0), mass=mass), ball))
        x, y, z = state.position("ball")
        expect(abs(z - wall - 0.03) < 2e-3, f"a ball dropped into a bin is at {z:.4f} m instead of {wall + 0.03} m")
        expect(max(abs(x - 0.5), abs(y)) < 0.12, "a ball dropped into a bin is not in it")
        if mass:
            gap = np.abs(state.position("bin") - [0.5, 0, 0]).max()
            expect(gap < 1e-3, f"a bin on the table moved {1000 * gap:.1f} mm by itself")


def check_mesh_collides_as_its_convex_hull(simulator: Simulator) -> None:
    """A cube that falls on a trough, 0.1 high and open on top, rests on the hull's lid."""
    walls = [((0.3, 0.3, 0.02), (0, 0, 0.01)), *(((0.3, 0.02, 0.1), (0, y, 0.05)) for y in (-0.14, 0.14))]
    trough = trimesh.util.concatenate([Box(size).to_trimesh().apply_translation(at) for size, at in walls])
    body = compound("trough", Geom(Mesh.from_trimesh(trough)), at=(0.5, 0, 0), mass=1.0)
    state = end(wait(simulator, table(), body, cube(at=(0.5, 0, 0.17), side=0.1)))
    height = state.position("cube")[2]
    expect(abs(height - 0.15) < 3e-3, f"a cube on a mesh's hull is at {height:.4f} m instead of 0.15 m")
    gap = np.abs(state.position("trough") - [0.5, 0, 0]).max()
    expect(gap < 2e-3, f"a mesh on the table moved {1000 * gap:.1f} mm by itself")


def check_shapes_rest_where_they_are_put(simulator: Simulator) -> None:
    yaw, roll = (0.0, 0.0, 0.4), math.pi / 2
    put: list[tuple[Shape, float, tuple[float, float, float]]] = [
        (Box((0.1, 0.2, 0.06)), 0.03, yaw),
        (Cylinder(0.05, 0.1), 0.05, yaw),
        (Sphere(0.04), 0.04, yaw),
        (Capsule(0.03, 0.1), 0.03, (roll, 0.0, 0.0)),
        (Capsule(0.02, 0.1), 0.02, (roll, 0.0, 0.4)),
    ]
    for shape, height, rpy in put:
        lying = isinstance(shape, Capsule)
        body = Body.of("body", shape, (0.6, 0.1, height), mass=0.3, color=GREY, rpy=rpy)
        state = end(wait(simulator, table(), body, seconds=2.0))
        gap = np.abs(state.position("body") - [0.6, 0.1, height]).max()
        expect(gap < 1e-3, f"in 2 s {shape} on the table moved {1000 * gap:.2f} mm by itself")
        turned = turn(state.pose("body"), body.pose)
        expect(turned < (0.03 if lying else 0.01), f"in 2 s {shape} on the table turned {turned:.4f} rad by itself")


def check_stack_stands(simulator: Simulator) -> None:
    bricks = [cube(f"brick{i}", (0.6, 0, 0.03 + 0.06 * i), side=0.06, mass=0.4) for i in range(4)]
    state = end(wait(simulator, table(), *bricks, seconds=3.0))
    for brick in bricks:
        gap = np.abs(state.position(brick.name) - brick.pose.position).max()
        expect(gap < 2e-3, f"in a stack of four cubes one moved {1000 * gap:.1f} mm by itself in 3 s")
    speed = np.abs(state.linear_velocities).max()
    expect(speed < 0.01, f"a stack of four cubes is not at rest after 3 s: {speed:.4f} m/s")


L_SHAPE = part(Box((0.3, 0.1, 0.02)), 0.15, 0, 0.01), part(Box((0.02, 0.1, 0.2)), 0.01, 0, 0.12)  # its frame: a corner


def check_states_are_those_of_frames(simulator: Simulator) -> None:
    """A body's position is its frame's, not its centre of mass'."""
    for yaw in (0.0, 2.0):
        body = compound("L", *L_SHAPE, at=(0.6, 0.1, 0), mass=1.0, rpy=(0, 0, yaw))
        outcome = wait(simulator, table(), body, settle_s=0.1)
        for state in (start(outcome), end(outcome)):
            gap = np.abs(state.position("L") - [0.6, 0.1, 0]).max()
            expect(gap < 1e-3, f"the state of a body at rest is {1000 * gap:.1f} mm from where its frame was put")
            turned = turn(state.pose("L"), body.pose)
            expect(turned < 5e-3, f"the state of a body at rest is turned by {turned:.4f} rad from how it was put")


def check_velocities_are_those_of_the_frame(simulator: Simulator) -> None:
    """The velocities of a body that tumbles on an edge are the rates of its own poses."""
    edge = Body.of("edge", Box((0.1, 1.0, 0.1)), (3.0, 3.0, 0.0), mass=0.0, color=GREY)
    body = compound("L", *L_SHAPE, at=(3.02, 3, 0.1), mass=1.0)
    recording = film(wait(simulator, edge, body, seconds=0.5, record_hz=250))
    states, passed = recording.states, np.diff(recording.times)[:, None]
    rates = np.diff(states.position("L"), axis=0) / passed
    turns = [
        (b.rotation * a.rotation.inv()).as_rotvec()
        for a, b in ((states[i].pose("L"), states[i + 1].pose("L")) for i in range(len(rates)))
    ]
    speeds = (states.linear_velocity("L")[1:] + states.linear_velocity("L")[:-1]) / 2
    spins = (states.angular_velocities[1:, 0] + states.angular_velocities[:-1, 0]) / 2
    expect(np.abs(spins).max() > 1.0, "a body on an edge, off its balance, does not tumble")
    gap = np.median(np.abs(rates - speeds), axis=0).max()
    expect(gap < 0.03, f"a body's frame moves {gap:.3f} m/s otherwise than its linear velocity says")
    gap = np.median(np.abs(np.array(turns) / passed - spins), axis=0).max()
    expect(gap < 0.03, f"a body turns {gap:.3f} rad/s otherwise than its angular velocity says")


def check_tall_bodies_topple_and_flat_ones_do_not(simulator: Simulator) -> None:
    tilt = 0.3
    hill = slope(tilt, 2.0)
    # tan(0.3) is 0.31: a box 0.32 high would be at its limit.
    for height, due, low, high in ((0.25, "stand", 0.0, 0.02), (0.45, "topple", 0.5, math.inf)):
        at = hill.pose.apply([0, 0, 0.05 + height / 2])
        size, rpy = Box((0.1, 0.1, height)), (0.0, tilt, 0.0)
        body = Body.of("body", size, at, mass=1.0, color=GREY, rpy=rpy, friction=2.0)
        turned = turn(end(wait(simulator, hill, body, seconds=1.5)).pose("body"), body.pose)
        found = f"on a slope of 0.3 rad a box 0.1 wide and {height} high turned by {turned:.3f} rad"
        expect(low <= turned < high, f"{found}; it should {due}")
