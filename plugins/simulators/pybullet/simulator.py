"""Play rollouts in PyBullet, in one process, without a window."""

from __future__ import annotations

from pathlib import Path
from typing import Unpack

from core.design import Tool
from core.errors import check_positive
from core.interfaces import Image, Robot, Rollout, Task, View
from core.scene import Scene
from core.support.scratch import temporary_folder
from plugins.simulators.fresh import FreshWorlds
from plugins.simulators.pybullet.engine import Client, pybullet
from plugins.simulators.pybullet.renderer import PyBulletRenderer
from plugins.simulators.pybullet.robot import robot_file
from plugins.simulators.pybullet.world import PreparedScene, Settings, World
from plugins.simulators.rigid import only_rigid
from plugins.simulators.steps import check_time_step, choose_step


class PyBulletSimulator(FreshWorlds):
    """Play each job in a fresh world, so that no rollout affects the next.

    Args:
        time_step: seconds.
        solver_iterations: of the contact solver, per step.
        tracking_rate: how fast a joint converges to its target, 1/s, independent of the time step.
        separation_rate: how fast overlapping bodies are pushed apart, 1/s. With PyBullet's own default, five times as
            much, a struck body leaves a fifth faster than it was struck.
    """

    title = "PyBullet"
    refusal = pybullet.error

    def __init__(
        self,
        time_step: float = 0.002,
        solver_iterations: int = 50,
        tracking_rate: float = 50.0,
        separation_rate: float = 25.0,
    ) -> None:
        self._settings = Settings(
            time_step, solver_iterations, tracking_rate, separation_rate
        )
        check_positive("sim.", **self._settings._asdict())
        check_time_step(time_step)
        self._client = Client()
        self._folder = temporary_folder()
        self._renderer: PyBulletRenderer | None = None
        # Those of the last job, since consecutive jobs mostly share them; the world is fresh each time.
        self._scene: tuple[Scene, PreparedScene] | None = None
        self._robot: tuple[Robot, Tool, Path] | None = None

    def build(self, task: Task, job: Rollout) -> World:
        folder = self._folder
        scene = job.scene_in(task)
        if self._scene is None or self._scene[0] is not scene:
            rigid = only_rigid(scene, task.name, "pybullet")
            self._scene = (scene, PreparedScene(rigid, folder))

        robot = task.robot
        known = self._robot
        if known is None or known[0] != robot or known[1] is not job.tool:
            file = robot_file(folder, robot, job.tool, visuals=False)
            self._robot = known = (robot, job.tool, file)

        forces = job.forces and job.record_hz > 0
        time_step = choose_step(job.tool, self._settings.time_step)
        return World(
            self._client,
            self._scene[1],
            robot,
            known[2],
            job.tool,
            job.trajectory,
            self._settings._replace(time_step=time_step),
            forces,
        )

    def render(self, task: Task, **view: Unpack[View]) -> Image:
        folder = self._folder
        if self._renderer is None:
            self._renderer = PyBulletRenderer(folder)
        return self._renderer.render(task, **view)
