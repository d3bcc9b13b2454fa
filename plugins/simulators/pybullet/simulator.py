"""Play rollouts in PyBullet, in one process, without a window."""

from __future__ import annotations

from typing import Unpack

from core.interfaces import Image, Robot, Rollout, Task, View
from core.scene import Scene
from plugins.simulators.fresh import FreshWorlds
from plugins.simulators.pybullet.bodies import PreparedScene
from plugins.simulators.pybullet.engine import Client, pybullet
from plugins.simulators.pybullet.renderer import PyBulletRenderer
from plugins.simulators.pybullet.robot import robot_file
from plugins.simulators.pybullet.world import Settings, World


class PyBulletSimulator(FreshWorlds[PreparedScene]):
    """Play each job in a fresh world, so that no rollout affects the next.

    Args:
        time_step: seconds.
        solver_iterations: of the contact solver, per step.
        tracking_rate: how fast a joint converges to its target, 1/s, independent of the time step.
        separation_rate: how fast overlapping bodies are pushed apart, 1/s. With PyBullet's own default, five times as
            much, a struck body leaves a fifth faster than it was struck.
    """

    title = "PyBullet"
    failures = (pybullet.error,)

    def __init__(
        self,
        time_step: float = 0.002,
        solver_iterations: int = 50,
        tracking_rate: float = 50.0,
        separation_rate: float = 25.0,
    ) -> None:
        self._settings = Settings(solver_iterations, tracking_rate, separation_rate)
        super().__init__(time_step, **self._settings._asdict())
        self._client = Client()
        self._renderer: PyBulletRenderer | None = None

    def prepare(self, scene: Scene) -> PreparedScene:
        return PreparedScene(scene, self.folder)

    def place(
        self, prepared: PreparedScene, robot: Robot, job: Rollout, time_step: float
    ) -> World:
        file = robot_file(self.folder, robot, job.tool, visuals=False)
        return World(
            self._client, prepared, robot, file, job, time_step, self._settings
        )

    def render(self, task: Task, **view: Unpack[View]) -> Image:
        if self._renderer is None:
            self._renderer = PyBulletRenderer(self.folder)
        return self._renderer.render(task, **view)
