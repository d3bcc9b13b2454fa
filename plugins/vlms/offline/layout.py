"""The geometry of a layout: where bodies are, and what is in the way."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property, lru_cache

import numpy as np

from core.design import Tool
from core.designs.planning import look
from core.designs.start import SpawnRules
from core.geometry import Array, Box, Mesh, Pose, Shape
from core.interfaces import Material, Perception, Task
from core.robot.kinematics import link_poses, robot_model
from core.robot.solids import (
    Obstacles,
    Solid,
    body_solids,
    contact,
    corners,
    robot_solids,
    solid_geometry,
)
from core.scene import Soft
from plugins.vlms.offline.reach import measure_reach

Size = tuple[float, float, float]
"""The full sides of a box, metres."""

CONTACT_M = 0.001
"""Solids that overlap by less only touch each other."""


class Layout:
    """A layout of a task, by its seed, with the arm and the material that are there for it.

    Attributes:
        scene: its bodies.
        robot: the arm.
        material: of which tools are made.
        home: where the tool mount starts.
        seen: the poses that a plan sees, and what judges them.
        spawn: the rules for where a tool may start.
        reach: where the arm works with ease.
    """

    def __init__(self, task: Task, seed: int, material: Material) -> None:
        self.scene = task.scene(seed)
        self.robot = task.robot
        self.material = material
        self.home = task.home
        self.seen = look(task, seed, Perception(), self.scene)
        self.spawn = SpawnRules(task, seed, self.scene)
        self.reach = measure_reach(task.robot)

    @cached_property
    def solids(self) -> dict[str, list[Solid]]:
        """The solids of each body that can be touched, in the world, by its name."""
        found = {}
        for body in self.scene.bodies:
            solids = [*body_solids(body)]
            if isinstance(body, Soft):
                solids = _soft_solids(body)
            if solids:
                found[body.name] = solids

        return found

    @cached_property
    def points(self) -> dict[str, Array]:
        """The corners (V, 3) of each body that can be touched, in the world, by its name."""
        return {
            name: np.concatenate([*map(solid_points, solids)])
            for name, solids in self.solids.items()
        }

    @cached_property
    def obstacles(self) -> Obstacles:
        """All solids of the layout, and those of the arm that never move."""
        fixed = []
        poses = link_poses(self.robot, False, np.array(self.robot.home))
        model = robot_model(self.robot, Tool())
        for solid in robot_solids(self.robot, False):
            joint, _ = model.links[solid.name]
            if joint == 0:
                fixed.append(replace(solid, pose=poses[solid.name] @ solid.pose))

        return Obstacles([*self.solids_without(frozenset()).solids, *fixed])

    @lru_cache(maxsize=64)  # noqa: B019 - a layout lives as long as the answer to a brief
    def solids_without(self, names: frozenset[str]) -> Obstacles:
        """Return all solids but those of some bodies."""
        found: list[Solid] = []
        for name, solids in self.solids.items():
            if name not in names:
                found += solids

        return Obstacles(found)

    def meets(
        self, pose: Pose, size: Size, without: frozenset[str] = frozenset()
    ) -> bool:
        """Report whether a box is in any body.

        Args:
            pose: of its middle, in the world.
            size: its full sides.
            without: the names of bodies that do not count.
        """
        box = Solid("box", solid_geometry(Box(size)), pose)
        others = self.solids_without(without)
        return any(contact(box, other)[0] < 0.0 for other in others.near(box, 0.0))

    def top_at(self, low: Array, high: Array, below: float = np.inf) -> float:
        """Find how high the bodies stand that are over a part of the ground, metres; minus infinity: none does.

        Args:
            low: the least x and y of that part.
            high: the greatest x and y of it.
            below: what ends higher does not count.
        """
        obstacles = self.solids_without(frozenset())
        lower = obstacles.centers - obstacles.halves
        upper = obstacles.centers + obstacles.halves
        over = ((lower[:, :2] < high[:2]) & (upper[:, :2] > low[:2])).all(axis=1)
        over &= upper[:, 2] < below
        return float(upper[over, 2].max(initial=-np.inf))


def solid_points(solid: Solid) -> Array:
    """Return points (V, 3) on a solid's surface, in the world, of which it is the hull, or nearly so."""
    return solid.pose.apply(_shape_points(solid.shape))


@lru_cache(maxsize=256)
def _shape_points(shape: Shape | None) -> Array:
    """Return points (V, 3) of a shape's surface in its frame; of a flat one its corners."""
    assert shape is not None  # bodies have shapes, links alone have none
    if isinstance(shape, Box | Mesh):
        return np.asarray(corners(solid_geometry(shape)))
    return np.asarray(shape.to_trimesh().vertices)


def _soft_solids(body: Soft) -> list[Solid]:
    """Make the box around a soft body as it is at the start."""
    low = body.placed.min(axis=0)
    high = body.placed.max(axis=0)
    sides = np.maximum(high - low, CONTACT_M)
    shape = Box(tuple(sides))
    return [Solid(body.name, solid_geometry(shape), Pose((low + high) / 2), shape)]
