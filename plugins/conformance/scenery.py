"""Provide bodies and tools that the checks put into small worlds."""

from __future__ import annotations

from typing import Any

from core.design import RIGID_MOUNT, Component, Tool
from core.geometry import Box, Pose, Shape, Vector
from core.scene import Body, Color, Geom

GREY: Color = (0.5, 0.5, 0.5, 1.0)
FAR = (3.0, 3.0, 0.0)  # from the arm


def make_body(
    name: str, shape: Shape, position: Vector, mass: float = 0.0, **more: Any
) -> Body:
    """A grey body of one shape; without a mass it is fixed."""
    return Body.of(name, shape, position, mass=mass, color=GREY, **more)


def box(
    name: str,
    size: tuple[float, float, float],
    position: Vector,
    mount: str = RIGID_MOUNT,
    **more: Any,
) -> Component:
    """A box of a tool."""
    return Component(name, mount, Pose.xyz_rpy(position), Box(size), **more)


def cube(
    name: str = "cube",
    at: Vector = (0.0, 0.0, 0.0),
    side: float = 0.1,
    mass: float = 1.0,
) -> Body:
    return make_body(name, Box((side, side, side)), at, mass=mass)


def part(shape: Shape, *at: float) -> Geom:
    return Geom(shape, Pose.xyz_rpy(at or (0.0, 0.0, 0.0)))


def ground() -> Body:
    """A fixed slab, far from the arm, whose upper side is at z = 0."""
    return make_body("ground", Box((2.0, 2.0, 0.1)), (FAR[0], FAR[1], -0.05))


def compound(
    name: str, *parts: Geom, at: Vector, mass: float, rpy: Vector = (0.0, 0.0, 0.0)
) -> Body:
    return Body(name, Pose.xyz_rpy(at, rpy), mass, parts, parts)


def slope(tilt: float, friction: float) -> Body:
    """A fixed slab 0.1 thick, far from the arm, that falls ``tilt`` radians toward +x; its frame is in its middle."""
    return make_body(
        "slope", Box((4.0, 1.0, 0.1)), FAR, rpy=(0.0, tilt, 0.0), friction=friction
    )


def stick(length: float, mass: float = 0.005) -> Tool:
    """A rigid tool: a box 0.02 m wide that hangs down from the flange."""
    return Tool(
        (box("stick", (0.02, 0.02, length), (0.0, 0.0, -length / 2), mass=mass),)
    )


def turn(first: Pose, second: Pose) -> float:
    """The angle between two poses, radians."""
    return float((first.rotation.inv() * second.rotation).magnitude())
