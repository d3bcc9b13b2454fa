"""Measure the normal forces between the things of a world."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np

from core.design import Tool
from core.geometry import Array
from core.interfaces import Robot
from core.scene import Scene
from plugins.simulators.forces import Impulses, Thing, meeting
from plugins.simulators.sapien.description import robot_links


def pushes(system: Any, shapes: Collection[Any]) -> tuple[Array, Array]:
    """Return what pushed these collision shapes in the last step, see `core.values.jobs.FeelingWorld`."""
    points = []
    forces = []
    for contact in system.get_contacts():
        first, second = (shape in shapes for shape in contact.shapes)
        if first != second:
            for point in contact.points:
                points.append(point.position)
                forces.append(
                    (point.impulse if first else -point.impulse) / system.timestep
                )
    return np.reshape(points, (-1, 3)), np.reshape(forces, (-1, 3))


class Forces(Impulses):
    """The impulses of a world."""

    def __init__(self, system: Any, scene: Scene, robot: Robot, tool: Tool) -> None:
        super().__init__()
        self._system = system
        self._things: dict[Any, Thing] = {}
        self._fixed = frozenset(
            (rank, body.name) for rank, body in enumerate(scene.bodies) if body.fixed
        )
        # The impulses of shapes at rest, which stay the same.
        self._still: dict[tuple[Any, ...], float] = {}
        ranks = {body.name: rank for rank, body in enumerate(scene.bodies)}

        for component in (
            *system.rigid_dynamic_components,
            *system.rigid_static_components,
        ):
            name = component.entity.name
            self._things.update(
                dict.fromkeys(component.collision_shapes, (ranks[name], name))
            )

        self._free = [
            (component, self._things[component.collision_shapes[0]])
            for component in system.rigid_dynamic_components
        ]
        links = {link.name: link.collisions for link in robot_links(robot, tool)}

        for component in system.articulation_link_components:
            parts = links[component.entity.name]
            shapes = component.collision_shapes
            # Of each part there are as many copies.
            for number, shape in enumerate(shapes):
                part = parts[number * len(parts) // len(shapes)].part
                self._things[shape] = -1, "tool" if part in tool.borne_on else part

    def add_step(self) -> None:
        """Add those of the last step. PhysX keeps them for bodies that sleep. It does not tell those of friction."""
        resting = self._fixed.union(
            thing for component, thing in self._free if component.is_sleeping
        )
        before = self._still
        self._still = {}
        for contact in self._system.get_contacts():
            shapes = tuple(contact.shapes)
            first, second = (self._things[shape] for shape in shapes)
            still = first in resting and second in resting
            met = meeting(first, second)
            impulse = before.get(shapes) if still else None
            if impulse is None:
                impulse = sum(
                    float(point.impulse @ point.normal) for point in contact.points
                )

            if still:
                self._still[shapes] = impulse
            self.add(met, impulse)

            if met.body:
                for point in contact.points:
                    self.push(met, point.position, point.impulse)
