"""Measure the normal forces between the things of a world."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from core.geometry import Array
from core.scene import Scene
from plugins.simulators.forces import Impulses, Thing, meeting


def pushes(system: Any, shapes: Collection[Any]) -> tuple[Array, Array]:
    """Return what pushed some collision shapes in the last step, see `core.interfaces.World.pushes`.

    Args:
        system: PhysX's.
        shapes: of the links; what they press on each other with is left out.
    """
    points = []
    forces = []
    for contact in system.get_contacts():
        first, second = (shape in shapes for shape in contact.shapes)
        if first == second:
            continue

        sign = 1.0 if first else -1.0

        for point in contact.points:
            points.append(point.position)
            forces.append(sign * point.impulse / system.timestep)

    return np.reshape(points, (-1, 3)), np.reshape(forces, (-1, 3))


class Forces(Impulses):
    """The impulses of a world.

    Args:
        system: PhysX's.
        scene: what is in it beside the robot.
        things: what each collision shape is part of.
    """

    def __init__(self, system: Any, scene: Scene, things: Mapping[Any, Thing]) -> None:
        super().__init__()
        self._system = system
        self._things = things
        # The impulses of shapes at rest, which stay the same.
        self._still: dict[tuple[Any, ...], float] = {}

        bodies = enumerate(scene.bodies)
        self._fixed = {(rank, body.name) for rank, body in bodies if body.fixed}
        self._free = []
        for component in system.rigid_dynamic_components:
            thing = things[component.collision_shapes[0]]
            self._free.append((component, thing))

    def add_step(self) -> None:
        # PhysX keeps them for bodies that sleep. It does not tell those of friction.
        sleeping = {thing for component, thing in self._free if component.is_sleeping}
        resting = self._fixed | sleeping
        before = self._still
        self._still = {}

        for contact in self._system.get_contacts():
            shapes = tuple(contact.shapes)
            first, second = (self._things[shape] for shape in shapes)
            still = first in resting and second in resting
            met = meeting(first, second)

            impulse = before.get(shapes) if still else None
            if impulse is None:
                parts = [float(p.impulse @ p.normal) for p in contact.points]
                impulse = sum(parts)

            if still:
                self._still[shapes] = impulse

            self.add(met, impulse)

            if met.body:
                for point in contact.points:
                    self.push(met, point.position, point.impulse)
