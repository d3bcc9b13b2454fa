"""Turn shapes into solids and measure their distances, with Coal.

A mesh counts as its convex hull, as in every engine.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import coal
import numpy as np

from core.design import Tool
from core.geometry import Array, Pose, Shape
from core.robot.description import assembled
from core.robot.meshes import solid_of
from core.scene import Body, Geom
from core.shapes.solid import box_corners as box_corners
from core.values.robots import Robot

WORLD = -1  # the frame of what never moves


@dataclass(frozen=True, eq=False)
class Solid:
    """A convex solid in a frame.

    Attributes:
        name: of its link, component or body.
        geometry: Coal's.
        pose: in its frame.
        shape: ours; None for a link's.
        owner: the body that it is part of, or the robot.
        frame: the number of the frame among those that move, or `WORLD`.
    """

    name: str
    geometry: Any
    pose: Pose
    shape: Shape | None = None
    owner: str = ""
    frame: int = WORLD

    @property
    def transform(self) -> Any:
        return coal.Transform3s(self.pose.rotation_matrix, self.pose.position)

    def bounds(self) -> tuple[Array, Array]:
        """Compute the centre (3,) and half lengths (3,) of the bounding box along the frame's axes."""
        middle, half = bounding_box(self.geometry)
        return self.pose.apply(middle), np.abs(self.pose.rotation_matrix) @ half


@lru_cache(maxsize=256)
def solid_geometry(shape: Shape) -> Any:
    """Build a shape for Coal; kept, since scenes are made anew for each rollout, mostly of equal shapes."""
    return shape.coal()


def corners(geometry: Any) -> Array:
    """List the corners (V, 3) of a Coal shape; of what is round, those of its bounding box."""
    if isinstance(geometry, coal.ConvexBase):
        return np.asarray(geometry.points())

    middle, half = bounding_box(geometry)
    return box_corners(middle - half, middle + half)


def bounding_box(geometry: Any) -> tuple[Array, Array]:
    """Measure the bounding box of a Coal shape along its own axes: its middle (3,), and half of its extents (3,)."""
    geometry.computeLocalAABB()
    box = geometry.aabb_local

    return (box.max_ + box.min_) / 2, (box.max_ - box.min_) / 2


def solids_of(name: str, shape: Shape, pose: Pose) -> list[Solid]:
    """Build the solids of a shape's convex parts."""
    return [Solid(name, solid_geometry(part), pose) for part in shape.convex_parts()]


def body_solids(body: Body, frame: int = WORLD) -> Iterator[Solid]:
    """Yield a body's collision shapes in the world, or in the body's ``frame``, which moves with it."""
    for part in body.collisions:
        yield shape_solid(body, part, frame)


def shape_solid(body: Body, part: Geom, frame: int = WORLD) -> Solid:
    """Build one of a body's collision shapes in the world, or in the body's ``frame``, which moves with it."""
    return Solid(
        body.name,
        solid_geometry(part.shape),
        body.pose @ part.pose if frame == WORLD else part.pose,
        part.shape,
        owner=body.name,
        frame=frame,
    )


def signed_distance(a: Solid, b: Solid) -> float:
    """Measure the distance of two solids in one frame, metres; a negative one is the penetration depth."""
    return contact(a, b)[0]


def contact(a: Solid, b: Solid) -> tuple[float, Array, Array]:
    """Measure the signed distance of two solids in one frame.

    Return it, the point (3,) midway where they are closest, and the direction (3,) from the first to the second there.
    """
    request = coal.DistanceRequest()
    result = coal.DistanceResult()
    between = (a.geometry, a.transform, b.geometry, b.transform)
    gap = coal.distance(*between, request, result)
    here = result.getNearestPoint1()
    there = result.getNearestPoint2()
    return float(gap), (here + there) / 2, result.normal


def closest(
    ones: Iterable[Solid], others: Iterable[Solid]
) -> tuple[float, Array, Array]:
    """Measure the least signed distance of two groups of solids; see `contact`."""
    contacts = itertools.starmap(contact, itertools.product(ones, others))
    return min(contacts, key=lambda found: found[0])


class Obstacles:
    """N fixed solids in one frame; bounding boxes quickly select those that can be near.

    Attributes:
        solids: in one frame.
        centers: (N, 3) of their bounding boxes along the frame's axes, metres.
        halves: (N, 3) half of the boxes' extents, metres.
    """

    def __init__(self, solids: Iterable[Solid]) -> None:
        self.solids = tuple(solids)
        bounds = np.array([solid.bounds() for solid in self.solids]).reshape(-1, 2, 3)
        self.centers = bounds[:, 0]
        self.halves = bounds[:, 1]

    def near(self, solid: Solid, margin: float) -> Iterator[Solid]:
        """Yield each solid that may be within ``margin`` metres of one, or farther."""
        center, half = solid.bounds()
        yield from self.overlap(center, half + margin)

    def overlap(self, center: Array, half: Array) -> list[Solid]:
        """Return the solids whose boxes overlap one, with its centre (3,) and half lengths (3,)."""
        near = np.abs(self.centers - center) <= self.halves + half
        return [self.solids[i] for i in np.flatnonzero(near.all(axis=1))]


@lru_cache(maxsize=8)
def robot_solids(robot: Robot, gripper: bool) -> tuple[Solid, ...]:
    """List the collision shapes of the robot without a tool, each in the frame of its link."""
    solids = []

    for link in assembled(robot, Tool(gripper=gripper)).links.values():
        for part in link.collisions:
            geometry = solid_geometry(solid_of(part))
            solids.append(Solid(link.name, geometry, part.origin.pose))

    return tuple(solids)
