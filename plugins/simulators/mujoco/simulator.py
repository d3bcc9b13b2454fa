"""Play rollouts in MuJoCo, in one process, without a window."""

from __future__ import annotations

from functools import lru_cache

from core.design import Tool
from core.errors import UsageError, check_positive
from core.interfaces import Ability, Robot, Rollout
from core.scene import Scene
from core.simulation.engines import SteppingSimulator
from plugins.simulators.mujoco.engine import mujoco
from plugins.simulators.mujoco.model import MAX_TIME_STEP, compile_model
from plugins.simulators.mujoco.renderer import MuJoCoRenderer
from plugins.simulators.mujoco.world import World
from plugins.simulators.rendering import DrawingSimulator

_KEPT = 4  # worlds: most batches have one tool


class MuJoCoSimulator(SteppingSimulator, DrawingSimulator):
    """Play jobs in one world per scene and tool, compiled once and reset for each job.

    Args:
        time_step: seconds.
        tracking_rate: how fast a joint converges to its target, 1/s, independent of the time step.
        slip_rate: how fast friction stops slow slip, 1/s; fast slip is limited by the coefficient of friction. With a
            much higher rate, sliding bodies hop. With rolling friction a quarter of it is used.
    """

    title = "MuJoCo"
    failures = (mujoco.FatalError, FloatingPointError)
    supports = frozenset(Ability)
    renderer = MuJoCoRenderer

    def __init__(
        self,
        time_step: float = 0.0025,
        tracking_rate: float = 50.0,
        slip_rate: float = 200.0,
    ) -> None:
        check_positive(
            "sim.",
            time_step=time_step,
            tracking_rate=tracking_rate,
            slip_rate=slip_rate,
        )
        if time_step > MAX_TIME_STEP:
            raise UsageError(
                f"sim.time_step must be at most {MAX_TIME_STEP} s, got {time_step}: contacts get soft"
            )
        self._rates = time_step, tracking_rate, slip_rate
        self._compile = lru_cache(maxsize=_KEPT)(self._compile_world)

    def build(self, robot: Robot, scene: Scene, job: Rollout) -> World:
        """Return the world of a job's scene and tool; the last few are kept."""
        world = self._compile(robot, scene, job.tool, job.steps_hz)
        world.begin(job)

        return world

    def _compile_world(
        self, robot: Robot, scene: Scene, tool: Tool, steps_hz: float
    ) -> World:
        model = compile_model(robot, scene, tool, *self._rates, steps_hz)
        return World(robot, scene, tool, model)
