"""Play each rollout in a fresh world, which is stepped from outside."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar, Protocol

from core.design import Tool
from core.interfaces import Outcome, Rollout, Simulator, Task, World
from core.robot.trajectory import at_home
from core.simulation.playback import play
from plugins.simulators.forces import Impulses


class FreshWorld(World, Protocol):
    """A world with one job's robot and scene; ``forces`` sums up those of contacts, if they are asked for."""

    @property
    def forces(self) -> Impulses | None: ...


class FreshWorlds(Simulator):
    """Play each job in a world of its own, so that no rollout affects the next.

    Attributes:
        title: of the engine.
        refusal: what the engine raises.
    """

    supports_guards = True
    title: ClassVar[str]
    refusal: ClassVar[type[Exception]]

    @abstractmethod
    def build(self, task: Task, job: Rollout) -> FreshWorld:
        """Build the job's world."""

    def rollout(self, task: Task, jobs: Sequence[Rollout]) -> list[Outcome]:
        return [self._play(task, job) for job in jobs]

    def world(self, task: Task, tool: Tool, seed: int = 0) -> FreshWorld:
        return self.build(task, Rollout(tool, at_home(task), seed))

    def _play(self, task: Task, job: Rollout) -> Outcome:
        try:
            world = self.build(task, job)
            outcome = play(world, job)
        except self.refusal as error:
            return Outcome(None, None, error=f"{self.title}: {error}")
        if world.forces and outcome.recording:
            return replace(outcome, recording=world.forces.measured(outcome.recording))
        return outcome
