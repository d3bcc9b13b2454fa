"""Check bodies: they fall, slide, roll, bounce, topple and come to rest."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import trimesh

from core.geometry import Box, Capsule, Cylinder, Mesh, Shape, Sphere, Vector
from core.interfaces import Simulator
from core.scene import Body, Scene, table
from plugins.conformance.cases import Case, compare, height, moved, moved_and_turned, play
from plugins.conformance.checking import near
from plugins.conformance.worlds import GRAVITY, compound, cube, make_body, part, slope, turn

LYING = (math.pi / 2, 0.0, 0.0)
L_SHAPE = (  # its frame is at a corner
    part(Box((0.3, 0.1, 0.02)), 0.15, 0, 0.01),
    part(Box((0.02, 0.1, 0.2)), 0.01, 0, 0.12),
)


def check_free_fall(simulator: Simulator) -> None:
    """The position after 0.5 s is that of an engine's steps, not much below g t^2 / 2; the speed is g t."""
    fallen = play(simulator, Scene((cube(at=(3, 3, 5)),)), 0.5).states
    speed = GRAVITY * 0.5
    due = (3, 3, 5 - speed * 0.5 / 2)
    near("where a cube is after 0.5 s of free fall, m", fallen.position("cube")[-1], due, (1e-6, 1e-6, 0.02))
    velocity = fallen.linear_velocity("cube")[-1]
    near("the velocity after 0.5 s of free fall, m/s", velocity, (0, 0, -speed), 1e-4 * speed)


def on_slope(
    shape: Shape,
    high: float,
    tilt: float,
    *,
    friction: float = 1.0,
    slope_friction: float = 1.0,
    rolling_friction: float = 0.0,
    rpy: Vector = (0.0, 0.0, 0.0),
) -> tuple[Body, Body]:
    """A slope, and ``body`` on it, whose middle is ``high`` above it."""
    hill = slope(tilt, slope_friction)
    at = hill.pose.apply([0, 0, 0.05 + high])
    more = {"friction": friction, "rolling_friction": rolling_friction}
    return hill, make_body("body", shape, at, mass=1.0, rpy=rpy, **more)


def way(acceleration: float, seconds: float = 1.0) -> float:
    """The way from rest, m; none where what brakes is stronger than what pulls."""
    return max(0.0, acceleration) * seconds**2 / 2


@compare
def check_friction_is_the_geometric_mean() -> Iterator[Case]:
    """A block slides if the slope is steeper than the geometric mean of both frictions: g (sin a - mean cos a)."""
    for one, other in ((0.5, 0.5), (0.1, 0.9), (1.0, 0.25)):
        mean = math.sqrt(one * other)
        for steepness in (0.85, 1.15):
            tilt = math.atan(steepness * mean)
            what = f"the way of a block in 1 s, frictions {one} and {other}, on a slope of {tilt:.3f} rad, m"
            block = Box((0.2, 0.2, 0.04))
            bodies = on_slope(block, 0.02, tilt, slope_friction=one, friction=other, rpy=(0.0, tilt, 0.0))
            due = way(GRAVITY * (math.sin(tilt) - mean * math.cos(tilt)))
            yield Case(what, bodies, moved("body"), due, 5e-3 + 0.15 * due)


@compare
def check_rolling_friction_is_an_arm() -> Iterator[Case]:
    """An arm of 0.01 m holds a ball of radius 0.1 m on a slope of up to a tenth, and slows it on a steeper one."""
    for steepness in (0.4, 3.0):
        tilt = math.atan(steepness * 0.01 / 0.1)
        what = f"the way of a ball in 1.2 s, rolling friction 0.01 m, on a slope of {tilt:.3f} rad, m"
        bodies = on_slope(Sphere(0.1), 0.1, tilt, slope_friction=0.5, friction=0.5, rolling_friction=0.01)
        due = way(5 / 7 * GRAVITY * (math.sin(tilt) - 0.1 * math.cos(tilt)), 1.2)
        yield Case(what, bodies, moved("body"), due, 0.02 + 0.05 * due, 1.2)


@compare
def check_round_bodies_roll_without_slipping() -> Iterator[Case]:
    """A solid body that rolls without slipping has a share of a block's acceleration: 1 / (1 + I / (m r^2))."""
    for shape, share, within in (
        (Sphere(0.06), 5 / 7, 0.05),
        (Cylinder(0.06, 0.2), 2 / 3, 0.1),
        (Capsule(0.06, 0.2), 0.6796, 0.1),
    ):
        due = way(share * GRAVITY * math.sin(0.15))
        bodies = on_slope(shape, 0.06, 0.15, rpy=LYING)
        yield Case(f"the way of {shape} down a slope in 1 s, m", bodies, moved("body"), due, within * due)


@compare
def check_hollow_body_is_hollow() -> Iterator[Case]:
    wall = 0.01
    parts = [part(Box((0.3, 0.3, wall)), 0, 0, wall / 2)]
    for side in (-0.145, 0.145):
        parts.append(part(Box((wall, 0.3, 0.2)), side, 0, 0.1))
        parts.append(part(Box((0.3, wall, 0.2)), 0, side, 0.1))
    ball = make_body("ball", Sphere(0.03), (0.5, 0, 0.1), mass=0.1)
    bodies = (table(), compound("bin", *parts, at=(0.5, 0, 0), mass=0.5), ball)
    yield Case("the height of a ball dropped into a bin, m", bodies, height("ball"), wall + 0.03, 2e-3)
    yield Case("how far a bin on the table moves by itself, m", bodies, moved("bin"), 0.0, 1e-3)


@compare
def check_mesh_collides_as_its_convex_hull() -> Iterator[Case]:
    """A cube that falls between two blocks of one mesh, 0.1 high, rests on the hull's lid."""
    blocks = [Box((0.1, 0.3, 0.1)).to_trimesh().apply_translation((x, 0, 0)) for x in (-0.15, 0.15)]
    mesh = part(Mesh.from_trimesh(trimesh.util.concatenate(blocks)))
    bodies = (table(), compound("blocks", mesh, at=(0.5, 0, 0.05), mass=1.0), cube(at=(0.5, 0, 0.17)))
    yield Case("the height of a cube on a mesh's hull, m", bodies, height("cube"), 0.15, 3e-3)
    yield Case("how far a mesh on the table moves by itself, m", bodies, moved("blocks"), 0.0, 2e-3)


RESTING: list[tuple[Shape, float, Vector, float]] = [  # how high their middles are, how they lie, how far they may turn
    (Box((0.1, 0.2, 0.06)), 0.03, (0.0, 0.0, 0.4), 0.01),
    (Cylinder(0.05, 0.1), 0.05, (0.0, 0.0, 0.4), 0.01),
    (Sphere(0.04), 0.04, (0.0, 0.0, 0.4), 0.01),
    (Capsule(0.03, 0.1), 0.03, LYING, 0.03),
    (Capsule(0.02, 0.1), 0.02, (math.pi / 2, 0.0, 0.4), 0.03),
]


@compare
def check_shapes_rest_where_they_are_put() -> Iterator[Case]:
    for shape, high, rpy, within in RESTING:
        body = make_body("body", shape, (0.6, 0.1, high), mass=0.3, rpy=rpy)
        what = f"how far {shape} on the table moves (m) and turns (rad) by itself in 2 s"
        yield Case(what, (table(), body), moved_and_turned("body"), 0.0, (1e-3, within), 2.0)


def check_stack_stands(simulator: Simulator) -> None:
    bricks = [cube(f"brick{i}", (0.6, 0, 0.03 + 0.06 * i), side=0.06, mass=0.4) for i in range(4)]
    states = play(simulator, Scene((table(), *bricks)), 3.0).states
    shift = np.abs(states.positions[-1] - states.positions[0]).max()
    near("how far a cube of a stack of four moves by itself in 3 s, m", shift, 0.0, 2e-3)
    near("the speed of a stack of four cubes after 3 s, m/s", states.linear_velocities[-1], 0.0, 0.01)


def check_states_are_those_of_frames(simulator: Simulator) -> None:
    """A body's position is its frame's, not its centre of mass'; so are its velocities, which add up to its way."""
    edge = make_body("edge", Box((0.1, 1.0, 0.1)), (3.0, 3.0, 0.0))
    body = compound("L", *L_SHAPE, at=(3.02, 3, 0.1), mass=1.0, rpy=(0.0, 0.0, 0.1))
    played = play(simulator, Scene((edge, body)), 0.5)
    places = played.states.position("L")
    near("where the frame of a body begins that tumbles, m", places[0], body.pose.position, 1e-4)
    near("by how much a body is turned at the start, rad", turn(played.states[0].pose("L"), body.pose), 0.0, 1e-3)
    way = np.trapezoid(played.states.linear_velocity("L"), played.times, axis=0)
    near("the way of a body, by its velocities, m", way, places[-1] - places[0], 0.01)
