"""Play jobs in engines that step one world at a time, and refuse what an engine can't do."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from typing import ClassVar

from core.design import DesignError, Tool
from core.errors import UserError
from core.interfaces import (
    Ability,
    Checkpoint,
    Outcome,
    Robot,
    Rollout,
    Simulator,
    Task,
    World,
)
from core.plugins import SIMULATOR, Plugins, installed
from core.robot.trajectory import at_home
from core.scene import Scene
from core.simulation.playback import play, stop_at
from core.solids.standing import MOST_HZ, find_rate, list_flights
from core.support.text import list_some

LIGHT_KG = 2e-4
"""What is lighter needs `Ability.LIGHT_BODIES`."""

USUAL_HZ = 400.0
"""What needs more steps a second needs `Ability.FINE_STEPS`."""

_LISTED = 4  # names of what needs something

# Another plan or tool does without them, so they are the candidate's fault, not the setting's.
_OF_DESIGNS = (Ability.GUARDS, Ability.LOOKS, Ability.TOOL_JOINTS, Ability.GRIPS)


def list_needs(scene: Scene, job: Rollout) -> Iterator[tuple[Ability, Sequence[str]]]:
    """Yield what a job in a scene needs that not every engine has, with the names of what needs it."""
    if job.reactions is not None and job.reactions.feels:
        yield Ability.GUARDS, ()

    if job.reactions is not None and job.reactions.looks:
        yield Ability.LOOKS, ()

    if job.tool.bearers:
        yield Ability.TOOL_JOINTS, [bearer.name for bearer in job.tool.bearers]

    if job.tool.gripping:
        yield Ability.GRIPS, [component.name for component in job.tool.gripping]

    yield from list_scene_needs(scene)

    if job.forces and job.record_hz > 0:
        yield Ability.FORCES, ()


def list_scene_needs(scene: Scene) -> Iterator[tuple[Ability, Sequence[str]]]:
    """Yield what a scene needs, whatever is played in it, with the names of what needs it."""
    if scene.softs:
        yield Ability.SOFT_BODIES, [soft.name for soft in scene.softs]

    if scene.joints:
        yield Ability.JOINTS, [joint.name for joint in scene.joints]

    if scene.bonds:
        yield Ability.BONDS, [bond.name for bond in scene.bonds]

    light = [body.name for body in scene.free if body.mass < LIGHT_KG]
    if light:
        yield Ability.LIGHT_BODIES, light

    fast = [flight.body for flight in list_flights(scene) if flight.rate > USUAL_HZ]
    if fast:
        yield Ability.FINE_STEPS, fast

    launched = [body.name for body in scene.free if body.launched]
    if launched:
        yield Ability.LAUNCHED_BODIES, launched


def check_support(simulator: Simulator, task: str, scene: Scene, job: Rollout) -> None:
    """Refuse a job that needs what an engine does not support. Nothing that a job asks for is ignored.

    Args:
        simulator: the engine.
        task: its name, for the message.
        scene: that the job is played in.
        job: what is to be played.

    Raises:
        DesignError: the candidate needs it.
        UserError: the scene needs it, or the task's reward.
    """
    for ability, names in list_needs(scene, job):
        if ability in simulator.supports:
            continue

        what = ability.value
        if names:
            what += f" ({list_some(names, _LISTED)})"

        problem = f"{_name(simulator)} does not support {what}"
        if ability in _OF_DESIGNS:
            raise DesignError(problem)

        others = _find_supporting(ability)
        advice = "no engine here does"
        if others:
            advice = "use " + " or ".join(f"sim={name}" for name in others)
        raise UserError(f"{task}: {problem}; {advice}")


def _name(simulator: Simulator) -> str:
    """Name an engine as a user does."""
    offer = Plugins.origin(simulator)
    if offer is None:
        return type(simulator).__name__
    return f"sim={offer.name}"


def _find_supporting(ability: Ability) -> list[str]:
    """Name the engines here that have an ability."""
    names = []
    for offer in installed().offers.values():
        if offer.kind != SIMULATOR.name:
            continue

        with suppress(UserError):  # its package is missing
            engine = installed().factory(offer.kind, offer.name)
            if ability in getattr(engine, "supports", ()):
                names.append(offer.name)

    return sorted(names)


def scene_of(job: Rollout, task: Task) -> Scene:
    """Return the scene to play in, with its fixture: the job's, or the task's layout; one object for its jobs."""
    if job.scene is None:
        return _layout(task, job.seed).furnished(job.tool)

    return job.scene


@lru_cache(maxsize=4)
def _layout(task: Task, seed: int) -> Scene:
    return task.scene(seed)


def find_steps_hz(scene: Scene, outcome: Outcome) -> float:
    """Return how many steps a second an outcome's rollout should have had, twice, four times ... those; 0: no more."""
    recording = outcome.recording
    if recording is None or outcome.time_step <= 0:
        return 0.0

    times = find_rate(scene, recording.states) * outcome.time_step
    if times <= 1:
        return 0.0

    finer: float = 2 ** math.ceil(math.log2(times)) / outcome.time_step
    return min(finer, MOST_HZ)


def refuse_hurried(scene: Scene, outcome: Outcome) -> Outcome:
    """Return an outcome, or an error where its rollout needed finer steps, for an engine that has one step for all."""
    rate = find_steps_hz(scene, outcome)
    if rate <= 0:
        return outcome

    return Outcome(
        None,
        None,
        error=f"a small body got so fast that it needs {rate:.0f} steps a second, and this engine has "
        f"{1 / outcome.time_step:.0f}; use another one",
    )


class SteppingSimulator(Simulator):
    """An engine that plays each job in a world which is stepped. It says how a world is built, and the rest is here.

    Attributes:
        title: of the engine, for people.
        failures: what the engine raises where it can't go on.
    """

    title: ClassVar[str] = ""
    failures: ClassVar[tuple[type[Exception], ...]] = ()

    @abstractmethod
    def build(self, robot: Robot, scene: Scene, job: Rollout) -> World:
        """Build the world of a job, or take one that was built before and begin anew.

        Args:
            robot: the arm, at the first targets of the job's motion.
            scene: in the layout that is played.
            job: says the tool, and whether forces of contacts are measured.
        """

    def rollout(self, task: Task, jobs: Sequence[Rollout]) -> list[Outcome]:
        return [self._play(task, job) for job in jobs]

    def stop_at(self, task: Task, job: Rollout, instant: float) -> Checkpoint:
        return stop_at(self._build(task, job), job, instant)

    def world(self, task: Task, tool: Tool, seed: int = 0) -> World:
        return self._build(task, Rollout(tool, at_home(task), seed))

    def _build(self, task: Task, job: Rollout) -> World:
        scene = scene_of(job, task)
        check_support(self, task.name, scene, job)
        return self.build(task.robot, scene, job)

    def _play(self, task: Task, job: Rollout) -> Outcome:
        """Play a job; once more with finer steps, where a small body got too fast for those that there were."""
        try:
            outcome = play(self._build(task, job), job)
            steps_hz = find_steps_hz(scene_of(job, task), outcome)
            finer = replace(job, steps_hz=steps_hz, begins=None)
            if finer.steps_hz > 0:
                outcome = play(self._build(task, finer), finer)
        except self.failures as error:
            return Outcome(None, None, error=f"{self.title}: {error}")

        return outcome
