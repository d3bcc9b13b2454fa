"""Play rollouts in PyBullet, in one process, without a window."""

from __future__ import annotations

import tempfile
import weakref
from collections.abc import Sequence
from pathlib import Path
from typing import Unpack

from core.design import Tool
from core.errors import UsageError, check_positive
from core.interfaces import Image, Outcome, Rollout, Simulator, Task
from core.robot.trajectory import at_home
from core.simulation.playback import play
from core.simulation.rendering import View, draw
from plugins.simulators.pybullet.engine import pybullet
from plugins.simulators.pybullet.renderer import Renderer
from plugins.simulators.pybullet.world import PreparedScene, World, robot_file

MAX_TIME_STEP = 0.02


class PyBulletSimulator(Simulator):
    """Play each job in a fresh world, so that no rollout affects the next.

    Args:
        time_step: seconds.
        solver_iterations: of the contact solver, per step.
        tracking_rate: how fast a joint converges to its target, 1/s, independent of the time step.
        separation_rate: how fast overlapping bodies are pushed apart, 1/s. With PyBullet's own default, five times as
            much, a struck body leaves a fifth faster than it was struck.
    """

    def __init__(
        self,
        time_step: float = 0.002,
        solver_iterations: int = 50,
        tracking_rate: float = 50.0,
        separation_rate: float = 25.0,
    ) -> None:
        check_positive(
            "sim.",
            time_step=time_step,
            solver_iterations=solver_iterations,
            tracking_rate=tracking_rate,
            separation_rate=separation_rate,
        )
        if time_step > MAX_TIME_STEP:
            raise UsageError(f"sim.time_step must be at most {MAX_TIME_STEP} s, got {time_step}: contacts would break")
        self.time_step = time_step
        self.solver_iterations = solver_iterations
        self.tracking_rate = tracking_rate
        self.separation_rate = separation_rate
        self._folder = tempfile.TemporaryDirectory(prefix="vlmgineer-")
        self._client = pybullet.connect(pybullet.DIRECT)
        weakref.finalize(self, pybullet.disconnect, self._client)
        self._renderer: Renderer | None = None
        # Those of the last job, since consecutive jobs mostly share them; the world is fresh each time.
        self._scene: tuple[Task, int, PreparedScene] | None = None
        self._robot: tuple[Tool, Path] | None = None

    def rollout(self, task: Task, jobs: Sequence[Rollout]) -> list[Outcome]:
        return [self._one(task, job) for job in jobs]

    def _one(self, task: Task, job: Rollout) -> Outcome:
        try:
            world = self._world(task, job)
            return play(world, job)
        except pybullet.error as error:
            return Outcome(None, None, error=f"PyBullet: {error}")

    def world(self, task: Task, tool: Tool, seed: int = 0) -> World:
        return self._world(task, Rollout(tool, at_home(task), seed))

    def _world(self, task: Task, job: Rollout) -> World:
        return World(
            self._client,
            self._prepared(task, job.seed),
            self._robot_file(job.tool),
            job.tool,
            job.trajectory,
            time_step=self.time_step,
            solver_iterations=self.solver_iterations,
            tracking_rate=self.tracking_rate,
            separation_rate=self.separation_rate,
        )

    def _prepared(self, task: Task, seed: int) -> PreparedScene:
        if self._scene is None or self._scene[0] is not task or self._scene[1] != seed:
            self._scene = task, seed, PreparedScene(task.scene(seed), Path(self._folder.name))
        return self._scene[2]

    def _robot_file(self, tool: Tool) -> Path:
        if self._robot is None or self._robot[0] is not tool:
            self._robot = tool, robot_file(Path(self._folder.name), tool, visuals=False)
        return self._robot[1]

    def render(self, task: Task, **view: Unpack[View]) -> Image:
        if self._renderer is None:
            self._renderer = Renderer(Path(self._folder.name))
        return draw(self._renderer, task, **view)
