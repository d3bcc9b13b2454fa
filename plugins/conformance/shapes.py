"""Check tools and bodies of every shape: they touch where they are, and hollow ones are hollow."""

from __future__ import annotations

import math

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
from plugins.conformance.scenery import make_body, stick
from plugins.conformance.shared import near
from plugins.conformance.worlds import end, move

_SHAFT = 0.2


def arch() -> Compound:
    """Two walls at x = -0.03 and 0.03 m, and a lid over them, open at two sides; its frame is in the middle."""
    boxes = [((0.006, 0.06, 0.06), (x, 0.0, 0.0)) for x in (-0.03, 0.03)]
    boxes.append(((0.066, 0.06, 0.006), (0.0, 0.0, 0.033)))
    meshes = [Box(size).to_trimesh().apply_translation(place) for size, place in boxes]

    return Compound(
        Mesh.from_trimesh(trimesh.util.concatenate(meshes)),
        tuple(map(Mesh.from_trimesh, meshes)),
    )


HEADS: list[tuple[Shape | Compound, Vector]] = [  # and how they are turned
    (Box((0.04, 0.06, 0.05)), (0.0, 0.0, 0.0)),
    (Cylinder(0.02, 0.12), (math.pi / 2, 0.0, 0.0)),
    (Capsule(0.02, 0.08), (math.pi / 2, 0.0, 0.0)),
    (
        Mesh.from_trimesh(trimesh.creation.cylinder(0.04, 0.05, sections=6)),
        (0.0, 0.0, math.pi / 6),
    ),
    (arch(), (0.0, 0.0, 0.0)),
]


def _put_head(
    shape: Shape | Compound, below: float = 0.0, rpy: Vector = (0.0, 0.0, 0.0)
) -> Tool:
    """Make a stick with a head, so far ``below`` its end, m.

    Args:
        shape: of the head.
        below: how far the middle of the head hangs below the stick's end, m.
        rpy: how the head is turned, radians.
    """
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
    plan = [
        [0.45, 0.0, high, 0, 0, 0],
        [0.45, 0.0, low + _SHAFT, 0, 0, 0],
        [x, 0.0, low + _SHAFT, 0, 0, 0],
    ]

    return end(move(simulator, plan, table(), body, tool=tool)).position(body.name)


def check_tools_of_every_shape_push_where_they_are(simulator: Simulator) -> None:
    """A head that moves sideways by 0.2 m meets a puck after 0.02 m: so it pushes it by the rest.

    The front of the head is where its vertices are, so a shape that an engine has elsewhere pushes less or more.
    """
    for shape, rpy in HEADS:
        tool = _put_head(shape, rpy=rpy)
        pose = tool.placed()["head"][1]
        front = float(pose.apply(shape.to_trimesh().vertices)[:, 0].max())
        place = (0.45 + front + 0.05, 0.0, 0.03)
        puck = make_body("puck", Cylinder(0.03, 0.06), place, mass=0.2, friction=1)

        pushed = _move_head(simulator, tool, puck, 0.4, 0.035, 0.65)[0] - place[0]
        what = f"how far a head of the shape {type(shape).__name__} pushes a puck, m"
        near(what, pushed, 0.18, 0.005)


def check_hollow_tool_is_hollow(simulator: Simulator) -> None:
    """An arch over a ball drags it along by a wall.

    A solid head would press the ball into the table, or stand on it.
    """
    tool = _put_head(arch(), below=0.033)
    ball = make_body(
        "ball", Sphere(0.02), (0.45, 0.0, 0.02), mass=0.05, rolling_friction=0.005
    )
    place = _move_head(simulator, tool, ball, 0.5, 0.064, 0.6)
    what = "where a ball is under an arch that moved, m"
    near(what, place, (0.6, 0.0, 0.02), (0.03, 0.03, 0.003))
