"""Push bodies and the tool in PyBullet, for the grips of a tool."""

from __future__ import annotations

from collections.abc import Mapping

from core.design import Tool
from core.geometry import Array
from core.interfaces import Robot
from core.scene import Scene
from plugins.simulators import grips
from plugins.simulators.pybullet.engine import Client
from plugins.simulators.pybullet.mechanisms import Place


class Grips(grips.Grips):
    """The grips in a world.

    Args:
        client: the world.
        robot: the arm.
        tool: with components that grip.
        scene: has the bodies.
        places: of the bodies, by name.
        mount: the place of the link that bears the tool.
        time_step: seconds.
    """

    def __init__(
        self,
        client: Client,
        robot: Robot,
        tool: Tool,
        scene: Scene,
        places: Mapping[str, Place],
        mount: Place,
        time_step: float,
    ) -> None:
        super().__init__(robot, tool, scene, time_step)
        self._client = client
        self._places = {**places, "": mount}

    def collide(self, name: str, *, collide: bool) -> None:
        body, link = self._places[name]
        tool, mount = self._places[""]
        self._client.setCollisionFilterPair(tool, body, mount, link, int(collide))

    def push(self, name: str, forces: Array, points: Array) -> None:
        place = self._places[name]
        for force, point in zip(forces.tolist(), points.tolist(), strict=True):
            self._client.applyExternalForce(
                *place, force, point, self._client.WORLD_FRAME
            )
