"""Play rollouts in SAPIEN: PhysX on the CPU, in one process; physics needs no graphics."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Unpack

from core.design import Tool
from core.errors import UsageError, check_positive
from core.interfaces import Image, Outcome, Rollout, Simulator, Task
from core.robot.trajectory import at_home
from core.simulation.playback import play
from core.simulation.rendering import Pictures, View
from plugins.simulators.sapien.bodies import Weighed
from plugins.simulators.sapien.renderer import Renderer
from plugins.simulators.sapien.world import World

MAX_TIME_STEP = 0.02
_STAND_IN = "pybullet"


class SapienSimulator(Simulator):
    """Play each job in a fresh PhysX scene, so that no rollout affects the next.

    Args:
        time_step: seconds.
        solver_iterations: position iterations of the contact solver, per step.
        tracking_rate: how fast a joint converges to its target, 1/s.
    """

    def __init__(self, time_step: float = 0.005, solver_iterations: int = 10, tracking_rate: float = 50.0) -> None:
        check_positive("sim.", time_step=time_step, solver_iterations=solver_iterations, tracking_rate=tracking_rate)
        if time_step > MAX_TIME_STEP:
            raise UsageError(f"sim.time_step must be at most {MAX_TIME_STEP} s, got {time_step}: contacts would break")
        self.time_step = time_step
        self.solver_iterations = solver_iterations
        self.tracking_rate = tracking_rate
        self._folder = tempfile.TemporaryDirectory(prefix="vlmgineer-")
        self._placed: tuple[Task, int, Weighed] | None = None
        self._pictures = Pictures(Renderer, _STAND_IN)

    def rollout(self, task: Task, jobs: Sequence[Rollout]) -> list[Outcome]:
        return [self._one(task, job) for job in jobs]

    def _one(self, task: Task, job: Rollout) -> Outcome:
        try:
            return play(self._world(task, job), job)
        except RuntimeError as error:  # what PhysX refuses
            return Outcome(None, None, error=f"SAPIEN: {error}")

    def world(self, task: Task, tool: Tool, seed: int = 0) -> World:
        return self._world(task, Rollout(tool, at_home(task), seed))

    def _world(self, task: Task, job: Rollout) -> World:
        return World(
            Path(self._folder.name),
            self._weighed(task, job.seed),
            job.tool,
            job.trajectory,
            time_step=self.time_step,
            solver_iterations=self.solver_iterations,
            tracking_rate=self.tracking_rate,
        )

    def _weighed(self, task: Task, seed: int) -> Weighed:
        """Make the scene, once for consecutive jobs of one task and seed."""
        if self._placed is None or self._placed[0] is not task or self._placed[1] != seed:
            self._placed = (task, seed, Weighed(task.scene(seed)))
        return self._placed[2]

    def render(self, task: Task, **view: Unpack[View]) -> Image:
        """Draw with SAPIEN's own renderer where Vulkan is there, otherwise with PyBullet's.

        ``drawn_by`` names the renderer.

        Raises:
            NoPicture: neither is available.
        """
        picture = self._pictures.render(task, **view)
        self.drawn_by = self._pictures.drawn_by
        return picture
