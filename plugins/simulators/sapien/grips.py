"""Push bodies and the arm's last link in PhysX, for the grips of a tool."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from core.design import RIGID_MOUNT, Tool
from core.geometry import Array
from core.interfaces import Robot
from core.scene import Scene
from plugins.simulators import grips
from plugins.simulators.grips import find_moving

_APART = 1 << 30  # shapes that share a bit of the third word don't collide


class Grips(grips.Grips):
    """The grips in a world.

    Args:
        robot: the arm.
        tool: with components that grip.
        scene: has the bodies.
        bodies: PhysX's components of the free ones, by name.
        links: those of the robot's links.
        time_step: seconds.
    """

    def __init__(
        self,
        robot: Robot,
        tool: Tool,
        scene: Scene,
        bodies: Mapping[str, Any],
        links: Mapping[str, Any],
        time_step: float,
    ) -> None:
        super().__init__(robot, tool, scene, time_step)
        self._components = {**bodies, "": links[find_moving(robot, tool, RIGID_MOUNT)]}

    def collide(self, name: str, *, collide: bool) -> None:
        for part in ("", name):
            for shape in self._components[part].collision_shapes:
                groups = shape.get_collision_groups()
                groups[2] = groups[2] & ~_APART if collide else groups[2] | _APART
                shape.set_collision_groups(groups)

    def push(self, name: str, forces: Array, points: Array) -> None:
        component = self._components[name]
        if name:
            component.wake_up()
        for force, point in zip(forces, points, strict=True):
            component.add_force_at_point(force, point)
