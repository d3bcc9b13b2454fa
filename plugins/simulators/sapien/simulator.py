"""Rollouts in SAPIEN: PhysX on the CPU, in one process; physics needs no graphics."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from core.design import Tool
from core.errors import NoPicture, UsageError, UserError, check_positive
from core.geometry import Array
from core.interfaces import Image, Outcome, Rollout, Simulator, Task
from core.kinematics import arm as panda_arm
from core.playback import play
from core.plugins import installed
from core.robot import FINGER_OPEN
from core.scene import Camera, State
from core.trajectory import at_home
from plugins.simulators.sapien.bodies import Weighed
from plugins.simulators.sapien.renderer import Renderer
from plugins.simulators.sapien.world import World

MAX_TIME_STEP = 0.02
_STAND_IN = "pybullet"


class SapienSimulator(Simulator):
    """One PhysX scene after another, each fresh: nothing of a rollout reaches the next.

    Args:
        time_step: seconds.
        solver_iterations: over the positions of what touches, per step.
        tracking_rate: how fast a joint closes in on its target, 1/s.
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
        self._draws: Renderer | Simulator | None = None

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
        """The scene, made once for jobs in a row that are of one task and seed."""
        if self._placed is None or self._placed[0] is not task or self._placed[1] != seed:
            self._placed = (task, seed, Weighed(task.scene(seed)))
        return self._placed[2]

    def render(
        self,
        task: Task,
        *,
        seed: int = 0,
        tool: Tool | None = None,
        arm: Array | None = None,
        fingers: Array | None = None,
        state: State | None = None,
        camera: Camera | None = None,
        width: int = 640,
        height: int = 480,
    ) -> Image:
        """By SAPIEN's own renderer where Vulkan is there, otherwise by PyBullet's; ``drawn_by`` tells which it was.

        Raises:
            NoPicture: there is neither.
        """
        renderer = self._renderer()
        if not isinstance(renderer, Renderer):
            return renderer.render(
                task,
                seed=seed,
                tool=tool,
                arm=arm,
                fingers=fingers,
                state=state,
                camera=camera,
                width=width,
                height=height,
            )
        renderer.load(task, seed, tool)
        renderer.pose(
            arm if arm is not None else panda_arm().home_for(task.home),
            fingers if fingers is not None else np.full(2, FINGER_OPEN),
            state if state is not None else task.scene(seed).state(),
        )
        return renderer.shoot(camera or task.camera, width, height)

    def _renderer(self) -> Renderer | Simulator:
        if self._draws is not None:
            return self._draws
        try:
            own = Renderer()
        except RuntimeError as error:
            missing = f"SAPIEN's own renderer needs Vulkan ({error})"
            try:
                other: Simulator = installed().create("sim", _STAND_IN)
            except UserError as reason:
                raise NoPicture(f"{missing}, and {_STAND_IN}'s can't stand in for it: {reason}") from error
            self.drawn_by = f"{_STAND_IN}'s renderer: {missing}"
            self._draws = other
            return other
        self.drawn_by = f"SAPIEN's renderer on {own.device}"
        self._draws = own
        return own
