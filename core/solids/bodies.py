"""Measure the solids of a rollout: the robot's links, the tool's components and the scene's bodies.

Covered by `tests/core/solids/test_penetration.py`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import trimesh

from core.design import Tool
from core.geometry import Array, Mesh, Pose, Shape, Sphere
from core.robot.frames import robot_model
from core.robot.solids import hull, robot_solids, solid_geometry
from core.scene import Scene
from core.values.robots import Robot

ROBOT = "the robot"  # the owner of its links and of the tool
WORLD = -1  # the frame of what never moves


class Solid(NamedTuple):
    """A convex solid and its pose in a frame; a link's hull has no shape, but all have Coal's geometry."""

    name: str
    owner: str
    shape: Shape | None
    geometry: Any
    frame: int
    pose: Pose


@dataclass(frozen=True, eq=False)
class Solids:
    """N solids, each at rest in one of the frames that move, or in the world.

    Attributes:
        frames: (N,) the number of each one's frame, or `WORLD`.
        rotations: (N, 3, 3), with ``positions`` (N, 3) its place there.
        middles: (N, 3), with ``halves`` (N, 3) its bounding box along its own axes.
        widths: (N,) half of the thickness, metres (`thickness`).
        radii: (N,) that of a ball; infinite for others.
        reaches: (N,) how far from the solid's origin rotation moves a point, metres.
        far: (N,) how far from the origin of its frame it extends, metres.
    """

    names: tuple[str, ...]
    owners: tuple[str, ...]
    shapes: tuple[Shape | None, ...]
    geometries: tuple[Any, ...]
    frames: npt.NDArray[np.intp]
    rotations: Array
    positions: Array
    middles: Array
    halves: Array
    widths: Array
    radii: Array
    reaches: Array
    far: Array

    @cached_property
    def owner_numbers(self) -> npt.NDArray[np.intp]:
        """A number (N,) for each one's owner."""
        numbers = {owner: i for i, owner in enumerate(dict.fromkeys(self.owners))}
        return np.array([numbers[owner] for owner in self.owners], dtype=np.intp)

    @cached_property
    def moving(self) -> npt.NDArray[np.intp]:
        """The numbers of those that move."""
        return np.flatnonzero(self.frames != WORLD)

    @classmethod
    def of(cls, solids: Sequence[Solid]) -> Solids:
        """Measure solids."""
        names, owners, shapes, geometries, frames, poses = zip(*solids, strict=True) if solids else ((),) * 6
        boxes = [_bounding_box(geometry) for geometry in geometries]
        middles, halves = np.array(boxes).reshape(-1, 2, 3).swapaxes(0, 1)
        corners = np.linalg.norm(np.abs(middles) + halves, axis=1)
        positions = np.array([pose.position for pose in poses]).reshape(-1, 3)
        thick = [thickness(s) if isinstance(s, Mesh) else 2 * h.min() for s, h in zip(shapes, halves, strict=True)]
        radii = np.array([shape.radius if isinstance(shape, Sphere) else np.inf for shape in shapes])
        return cls(
            names,
            owners,
            shapes,
            geometries,
            np.array(frames, dtype=np.intp),
            np.array([pose.rotation.as_matrix() for pose in poses]).reshape(-1, 3, 3),
            positions,
            middles,
            halves,
            np.array(thick) / 2,
            radii,
            np.where(radii < np.inf, 0.0, corners),
            np.linalg.norm(positions, axis=1) + corners,
        )


@lru_cache(maxsize=512)
def thickness(shape: Shape) -> float:
    """Measure how thick a shape is, metres: along its own axes, or square to a face of a mesh's hull."""
    straight = 2 * float(_bounding_box(_geometry(shape))[1].min())
    return min(straight, _across_faces(shape)) if isinstance(shape, Mesh) else straight


@lru_cache(maxsize=512)
def _across_faces(mesh: Mesh) -> float:
    hull = mesh.to_trimesh().convex_hull
    return float(np.ptp(hull.vertices @ hull.face_normals.T, axis=0).min())


def _geometry(shape: Shape) -> Any:
    return _hull(shape.vertices.tobytes()) if isinstance(shape, Mesh) else solid_geometry(shape)


@lru_cache(maxsize=256)
def _hull(vertices: bytes) -> Any:
    """The hull of points (V, 3), cached by content: scenes are made anew for each rollout, mostly of equal meshes."""
    return hull(trimesh.PointCloud(np.frombuffer(vertices).reshape(-1, 3)))


def _bounding_box(geometry: Any) -> tuple[Array, Array]:
    """The middle (3,) of a geometry's bounding box along its own axes, and half of its extents (3,)."""
    geometry.computeLocalAABB()
    box = geometry.aabb_local
    return (box.max_ + box.min_) / 2, (box.max_ - box.min_) / 2


@lru_cache(maxsize=8)
def _link_solids(robot: Robot, gripper: bool) -> tuple[Solid, ...]:
    """The solids of the links that move, in the joints' frames."""
    links = robot_model(robot, gripper).links
    moving = [(solid, *links[solid.name]) for solid in robot_solids(robot, gripper) if links[solid.name][0] > 0]
    return tuple(Solid(solid.name, ROBOT, None, solid.geometry, joint, at @ solid.pose) for solid, joint, at in moving)


@lru_cache(maxsize=8)
def own_solids(robot: Robot, tool: Tool) -> Solids:
    """Measure the robot's own solids: those of the links that move, and behind them the tool's parts.

    Their frames are those of the joints, and behind them those of the tool's bearers.
    """
    links, solids = robot_model(robot, tool.gripper).links, list(_link_solids(robot, tool.gripper))
    frames = {mount: links[mount] for mount in tool.mounts}
    joints = len(robot_model(robot, tool.gripper).parents)
    frames |= {bearer.name: (joints + number, Pose()) for number, bearer in enumerate(tool.bearers)}
    for name, shape, bearer, pose in tool.parts:
        joint, at = frames[bearer]
        solids.append(Solid(name, ROBOT, shape, _geometry(shape), joint, at @ pose))
    return Solids.of(solids)


_last: tuple[Scene, list[object], Solids] | None = None


def body_solids(scene: Scene) -> Solids:
    """Measure the collision shapes of all bodies; their frames are those of the free ones.

    They are kept for the last scene, which has many rollouts, and for equal ones made anew.
    """
    global _last
    if _last is not None and _last[0] is scene:
        return _last[2]
    content: list[object] = [(b.name, b.pose if b.fixed else None, b.collisions) for b in scene.bodies]
    if _last is None or _last[1] != content:
        names, solids = [body.name for body in scene.free], list[Solid]()
        for body in scene.bodies:
            frame = WORLD if body.fixed else names.index(body.name)
            for part in body.collisions:
                pose = body.pose @ part.pose if body.fixed else part.pose
                solids.append(Solid(body.name, body.name, part.shape, _geometry(part.shape), frame, pose))
        _last = scene, content, Solids.of(solids)
    else:
        _last = scene, *_last[1:]
    return _last[2]


@lru_cache(maxsize=8)
def all_solids(robot: Robot, tool: Tool, bodies: Solids) -> Solids:
    """Append the solids of bodies to the robot's, and their frames to the joints' and the bearers'."""
    own = own_solids(robot, tool)
    before = len(robot_model(robot, tool.gripper).parents) + len(tool.bearers)
    joined = dict[str, Any]()
    for field in fields(Solids):
        one, other = getattr(own, field.name), getattr(bodies, field.name)
        if field.name == "frames":
            other = np.where(other == WORLD, WORLD, before + other)
        joined[field.name] = one + other if isinstance(one, tuple) else np.concatenate([one, other])
    return Solids(**joined)
