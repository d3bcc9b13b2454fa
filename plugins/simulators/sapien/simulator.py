"""Play rollouts in SAPIEN: PhysX on the CPU, in one process; physics needs no graphics."""

from __future__ import annotations

from core.interfaces import Ability, Robot, Rollout
from core.scene import Scene
from plugins.simulators.fresh import FreshWorlds
from plugins.simulators.rendering import DrawingSimulator
from plugins.simulators.sapien.bodies import Weighed
from plugins.simulators.sapien.world import Settings, World
from plugins.simulators.step_lengths import spare_cards


class SapienSimulator(FreshWorlds[Weighed], DrawingSimulator):
    """Play each job in a fresh PhysX scene, so that no rollout affects the next.

    Args:
        time_step: seconds.
        solver_iterations: position iterations of the contact solver, per step.
        tracking_rate: how fast a joint converges to its target, 1/s.
    """

    title = "SAPIEN"
    failures = (RuntimeError,)  # of PhysX
    # What is lighter than 0.2 g stops too soon: of 0.05 g it slides two thirds of its way, of 0.03 g a fifth.
    supports = FreshWorlds.supports - {Ability.LIGHT_BODIES}

    def __init__(
        self,
        time_step: float = 0.005,
        solver_iterations: int = 10,
        tracking_rate: float = 50.0,
    ) -> None:
        self._settings = Settings(solver_iterations, tracking_rate)
        super().__init__(time_step, **self._settings._asdict())

    def prepare(self, scene: Scene) -> Weighed:
        return Weighed(scene)

    def choose_time_step(self, scene: Scene) -> float:
        return spare_cards(scene, self._time_step)

    def place(
        self, prepared: Weighed, robot: Robot, job: Rollout, time_step: float
    ) -> World:
        return World(prepared, robot, job, self.folder, time_step, self._settings)
