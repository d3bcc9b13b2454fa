"""Play rollouts in SAPIEN: PhysX on the CPU, in one process; physics needs no graphics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from core.design import Tool
from core.errors import check_positive
from core.interfaces import Outcome, Robot, Rollout, Task
from core.robot.trajectory import at_home
from core.simulation.playback import play
from core.support.scratch import intact, temporary_folder
from plugins.simulators.rendering import DrawingSimulator
from plugins.simulators.rigid import only_rigid
from plugins.simulators.sapien.bodies import Weighed
from plugins.simulators.sapien.world import Settings, World
from plugins.simulators.steps import Speed, step_length


class SapienSimulator(DrawingSimulator):
    """Play each job in a fresh PhysX scene, so that no rollout affects the next.

    Args:
        time_step: seconds.
        speed: with ``fast`` steps are twice as long; what passes through something is played again with usual ones.
        solver_iterations: position iterations of the contact solver, per step.
        tracking_rate: how fast a joint converges to its target, 1/s.
    """

    feels = True

    def __init__(
        self,
        time_step: float = 0.005,
        speed: Speed = "accurate",
        solver_iterations: int = 10,
        tracking_rate: float = 50.0,
    ) -> None:
        self._settings = Settings(step_length(time_step, speed), solver_iterations, tracking_rate)
        check_positive("sim.", **self._settings._asdict())
        if speed == "fast":
            self.usual = SapienSimulator(time_step, "accurate", solver_iterations, tracking_rate)
        self._folder = temporary_folder()
        self._placed: tuple[Task, int, Weighed] | None = None  # of the last job: consecutive ones mostly share it

    def rollout(self, task: Task, jobs: Sequence[Rollout]) -> list[Outcome]:
        return [self._one(task, job) for job in jobs]

    def _one(self, task: Task, job: Rollout) -> Outcome:
        try:
            world = self._world(task, job)
            outcome = play(world, job)
        except RuntimeError as error:  # what PhysX refuses
            return Outcome(None, None, error=f"SAPIEN: {error}")
        if world.forces and (taken := outcome.recording):
            return replace(outcome, recording=world.forces.measured(taken))
        return outcome

    def world(self, task: Task, tool: Tool, seed: int = 0) -> World:
        return self._world(task, Rollout(tool, at_home(task), seed))

    def _world(self, task: Task, job: Rollout) -> World:
        if self._placed is None or self._placed[0] is not task or self._placed[1] != job.seed:
            self._placed = (task, job.seed, Weighed(only_rigid(task.scene(job.seed), task.name, "sapien")))
        try:
            return self._built(task.robot, self._placed[2], job)
        except FileNotFoundError:  # something cleans the temporary folder
            self._folder = temporary_folder()
            return self._built(task.robot, self._placed[2], job)

    def _built(self, robot: Robot, weighed: Weighed, job: Rollout) -> World:
        folder = Path(self._folder.name)
        with intact(folder):
            forces = job.forces and job.record_hz > 0
            return World(folder, weighed, robot, job.tool, job.trajectory, self._settings, forces)
