"""Play rollouts in SAPIEN: PhysX on the CPU, in one process; physics needs no graphics."""

from __future__ import annotations

from core.errors import check_positive
from core.interfaces import Rollout, Task
from core.scene import Scene
from core.support.scratch import temporary_folder
from plugins.simulators.fresh import FreshWorlds
from plugins.simulators.rendering import DrawingSimulator
from plugins.simulators.rigid import only_rigid
from plugins.simulators.sapien.bodies import Weighed
from plugins.simulators.sapien.world import Settings, World
from plugins.simulators.steps import check_time_step, choose_step


class SapienSimulator(FreshWorlds, DrawingSimulator):
    """Play each job in a fresh PhysX scene, so that no rollout affects the next.

    Args:
        time_step: seconds.
        solver_iterations: position iterations of the contact solver, per step.
        tracking_rate: how fast a joint converges to its target, 1/s.
    """

    title = "SAPIEN"
    refusal = RuntimeError  # of PhysX

    def __init__(
        self,
        time_step: float = 0.005,
        solver_iterations: int = 10,
        tracking_rate: float = 50.0,
    ) -> None:
        self._settings = Settings(time_step, solver_iterations, tracking_rate)
        check_positive("sim.", **self._settings._asdict())
        check_time_step(time_step)
        self._folder = temporary_folder()
        self._placed: tuple[Scene, Weighed] | None = (
            None  # of the last job: consecutive ones mostly share it
        )

    def build(self, task: Task, job: Rollout) -> World:
        scene = job.scene_in(task)
        if self._placed is None or self._placed[0] is not scene:
            self._placed = (scene, Weighed(only_rigid(scene, task.name, "sapien")))
        folder = self._folder
        forces = job.forces and job.record_hz > 0
        time_step = choose_step(job.tool, self._settings.time_step)
        return World(
            folder,
            self._placed[1],
            task.robot,
            job.tool,
            job.trajectory,
            self._settings._replace(time_step=time_step),
            forces,
        )
