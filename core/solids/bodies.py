"""Measure the solids of a rollout: the robot's links, the tool's components and the scene's bodies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import trimesh

from core.design import Tool
from core.geometry import Mesh, Shape, Sphere
from core.robot.kinematics import jointed, robot_model
from core.robot.solids import (
    WORLD,
    Solid,
    bounding_box,
    hull,
    robot_solids,
    solid_geometry,
)
from core.scene import Scene
from core.values.robots import Robot

ROBOT = "the robot"  # the owner of its links and of the tool


class Solids:
    """N solids, each at rest in one of the frames that move, or in the world.

    Attributes:
        items: the solids; ``owners`` and ``frames`` (N,) are theirs.
        owner_numbers: (N,) a number for each one's owner.
        moving: the numbers of those that move.
        rotations: (N, 3, 3), with ``positions`` (N, 3) its place in its frame.
        middles: (N, 3), with ``halves`` (N, 3) its bounding box along its own axes.
        widths: (N,) half of the thickness, metres (`thickness`).
        radii: (N,) that of a ball; infinite for others.
        reaches: (N,) how far from the solid's origin rotation moves a point, metres.
        far: (N,) how far from the origin of its frame it extends, metres.
    """

    def __init__(self, solids: Sequence[Solid]) -> None:
        self.items, self.owners = tuple(solids), tuple(solid.owner for solid in solids)
        numbers = {owner: i for i, owner in enumerate(dict.fromkeys(self.owners))}
        self.owner_numbers = np.array(
            [numbers[owner] for owner in self.owners], dtype=np.intp
        )
        self.frames = np.array([solid.frame for solid in solids], dtype=np.intp)
        self.moving = np.flatnonzero(self.frames != WORLD)
        self.rotations = np.array(
            [solid.pose.rotation.as_matrix() for solid in solids]
        ).reshape(-1, 3, 3)
        self.positions = np.array([solid.pose.position for solid in solids]).reshape(
            -1, 3
        )
        boxes = np.array([bounding_box(solid.geometry) for solid in solids])
        self.middles, self.halves = boxes.reshape(-1, 2, 3).swapaxes(0, 1)
        shapes = [solid.shape for solid in solids]
        thick = [
            thickness(s) if isinstance(s, Mesh) else 2 * h.min()
            for s, h in zip(shapes, self.halves, strict=True)
        ]
        self.widths = np.array(thick) / 2
        self.radii = np.array(
            [shape.radius if isinstance(shape, Sphere) else np.inf for shape in shapes]
        )
        corners = np.linalg.norm(np.abs(self.middles) + self.halves, axis=1)
        self.reaches = np.where(self.radii < np.inf, 0.0, corners)
        self.far = np.linalg.norm(self.positions, axis=1) + corners


@lru_cache(maxsize=512)
def thickness(shape: Shape) -> float:
    """Measure how thick a shape is, metres: along its own axes, or square to a face of a mesh's hull."""
    straight = 2 * float(bounding_box(_geometry(shape))[1].min())
    if not isinstance(shape, Mesh):
        return straight
    convex = shape.to_trimesh().convex_hull
    return min(
        straight, float(np.ptp(convex.vertices @ convex.face_normals.T, axis=0).min())
    )


def _geometry(shape: Shape) -> Any:
    return (
        _hull(shape.vertices.tobytes())
        if isinstance(shape, Mesh)
        else solid_geometry(shape)
    )


@lru_cache(maxsize=256)
def _hull(vertices: bytes) -> Any:
    """The hull of points (V, 3), cached by content: scenes are made anew for each rollout, mostly of equal meshes."""
    return hull(trimesh.PointCloud(np.frombuffer(vertices).reshape(-1, 3)))


@lru_cache(maxsize=8)
def link_solids(robot: Robot, tool: Tool) -> tuple[Solid, ...]:
    """Return the solids of the links in the joints' frames; 0 is that of links that never move."""
    links = robot_model(robot, tool).links
    placed = [
        (solid, *links[solid.name]) for solid in robot_solids(robot, tool.gripper)
    ]
    return tuple(
        replace(solid, pose=at @ solid.pose, owner=ROBOT, frame=joint)
        for solid, joint, at in placed
    )


def tool_solids(robot: Robot, tool: Tool) -> list[Solid]:
    """Return the solids of a tool's parts in the joints' frames."""
    links = robot_model(robot, tool).links
    placed = [(part, *links[part.bearer]) for part in tool.parts]
    return [
        Solid(p.component, _geometry(p.shape), at @ p.pose, p.shape, ROBOT, joint)
        for p, joint, at in placed
    ]


@lru_cache(maxsize=8)
def own_solids(robot: Robot, tool: Tool) -> Solids:
    """Measure the robot's own solids: those of the links that move, and behind them the tool's parts."""
    links = [solid for solid in link_solids(robot, jointed(tool)) if solid.frame > 0]
    return Solids([*links, *tool_solids(robot, tool)])


_last: tuple[Scene, list[object], Solids] | None = None


def scene_solids(scene: Scene) -> Solids:
    """Measure the collision shapes of all bodies; their frames are those of the free ones.

    They are kept for the last scene, which has many rollouts, and for equal ones made anew.
    """
    global _last
    if _last is None or _last[0] is not scene:
        content: list[object] = [
            (b.name, b.pose if b.fixed else None, b.collisions) for b in scene.bodies
        ]
        if _last is None or _last[1] != content:
            frames = {body.name: number for number, body in enumerate(scene.free)}
            solids = [
                Solid(
                    body.name,
                    _geometry(part.shape),
                    body.pose @ part.pose if body.fixed else part.pose,
                    part.shape,
                    body.name,
                    frames.get(body.name, WORLD),
                )
                for body in scene.bodies
                for part in body.collisions
            ]
            _last = scene, content, Solids(solids)
        _last = scene, *_last[1:]
    return _last[2]


@lru_cache(maxsize=8)
def all_solids(robot: Robot, tool: Tool, bodies: Solids) -> Solids:
    """Append the solids of bodies to the robot's, and their frames to the joints'."""
    before = len(robot_model(robot, tool).parents)
    others = [
        s if s.frame == WORLD else replace(s, frame=before + s.frame)
        for s in bodies.items
    ]
    return Solids([*own_solids(robot, tool).items, *others])
