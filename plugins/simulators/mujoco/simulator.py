"""Play rollouts in MuJoCo, in one process, without a window."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

from core.design import Tool
from core.errors import UsageError, check_positive
from core.interfaces import Outcome, Rollout, Task
from core.robot.trajectory import at_home
from plugins.simulators.mujoco.renderer import MuJoCoRenderer
from plugins.simulators.mujoco.world import MAX_TIME_STEP, Stepped, World, compiled, weighed
from plugins.simulators.rendering import DrawingSimulator

_KEPT = 4  # worlds: most batches have one tool


class MuJoCoSimulator(DrawingSimulator):
    """Play jobs in one world per scene and tool, compiled once and reset for each job.

    Args:
        time_step: seconds.
        tracking_rate: how fast a joint converges to its target, 1/s, independent of the time step.
        slip_rate: how fast friction stops slow slip, 1/s; fast slip is limited by the coefficient of friction. With a
            much higher rate, sliding bodies hop. With rolling friction a quarter of it is used.
    """

    renderer = MuJoCoRenderer
    feels = True
    softens = True

    def __init__(self, time_step: float = 0.0025, tracking_rate: float = 50.0, slip_rate: float = 200.0) -> None:
        check_positive("sim.", time_step=time_step, tracking_rate=tracking_rate, slip_rate=slip_rate)
        if time_step > MAX_TIME_STEP:
            raise UsageError(f"sim.time_step must be at most {MAX_TIME_STEP} s, got {time_step}: contacts get soft")
        self._rates = time_step, tracking_rate, slip_rate
        self._world = lru_cache(maxsize=_KEPT)(self._build)

    def rollout(self, task: Task, jobs: Sequence[Rollout]) -> list[Outcome]:
        return [self._world(task, job.seed, job.tool).play(job) for job in jobs]

    def world(self, task: Task, tool: Tool, seed: int = 0) -> Stepped:
        return self._world(task, seed, tool).stepped(at_home(task))

    def _build(self, task: Task, seed: int, tool: Tool) -> World:
        scene, inertias = weighed(task, seed)
        return World(task.robot, scene, tool, compiled(task.robot, scene, inertias, tool, *self._rates))
