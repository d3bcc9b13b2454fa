"""Check bodies: they fall, slide, roll, fly, spin and come to rest."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from core.geometry import Box, Capsule, Cylinder, Shape, Sphere, Vector
from core.interfaces import Simulator
from core.scene import Body, Scene, table
from plugins.conformance.cases import Case, compare, moved, place, spin, velocity
from plugins.conformance.scenery import (
    FAR,
    compound,
    cube,
    ground,
    make_body,
    part,
    slope,
    turn,
)
from plugins.conformance.shapes import arch
from plugins.conformance.shared import near
from plugins.conformance.worlds import GRAVITY, watch

LYING = (math.pi / 2, 0.0, 0.0)
L_SHAPE = (  # its frame is at a corner
    part(Box((0.3, 0.1, 0.02)), 0.15, 0, 0.01),
    part(Box((0.02, 0.1, 0.2)), 0.01, 0, 0.12),
)


@compare
def check_free_fall() -> Iterator[Case]:
    """The position after 0.5 s is that of an engine's steps, not much below g t^2 / 2; the speed is g t."""
    bodies = (cube(at=(3, 3, 5)),)
    speed = GRAVITY * 0.5
    due = (3, 3, 5 - speed * 0.5 / 2)
    yield Case(
        "where a cube is after 0.5 s of free fall, m",
        bodies,
        place("cube"),
        due,
        (1e-6, 1e-6, 0.02),
        0.5,
    )
    due = (0, 0, -speed)
    yield Case(
        "the velocity after 0.5 s of free fall, m/s",
        bodies,
        velocity("cube"),
        due,
        1e-4 * speed,
        0.5,
    )


def on_slope(
    shape: Shape,
    high: float,
    tilt: float,
    rpy: Vector = (0.0, 0.0, 0.0),
    slope_friction: float = 1.0,
    **more: float,
) -> tuple[Body, Body]:
    """A slope, and ``body`` on it, whose middle is ``high`` above it."""
    hill = slope(tilt, slope_friction)
    place = hill.pose.apply([0, 0, 0.05 + high])
    return hill, make_body("body", shape, place, mass=1.0, rpy=rpy, **more)


def way(acceleration: float) -> float:
    """The way from rest in 1 s, m; none where what brakes is stronger than what pulls."""
    return max(0.0, acceleration) / 2


@compare
def check_friction_is_the_geometric_mean() -> Iterator[Case]:
    """A block slides if the slope is steeper than the geometric mean of both frictions: g (sin a - mean cos a)."""
    for first, second in ((0.5, 0.5), (0.1, 0.9), (1.0, 0.25)):
        mean = math.sqrt(first * second)
        for steepness in (0.85, 1.15):
            tilt = math.atan(steepness * mean)
            what = f"the way of a block in 1 s, frictions {first} and {second}, on a slope of {tilt:.3f} rad, m"
            block = Box((0.2, 0.2, 0.04))
            bodies = on_slope(
                block, 0.02, tilt, (0.0, tilt, 0.0), first, friction=second
            )
            due = way(GRAVITY * (math.sin(tilt) - mean * math.cos(tilt)))
            yield Case(what, bodies, moved("body"), due, 5e-3 + 0.15 * due)


@compare
def check_round_bodies_roll() -> Iterator[Case]:
    """A body that rolls without slipping has 1 / (1 + I / (m r^2)) of a block's acceleration.

    Rolling friction is an arm: one of 0.01 m holds a ball of radius 0.1 m on a slope of up to a tenth.
    """
    for shape, radius, share, arm, tilt in (
        (Sphere(0.06), 0.06, 5 / 7, 0.0, 0.15),
        (Cylinder(0.06, 0.2), 0.06, 2 / 3, 0.0, 0.15),
        (Capsule(0.06, 0.2), 0.06, 0.6796, 0.0, 0.15),
        (Sphere(0.1), 0.1, 5 / 7, 0.01, 0.04),
        (Sphere(0.1), 0.1, 5 / 7, 0.01, 0.29),
    ):
        what = f"the way of {shape} in 1 s, rolling friction {arm} m, on a slope of {tilt} rad, m"
        bodies = on_slope(
            shape, radius, tilt, LYING, 0.5, friction=0.5, rolling_friction=arm
        )
        due = way(share * GRAVITY * (math.sin(tilt) - arm / radius * math.cos(tilt)))
        yield Case(what, bodies, moved("body"), due, 0.01 + 0.05 * due)


@compare
def check_hollow_body_is_hollow() -> Iterator[Case]:
    """An arch stands over a cube and lets it lie."""
    hollow = compound("arch", *map(part, arch().parts), at=(0.5, 0, 0.03), mass=0.5)
    bodies = (table(), hollow, cube(at=(0.5, 0, 0.02), side=0.04))
    for name in ("arch", "cube"):
        yield Case(
            f"how far the {name} moves of an arch over a cube, m",
            bodies,
            moved(name),
            0.0,
            1e-3,
        )


@compare
def check_shapes_rest_where_they_are_put() -> Iterator[Case]:
    for shape, high, rpy in (
        (Box((0.1, 0.2, 0.06)), 0.03, (0.0, 0.0, 0.4)),
        (Cylinder(0.05, 0.1), 0.05, (0.0, 0.0, 0.0)),
        (Cylinder(0.03, 0.1), 0.03, (0.0, math.pi / 2, 1.2)),
        (Sphere(0.04), 0.04, (0.0, 0.0, 0.0)),
        (Capsule(0.02, 0.1), 0.02, (math.pi / 2, 0.0, 0.4)),
    ):
        body = make_body("body", shape, (0.6, 0.1, high), mass=0.3, rpy=rpy)
        yield Case(
            f"how far {shape} on the table moves by itself, m",
            (table(), body),
            moved("body"),
            0.0,
            1e-3,
            2.0,
        )

    stack = [
        cube(f"brick{i}", (0.6, 0, 0.03 + 0.06 * i), side=0.06, mass=0.4)
        for i in range(4)
    ]
    yield Case(
        "how far the top of a stack moves by itself, m",
        (table(), *stack),
        moved("brick3"),
        0.0,
        2e-3,
        3.0,
    )


def check_states_are_those_of_frames(simulator: Simulator) -> None:
    """A body's position is its frame's, not its centre of mass'; so are its velocities, which add up to its way."""
    edge = make_body("edge", Box((0.1, 1.0, 0.1)), (3.0, 3.0, 0.0))
    body = compound("L", *L_SHAPE, at=(3.02, 3, 0.1), mass=1.0, rpy=(0.0, 0.0, 0.1))
    played = watch(simulator, Scene((edge, body)), 0.5)
    places = played.states.position("L")
    near(
        "where the frame of a body begins that tumbles, m",
        places[0],
        body.pose.position,
        1e-4,
    )
    near(
        "by how much a body is turned at the start, rad",
        turn(played.states[0].pose("L"), body.pose),
        0.0,
        1e-3,
    )
    way = np.trapezoid(played.states.linear_velocity("L"), played.times, axis=0)
    near("the way of a body, by its velocities, m", way, places[-1] - places[0], 0.01)


@compare
def check_light_bodies_slide_as_heavy_ones() -> Iterator[Case]:
    """A box of 1 mg slides by the square of its speed over twice the friction and gravity."""
    speed = 0.7746
    at = np.array([0.7, 0.3, 0.005])
    box = make_body("box", Box((0.02, 0.02, 0.01)), at, mass=1e-6, friction=0.18)
    sent = replace(box, velocity=(speed, 0.0, 0.0))
    way = speed**2 / (2 * math.sqrt(0.18 * 0.5) * GRAVITY)
    what = "where a box of 1 mg comes to rest that slides, m"
    due = np.add(at, (way, 0.0, 0.0))
    yield Case(what, (table(), sent), place("box"), due, 0.003, settle_s=0.1)


@compare
def check_launched_body_flies() -> Iterator[Case]:
    """A cube rests until the motion begins; then it flies along its parabola and spins as it was told."""
    start = np.array([FAR[0], FAR[1], 0.0501])
    rate = (0.0, 0.0, 4.0)
    thrown = replace(cube("cube", start), velocity=(1.0, 0.5, 3.0), spin=rate)
    bodies = (ground(), thrown)
    due = start + np.multiply(thrown.velocity, 0.5) - [0, 0, GRAVITY / 2 * 0.5**2]
    what = "where a cube is 0.5 s after its launch, m"
    yield Case(what, bodies, place("cube"), due, 0.03, 0.5, settle_s=0.3)
    what = "the spin of a launched cube, rad/s"
    yield Case(what, bodies, spin("cube"), rate, 0.08, 0.5, settle_s=0.3)


@compare
def check_spinning_ball_is_braked() -> Iterator[Case]:
    """A ball that spins on the spot is braked by the torque of rolling friction: its arm times the weight."""
    radius = 0.05
    arm = 1e-4
    rate = 5.0
    lying = make_body("ball", Sphere(radius), (FAR[0], FAR[1], radius), mass=0.1)
    ball = replace(lying, rolling_friction=arm, spin=(0.0, 0.0, rate))
    due = (0.0, 0.0, rate - 2.0 * arm * GRAVITY / (0.4 * radius**2))
    what = "the spin of a ball after 2 s, rad/s"
    within = (np.inf, np.inf, 0.15)
    yield Case(what, (ground(), ball), spin("ball"), due, within, 2.0, settle_s=0.3)
