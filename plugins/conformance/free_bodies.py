"""Check bodies: they fall, slide, roll, fly, spin, come to rest, and are where a tool of any shape pushes them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import trimesh

from core.design import Component, Tool
from core.geometry import (
    Array,
    Box,
    Capsule,
    Compound,
    Cylinder,
    Mesh,
    Pose,
    Shape,
    Sphere,
    Vector,
)
from core.interfaces import Simulator
from core.scene import Body, table
from plugins.conformance.sample_tools import stick
from plugins.conformance.shared import near
from plugins.conformance.worlds import (
    FAR,
    GRAVITY,
    compound,
    cube,
    make_body,
    motion,
    part,
    slope,
    watch,
)

_LYING = (math.pi / 2, 0.0, 0.0)
_UPRIGHT = (0.0, 0.0, 0.0)
_SHAFT = 0.2  # m: of a stick with a head
_GROUND = make_body("ground", Box((2.0, 2.0, 0.1)), (FAR[0], FAR[1], -0.05))


def check_free_fall(simulator: Simulator) -> None:
    """The position after 0.5 s is that of an engine's steps, not much below g t^2 / 2; the speed is g t."""
    fall = watch(simulator, cube(at=(3, 3, 5)), hold_s=0.5)
    speed = GRAVITY * 0.5
    due = (3, 3, 5 - speed * 0.5 / 2)
    within = (1e-6, 1e-6, 0.02)
    near("where a cube is after 0.5 s of fall, m", fall.path("cube")[-1], due, within)
    found = fall.states.linear_velocity("cube")[-1]
    near("the velocity after 0.5 s of fall, m/s", found, (0, 0, -speed), 1e-4 * speed)


def _slide(
    simulator: Simulator,
    shape: Shape,
    high: float,
    tilt: float,
    rpy: Vector,
    frictions: tuple[float, float],
    rolling_friction: float = 0.0,
) -> float:
    """Let a body go whose middle is so ``high`` above a slope; how far it gets in 1 s, m."""
    hill = slope(tilt, frictions[0])
    place = hill.pose.apply([0, 0, 0.05 + high])
    body = make_body(
        "body",
        shape,
        place,
        1.0,
        rpy=rpy,
        friction=frictions[1],
        rolling_friction=rolling_friction,
    )
    return watch(simulator, hill, body).moved("body")


def check_friction_is_the_geometric_mean(simulator: Simulator) -> None:
    """A block slides if the slope is steeper than the geometric mean of both frictions: g (sin a - mean cos a)."""
    block = Box((0.2, 0.2, 0.04))
    for frictions in ((0.5, 0.5), (0.1, 0.9), (1.0, 0.25)):
        mean = math.sqrt(math.prod(frictions))
        for steepness in (0.85, 1.15):
            tilt = math.atan(steepness * mean)
            found = _slide(simulator, block, 0.02, tilt, (0.0, tilt, 0.0), frictions)
            pull = GRAVITY * (math.sin(tilt) - mean * math.cos(tilt))
            due = max(0.0, pull) / 2
            near(
                f"the way of a block in 1 s, frictions {frictions}, on a slope of {tilt:.3f} rad, m",
                found,
                due,
                5e-3 + 0.15 * due,
            )


def check_round_bodies_roll(simulator: Simulator) -> None:
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
        found = _slide(simulator, shape, radius, tilt, _LYING, (0.5, 0.5), arm)
        pull = GRAVITY * (math.sin(tilt) - arm / radius * math.cos(tilt))
        due = max(0.0, share * pull) / 2
        near(
            f"the way of {shape} in 1 s, rolling friction {arm} m, on a slope of {tilt} rad, m",
            found,
            due,
            0.01 + 0.05 * due,
        )


def check_shapes_rest_where_they_are_put(simulator: Simulator) -> None:
    for shape, high, rpy in (
        (Box((0.1, 0.2, 0.06)), 0.03, (0.0, 0.0, 0.4)),
        (Cylinder(0.05, 0.1), 0.05, _UPRIGHT),
        (Cylinder(0.03, 0.1), 0.03, (0.0, math.pi / 2, 1.2)),
        (Sphere(0.04), 0.04, _UPRIGHT),
        (Capsule(0.02, 0.1), 0.02, (math.pi / 2, 0.0, 0.4)),
    ):
        body = make_body("body", shape, (0.6, 0.1, high), 0.3, rpy=rpy)
        moved = watch(simulator, table(), body, hold_s=2.0).moved("body")
        near(f"how far {shape} on the table moves by itself, m", moved, 0.0, 1e-3)

    bricks = []
    for number in range(4):
        at = (0.6, 0, 0.03 + 0.06 * number)
        bricks.append(cube(f"brick{number}", at, side=0.06, mass=0.4))

    moved = watch(simulator, table(), *bricks, hold_s=3.0).moved("brick3")
    near("how far the top of a stack moves by itself, m", moved, 0.0, 2e-3)


def check_states_are_those_of_frames(simulator: Simulator) -> None:
    """A body's position is its frame's, not its centre of mass'; so are its velocities, which add up to its way."""
    edge = make_body("edge", Box((0.1, 1.0, 0.1)), (3.0, 3.0, 0.0))
    foot = part(Box((0.3, 0.1, 0.02)), 0.15, 0, 0.01)
    leg = part(Box((0.02, 0.1, 0.2)), 0.01, 0, 0.12)
    corner = compound("L", foot, leg, at=(3.02, 3, 0.1), mass=1.0)
    body = replace(corner, pose=corner.pose @ Pose.xyz_rpy((0, 0, 0), (0.0, 0.0, 0.1)))
    played = watch(simulator, edge, body, hold_s=0.5)

    path = played.path("L")
    place = body.pose.position
    near("where the frame of a body begins that tumbles, m", path[0], place, 1e-4)
    first = played.states[0].pose("L").rotation
    turned = (first.inv() * body.pose.rotation).magnitude()
    near("by how much a body is turned at the start, rad", turned, 0.0, 1e-3)
    way = np.trapezoid(played.states.linear_velocity("L"), played.times, axis=0)
    near("the way of a body, by its velocities, m", way, path[-1] - path[0], 0.01)


def check_light_bodies_slide_as_heavy_ones(simulator: Simulator) -> None:
    """A box of 1 mg slides by the square of its speed over twice the friction and gravity."""
    speed = 0.7746
    at = np.array([0.7, 0.3, 0.005])
    box = make_body("box", Box((0.02, 0.02, 0.01)), at, 1e-6, friction=0.18)
    sent = replace(box, velocity=(speed, 0.0, 0.0))
    found = watch(simulator, table(), sent, settle_s=0.1).path("box")[-1]
    way = speed**2 / (2 * math.sqrt(0.18 * 0.5) * GRAVITY)
    due = np.add(at, (way, 0.0, 0.0))
    near("where a box of 1 mg comes to rest that slides, m", found, due, 0.003)


def check_launched_body_flies(simulator: Simulator) -> None:
    """A cube rests until the motion begins; then it flies along its parabola and spins as it was told."""
    start = np.array([FAR[0], FAR[1], 0.0501])
    rate = (0.0, 0.0, 4.0)
    thrown = replace(cube("cube", start), velocity=(1.0, 0.5, 3.0), spin=rate)
    played = watch(simulator, _GROUND, thrown, settle_s=0.3, hold_s=0.5)
    due = start + np.multiply(thrown.velocity, 0.5) - [0, 0, GRAVITY / 2 * 0.5**2]
    found = played.path("cube")[-1]
    near("where a cube is 0.5 s after its launch, m", found, due, 0.03)
    near("the spin of a launched cube, rad/s", played.spin("cube"), rate, 0.08)


def check_spinning_ball_is_braked(simulator: Simulator) -> None:
    """A ball that spins on the spot is braked by the torque of rolling friction: its arm times the weight."""
    radius = 0.05
    arm = 1e-4
    rate = 5.0
    lying = make_body("ball", Sphere(radius), (FAR[0], FAR[1], radius), 0.1)
    ball = replace(lying, rolling_friction=arm, spin=(0.0, 0.0, rate))
    played = watch(simulator, _GROUND, ball, settle_s=0.3, hold_s=2.0)
    due = rate - 2.0 * arm * GRAVITY / (0.4 * radius**2)
    near("the spin of a ball after 2 s, rad/s", played.spin("ball")[2], due, 0.15)


# --- tools of every shape ---------------------------------------------------------------------------------------


def arch() -> Compound:
    """Two walls at x = -0.03 and 0.03 m, and a lid over them, open at two sides; its frame is in the middle."""
    walls = [((0.006, 0.06, 0.06), (x, 0.0, 0.0)) for x in (-0.03, 0.03)]
    lid = ((0.066, 0.06, 0.006), (0.0, 0.0, 0.033))
    meshes = []
    for size, place in (*walls, lid):
        meshes.append(Box(size).to_trimesh().apply_translation(place))

    whole = Mesh.from_trimesh(trimesh.util.concatenate(meshes))
    return Compound(whole, tuple(map(Mesh.from_trimesh, meshes)))


def _put_head(shape: Shape | Compound, below: float, rpy: Vector = _UPRIGHT) -> Tool:
    """Make a stick with a turned head whose middle is so far ``below`` its end, m."""
    pose = Pose.xyz_rpy((0.0, 0.0, -_SHAFT / 2 - below), rpy)
    head = Component("head", "stick", pose, shape, 0.02)
    return Tool((*stick(_SHAFT).components, head))


def _move_head(
    simulator: Simulator, tool: Tool, body: Body, high: float, low: float, x: float
) -> Array:
    """Lower a head beside a body or over it, move it sideways, and return where the body ends, (3,) m.

    Args:
        simulator: plays the motion.
        tool: the stick with the head.
        body: on the table, with which the head meets.
        high: where the head's middle begins, m above the table.
        low: where it moves sideways.
        x: where it ends, m; it begins at 0.45.
    """
    ends = [[0.45, 0.0, low + _SHAFT, 0, 0, 0], [x, 0.0, low + _SHAFT, 0, 0, 0]]
    way = motion([[0.45, 0.0, high, 0, 0, 0], *ends])
    played = watch(
        simulator, table(), body, tool=tool, way=way, settle_s=0.1, hold_s=0.5
    )
    last: Array = played.path(body.name)[-1]
    return last


def check_tools_of_every_shape_push_where_they_are(simulator: Simulator) -> None:
    """A head that moves sideways by 0.2 m meets a puck after 0.02 m: so it pushes it by the rest.

    The front of the head is where its vertices are, so a shape that an engine has elsewhere pushes less or more.
    """
    prism = Mesh.from_trimesh(trimesh.creation.cylinder(0.04, 0.05, sections=6))
    heads: list[tuple[Shape | Compound, Vector]] = [
        (Box((0.04, 0.06, 0.05)), _UPRIGHT),
        (Cylinder(0.02, 0.12), _LYING),
        (Capsule(0.02, 0.08), _LYING),
        (prism, (0.0, 0.0, math.pi / 6)),
        (arch(), _UPRIGHT),
    ]
    for shape, rpy in heads:
        tool = _put_head(shape, 0.0, rpy)
        _, pose = tool.placed()["head"]
        front = float(pose.apply(shape.to_trimesh().vertices)[:, 0].max())
        place = (0.45 + front + 0.05, 0.0, 0.03)
        puck = make_body("puck", Cylinder(0.03, 0.06), place, 0.2, friction=1)
        end = _move_head(simulator, tool, puck, 0.4, 0.035, 0.65)
        near(
            f"how far a head of the shape {type(shape).__name__} pushes a puck, m",
            end[0] - place[0],
            0.18,
            0.005,
        )


def check_hollow_tool_is_hollow(simulator: Simulator) -> None:
    """An arch over a ball drags it along by a wall.

    A solid head would press the ball into the table, or stand on it.
    """
    lying = make_body("ball", Sphere(0.02), (0.45, 0.0, 0.02), 0.05)
    ball = replace(lying, rolling_friction=0.005)
    end = _move_head(simulator, _put_head(arch(), 0.033), ball, 0.5, 0.064, 0.6)
    within = (0.03, 0.03, 0.003)
    near("where a ball is under an arch that moved, m", end, (0.6, 0.0, 0.02), within)


def check_hollow_body_is_hollow(simulator: Simulator) -> None:
    """An arch stands over a cube and lets it lie."""
    hollow = compound("arch", *map(part, arch().parts), at=(0.5, 0, 0.03), mass=0.5)
    small = cube(at=(0.5, 0, 0.02), side=0.04)
    played = watch(simulator, table(), hollow, small)
    for name in ("arch", "cube"):
        near(
            f"how far the {name} moves of an arch over a cube, m",
            played.moved(name),
            0.0,
            1e-3,
        )
