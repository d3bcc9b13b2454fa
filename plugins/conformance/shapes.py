"""Check tools and bodies of every shape: they touch where they are, and hollow ones are hollow."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import trimesh

from core.design import Component, Tool
from core.geometry import Box, Capsule, Compound, Cylinder, Mesh, Pose, Shape, Sphere
from core.interfaces import Simulator
from core.robot.solids import Solid, body_solids, signed_distance, solid_geometry
from core.scene import Body, Geom, table
from plugins.conformance.checking import expect
from plugins.conformance.worlds import GREY, arm, compound, cube, end, film, move, stick, wait

_TOUCH = 0.0015  # metres between a tool and what it pushes
_DEEP = 0.003
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


def check_tools_of_every_shape_push_where_they_are(simulator: Simulator) -> None:
    """A head that moves sideways pushes a puck, and touches it with its own surface."""
    lying = (math.pi / 2, 0.0, 0.0)
    heads: list[tuple[Shape | Compound, tuple[float, float, float]]] = [
        (Box((0.04, 0.06, 0.05)), (0.0, 0.0, 0.0)),
        (Sphere(0.03), (0.0, 0.0, 0.0)),
        (Cylinder(0.03, 0.05), (0.0, 0.0, 0.0)),
        (Cylinder(0.02, 0.12), lying),
        (Capsule(0.02, 0.08), lying),
        (prism(6, 0.04, 0.05), (0.0, 0.0, math.pi / 6)),
        (bowl(0.05, 0.004), (0.0, math.pi, 0.0)),
    ]
    for shape, rpy in heads:
        head = Component("head", "stick", Pose.xyz_rpy((0.0, 0.0, -_SHAFT / 2), rpy), shape, 0.02)
        tool = Tool((*stick(_SHAFT).components, head))
        pose = tool.placed()["head"][1]
        front = float(pose.apply(shape.to_trimesh().vertices)[:, 0].max())
        puck = Body.of("puck", Cylinder(0.03, 0.06), (0.45 + front + 0.05, 0.0, 0.03), mass=0.2, color=GREY, friction=1)
        plan = [[x, 0.0, 0.035 + _SHAFT, 0, 0, 0] for x in (0.45, 0.65)]
        plan.insert(0, [0.45, 0.0, 0.4, 0, 0, 0])
        recording = film(move(simulator, plan, table(), puck, tool=tool, record_hz=50))
        heads_at = [Solid("", solid_geometry(p.shape), p.pose) for p in tool.parts if p.component == "head"]
        gaps = []
        for k, joints in enumerate(recording.arm):
            mount = arm().forward(joints)
            (there,) = body_solids(replace(puck, pose=recording.states[k].pose("puck")))
            gaps.append(min(signed_distance(Solid("", s.geometry, mount @ s.pose), there) for s in heads_at))
        what = f"a head of the shape {shape if not isinstance(shape, Compound | Mesh) else type(shape).__name__} "
        pushed = float(recording.states.position("puck")[-1, 0] - puck.pose.position[0])
        expect(abs(pushed - 0.18) < 0.005, f"{what}pushed a puck by {pushed:.3f} m instead of 0.180 m")
        nearest = float(np.min(gaps))
        expect(-_DEEP < nearest < _TOUCH, f"{what}pushed a puck from {1000 * nearest:.1f} mm away")


def check_hollow_tool_is_hollow(simulator: Simulator) -> None:
    """A bowl, upside down over a ball, drags it along."""
    at = Pose.xyz_rpy((0.0, 0.0, 0.07 - _SHAFT), (math.pi, 0.0, 0.0))  # the shaft ends in the bowl's wall
    tool = Tool((*stick(0.14).components, Component("head", "stick", at, bowl(0.06, 0.004), 0.02)))
    plan = [[x, 0.0, z, 0, 0, 0] for x, z in ((0.45, 0.4), (0.45, 0.004 + _SHAFT), (0.6, 0.004 + _SHAFT))]
    ball = Body.of("ball", Sphere(0.02), (0.45, 0.0, 0.02), mass=0.05, color=GREY, friction=0.2)
    outcome = move(simulator, plan, table(), ball, tool=tool, hold_s=1.0)
    x, y, z = end(outcome).position("ball")
    inside = math.hypot(x - 0.6, y) < 0.045 and abs(z - 0.02) < 0.003
    expect(inside, f"a ball under a bowl that moved to x = 0.6 m is at ({x:.3f}, {y:.3f}, {z:.3f})")


def check_cube_stays_in_a_round_bowl(simulator: Simulator) -> None:
    """A cube dropped beside the middle of a bowl slides down, and comes to rest in it."""
    parts = tuple(Geom(shape) for shape in bowl(0.12, 0.006).parts)
    for mass in (0.0, 1.0):
        under = compound("bowl", *parts, at=(0.5, 0.0, 0.126), mass=mass)
        stand = Body.of("stand", Box((0.2, 0.2, 0.06)), (0.5, 0.0, -0.03), mass=0.0, color=GREY)
        small = cube(at=(0.53, 0.02, 0.1), side=0.03, mass=0.05)
        state = end(wait(simulator, stand, under, small, seconds=3.0))
        x, y, z = state.position("cube") - (state.position("bowl") if mass else under.pose.position)
        expect(math.hypot(x, y) < 0.06 and -0.12 < z < -0.07, f"a cube in a bowl is at ({x:.3f}, {y:.3f}, {z:.3f})")
        speed = float(np.abs(state.linear_velocities).max())
        expect(speed < 0.05, f"a cube in a bowl still moves at {speed:.3f} m/s after 3 s")
