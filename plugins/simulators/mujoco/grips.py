"""Push bodies and the arm's last link in MuJoCo, for the grips of a tool."""

from __future__ import annotations

import numpy as np

from core.design import RIGID_MOUNT, Tool
from core.geometry import Array
from core.interfaces import Robot
from core.scene import Scene
from plugins.simulators import grips
from plugins.simulators.grips import find_moving
from plugins.simulators.mujoco.bodies import name_body
from plugins.simulators.mujoco.shapes import Element

_NEVER_M = -1e3  # a pair of geoms that collides where it overlaps by so much


class Grips(grips.Grips):
    """The grips in a world.

    Args:
        robot: the arm.
        tool: with components that grip.
        scene: has the bodies.
        model: of all.
        data: the world's.
    """

    def __init__(
        self, robot: Robot, tool: Tool, scene: Scene, model: Element, data: Element
    ) -> None:
        super().__init__(robot, tool, scene, float(model.opt.timestep))
        self._model = model
        self._data = data
        link = find_moving(robot, tool, RIGID_MOUNT)
        self._numbers = {"": model.body(link).id}
        for name in self.targets:
            self._numbers[name] = model.body(name_body(scene, name)).id

        model.pair_margin[:] = 0.0

    def collide(self, name: str, *, collide: bool) -> None:
        model = self._model
        ends = [self._numbers[""], self._numbers[name]]
        bodies = model.geom_bodyid[np.array([model.pair_geom1, model.pair_geom2])]
        between = np.isin(bodies, ends).all(axis=0)
        model.pair_margin[between] = 0.0 if collide else _NEVER_M

    def rest(self) -> None:
        self._data.xfrc_applied[:] = 0.0

    def push(self, name: str, forces: Array, points: Array) -> None:
        number = self._numbers[name]
        arms = points - self._data.xipos[number]
        self._data.xfrc_applied[number, :3] += forces.sum(axis=0)
        self._data.xfrc_applied[number, 3:] += np.cross(arms, forces).sum(axis=0)
