"""Check tools and bodies of every shape: they touch where they are, and hollow ones are hollow."""

from __future__ import annotations

import itertools
import math

import numpy as np
import trimesh

from core.design import Component, Tool
from core.geometry import Box, Capsule, Compound, Cylinder, Mesh, Pose, Shape, Sphere, Vector
from core.interfaces import Simulator
from core.scene import table
from plugins.conformance.checking import near
from plugins.conformance.worlds import end, make_body, move, stick

_SHAFT = 0.2


def prism(sides: int, radius: float, length: float) -> Mesh:
    """A prism along z of so many sides."""
    return Mesh.from_trimesh(trimesh.creation.cylinder(radius=radius, height=length, sections=sides))


def sector(low: float, high: float, first: float, last: float, inner: float, outer: float) -> Mesh:
    """The hull of a piece of a spherical shell: between two angles from straight down, and two about z, radians."""
    polar, about = np.meshgrid([low, high], [first, last])
    ways = np.stack([np.sin(polar) * np.cos(about), np.sin(polar) * np.sin(about), -np.cos(polar)], axis=-1)
    points = np.concatenate([ways.reshape(-1, 3) * inner, ways.reshape(-1, 3) * outer])
    return Mesh.from_trimesh(trimesh.PointCloud(points).convex_hull)


def bowl(radius: float, wall: float, rings: int = 3, sides: int = 16) -> Compound:
    """Half of a spherical shell, open at the top; its frame is at the sphere's centre."""
    polar = np.linspace(0.0, math.pi / 2, rings + 1)
    columns = list(itertools.pairwise(np.linspace(0.0, 2 * math.pi, sides + 1)))
    rows = itertools.pairwise(polar)
    parts = tuple(sector(*row, *column, radius, radius + wall) for row in rows for column in columns)
    arc = np.column_stack([np.sin(polar), -np.cos(polar)])
    outline = np.concatenate([arc * (radius + wall), arc[::-1] * radius])
    return Compound(Mesh.from_trimesh(trimesh.creation.revolve(outline, sections=sides)), parts)


HEADS: list[tuple[Shape | Compound, Vector]] = [  # and how they are turned
    (Box((0.04, 0.06, 0.05)), (0.0, 0.0, 0.0)),
    (Sphere(0.03), (0.0, 0.0, 0.0)),
    (Cylinder(0.03, 0.05), (0.0, 0.0, 0.0)),
    (Cylinder(0.02, 0.12), (math.pi / 2, 0.0, 0.0)),
    (Capsule(0.02, 0.08), (math.pi / 2, 0.0, 0.0)),
    (prism(6, 0.04, 0.05), (0.0, 0.0, math.pi / 6)),
    (bowl(0.05, 0.004), (0.0, math.pi, 0.0)),
]


def check_tools_of_every_shape_push_where_they_are(simulator: Simulator) -> None:
    """A head that moves sideways by 0.2 m meets a puck after 0.02 m: so it pushes it by the rest."""
    for shape, rpy in HEADS:
        head = Component("head", "stick", Pose.xyz_rpy((0.0, 0.0, -_SHAFT / 2), rpy), shape, 0.02)
        tool = Tool((*stick(_SHAFT).components, head))
        pose = tool.placed()["head"][1]
        front = float(pose.apply(shape.to_trimesh().vertices)[:, 0].max())
        at = (0.45 + front + 0.05, 0.0, 0.03)
        puck = make_body("puck", Cylinder(0.03, 0.06), at, mass=0.2, friction=1)
        plan = [[x, 0.0, z, 0, 0, 0] for x, z in ((0.45, 0.4), (0.45, 0.035 + _SHAFT), (0.65, 0.035 + _SHAFT))]
        pushed = end(move(simulator, plan, table(), puck, tool=tool)).position("puck")[0] - at[0]
        near(f"how far a head of the shape {type(shape).__name__} pushes a puck, m", pushed, 0.18, 0.005)


def check_hollow_tool_is_hollow(simulator: Simulator) -> None:
    """A bowl, upside down over a ball, drags it along."""
    pose = Pose.xyz_rpy((0.0, 0.0, 0.07 - _SHAFT), (math.pi, 0.0, 0.0))  # the shaft ends in the bowl's wall
    tool = Tool((*stick(0.14).components, Component("head", "stick", pose, bowl(0.06, 0.004), 0.02)))
    plan = [[x, 0.0, z, 0, 0, 0] for x, z in ((0.45, 0.4), (0.45, 0.004 + _SHAFT), (0.6, 0.004 + _SHAFT))]
    ball = make_body("ball", Sphere(0.02), (0.45, 0.0, 0.02), mass=0.05, friction=0.2)
    place = end(move(simulator, plan, table(), ball, tool=tool, hold_s=1.0)).position("ball")
    near("where a ball is under a bowl that moved, m", place, (0.6, 0.0, 0.02), (0.04, 0.04, 0.003))
