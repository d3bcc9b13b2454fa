"""Measure the normal forces between the things of a world."""

from __future__ import annotations

from typing import Any

import numpy as np

from core.design import Tool
from core.geometry import Array
from core.interfaces import Robot
from core.scene import Scene
from plugins.simulators.sapien.description import robot_links

Thing = tuple[int, str]  # a rank, and a name; the robot's have rank -1, bodies theirs in the scene


class Forces:
    """The normal impulses since the world began, of each two things that touched."""

    def __init__(self, system: Any, scene: Scene, robot: Robot, tool: Tool) -> None:
        self._system = system
        self._things: dict[Any, Thing] = {}
        ranks = {body.name: rank for rank, body in enumerate(scene.bodies)}
        for component in (*system.rigid_dynamic_components, *system.rigid_static_components):
            name = component.entity.name
            self._things.update(dict.fromkeys(component.collision_shapes, (ranks[name], name)))
        links = {link.name: link.collisions for link in robot_links(robot, tool)}
        for component in system.articulation_link_components:
            parts, shapes = links[component.entity.name], component.collision_shapes
            for number, shape in enumerate(shapes):  # of each part there are as many copies
                part = parts[number * len(parts) // len(shapes)].part
                self._things[shape] = -1, "tool" if part in tool.borne_on else part
        self._impulses: dict[tuple[str, str], float] = {}
        self._noted: list[dict[tuple[str, str], float]] = []

    def add(self) -> None:
        """Add those of the last step. PhysX keeps them for bodies that sleep."""
        for contact in self._system.get_contacts():
            one, other = sorted(self._things[shape] for shape in contact.shapes)
            impulse = sum(float(point.impulse @ point.normal) for point in contact.points)
            if impulse > 0 and other[0] > one[0]:
                pair = one[1], other[1]
                self._impulses[pair] = self._impulses.get(pair, 0.0) + impulse

    def note(self) -> None:
        """Note the impulses at an instant of the recording."""
        self._noted.append(dict(self._impulses))

    def means(self, times: Array) -> dict[tuple[str, str], Array]:
        """Compute the mean forces between instants (T,), see `core.interfaces.Recording`."""
        found = {}
        for pair in self._impulses:
            sums = np.array([noted.get(pair, 0.0) for noted in self._noted])
            found[pair] = np.append(0.0, np.diff(sums) / np.diff(times))
        return found
