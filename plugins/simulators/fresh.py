"""Play each rollout in a fresh world, which is stepped from outside."""

from __future__ import annotations

import tempfile
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar

from core.design import Tool
from core.errors import check_positive
from core.interfaces import Outcome, Robot, Rollout, Simulator, Task, World
from core.robot.trajectory import at_home
from core.scene import Scene, State
from core.simulation.playback import play
from core.support.scratch import scratch
from plugins.simulators.forces import Impulses
from plugins.simulators.rigid import only_rigid
from plugins.simulators.scenes import scene_of
from plugins.simulators.steps import check_time_step, choose_step

Prepared = TypeVar("Prepared")


class FreshWorld(World):
    """A world with one job's robot and scene, stepped by its caller.

    Attributes:
        forces: sums up those of contacts; None: they are not asked for.
    """

    forces: Impulses | None = None

    @abstractmethod
    def snapshot(self) -> Any:
        """Take a snapshot of the joints and free bodies, in the form that is fastest to get."""

    def note(self) -> Any:
        """Take a snapshot at an instant of the recording."""
        if self.forces:
            self.forces.note()
        return self.snapshot()

    def state(self) -> State:
        """Read the state of the free bodies."""
        _, _, states = self.read([self.snapshot()])
        return states[0]


class FreshWorlds(Simulator, Generic[Prepared]):
    """Play each job in a world of its own, so that no rollout affects the next.

    Attributes:
        title: of the engine, for people.
        name: as in ``sim=NAME``.
        refusal: what the engine raises.
        folder: for files, which goes with the simulator.

    Args:
        time_step: seconds.
        settings: others, which must be above 0, too.
    """

    supports_guards = True
    title: ClassVar[str]
    name: ClassVar[str]
    refusal: ClassVar[type[Exception]]

    def __init__(self, time_step: float, **settings: float) -> None:
        check_positive("sim.", **settings)
        check_time_step(time_step)
        self._time_step = time_step
        # It is removed with the process's own: a forked one leaves it alone.
        self.folder = Path(tempfile.mkdtemp(dir=scratch()))
        # That of the last job, since consecutive jobs mostly share it.
        self._prepared: tuple[Scene, Prepared] | None = None

    @abstractmethod
    def prepare(self, scene: Scene) -> Prepared:
        """Prepare a scene to be placed in one world after another."""

    @abstractmethod
    def build(
        self, prepared: Prepared, robot: Robot, job: Rollout, time_step: float
    ) -> FreshWorld:
        """Build a job's world, with the time step, s, that its tool needs."""

    def rollout(self, task: Task, jobs: Sequence[Rollout]) -> list[Outcome]:
        return [self._play(task, job) for job in jobs]

    def world(self, task: Task, tool: Tool, seed: int = 0) -> FreshWorld:
        return self._build(task, Rollout(tool, at_home(task), seed))

    def _build(self, task: Task, job: Rollout) -> FreshWorld:
        scene = scene_of(job, task)
        if self._prepared is None or self._prepared[0] is not scene:
            only_rigid(scene, task.name, self.name)
            self._prepared = (scene, self.prepare(scene))

        time_step = choose_step(job.tool, self._time_step)
        return self.build(self._prepared[1], task.robot, job, time_step)

    def _play(self, task: Task, job: Rollout) -> Outcome:
        try:
            world = self._build(task, job)
            outcome = play(world, job)
        except self.refusal as error:
            return Outcome(None, None, error=f"{self.title}: {error}")

        if world.forces and outcome.recording:
            return replace(outcome, recording=world.forces.measured(outcome.recording))
        return outcome
