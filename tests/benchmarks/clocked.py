"""Time the parts of an evaluator, and run the reference that it is compared with.

The code that is measured is unchanged: clocks are put around its functions, in the process that runs them.
"""

from __future__ import annotations

import functools
import importlib
import json
import os
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import core.simulation.rollout
from core.design import Candidate, Evaluation
from core.designs.reading import load_designs, read_designs
from core.designs.rules import SpawnRules
from core.errors import choices
from core.geometry import Array
from core.interfaces import Outcome, Rollout, RolloutSettings
from core.plugins import installed
from core.scene import State
from core.simulation.playback import World, schedule, targets
from core.simulation.rollout import Evaluator, prepare
from tests.panda import ARM

STEPS = {  # where each engine's own steps are called: nothing of ours is in there
    "pybullet": ["pybullet:stepSimulation"],
    "sapien": ["sapien.physx:PhysxCpuSystem.step"],
    # A whole trajectory's steps, or one where forces are measured or latches pull.
    "mujoco": ["plugins.simulators.mujoco.world:rollout", "mujoco:mj_step"],
}
PLAYED = ("pybullet", "sapien")  # by `core.simulation.playback.play`, step by step


class Clock:
    """Seconds inside functions, by name; wall-clock by default. A function inside another is counted in both."""

    def __init__(self, now: Callable[[], float] = time.perf_counter) -> None:
        self._now = now
        self.seconds: dict[str, float] = {}
        self.calls: dict[str, int] = {}

    def around(self, holder: Any, name: str, label: str) -> None:
        """Replace a function by a timed one."""
        inner: Callable[..., Any] = getattr(holder, name)
        self.seconds.setdefault(label, 0.0)
        self.calls.setdefault(label, 0)
        seconds = self.seconds
        calls = self.calls
        now = self._now

        @functools.wraps(inner)
        def timed(*args: Any, **named: Any) -> Any:
            began = now()
            try:
                return inner(*args, **named)
            finally:
                seconds[label] += now() - began
                calls[label] += 1

        setattr(holder, name, timed)


_clock: Clock | None = None


def _started(evaluator: Evaluator) -> Clock:
    """Return the process's clock, around the parts of this evaluator."""
    global _clock
    if _clock is None:
        evaluator([])  # its parts are made before the clock runs
        clock = Clock()
        for holder, name in steps_of(evaluator.sim.name):
            clock.around(holder, name, "step")
        clock.around(core.simulation.rollout, "prepare", "ik")
        for check in ("findings", "_self_collision", "find_self_collision", "find_contacts"):
            clock.around(core.simulation.rollout, check, "checks")
        task = core.simulation.rollout._task(evaluator.task)
        simulator = core.simulation.rollout._simulator(evaluator.sim)
        clock.around(type(task), "reward", "reward")
        clock.around(type(simulator), "rollout", "simulator")
        module = sys.modules[type(simulator).__module__]
        if hasattr(module, "play"):
            clock.around(module, "play", "playing")
        elif hasattr(module, "World"):  # an engine that plays by itself
            clock.around(module.World, "play", "playing")
        _clock = clock
    return _clock


def steps_of(sim: str) -> list[tuple[Any, str]]:
    """Return what holds each of the engine's step functions, and the function's name.

    Raises:
        UsageError: the step function of this engine isn't known.
    """
    if sim not in STEPS:
        raise choices("sim", sim, list(STEPS), "engines whose step function is known")
    found = []
    for module, path in (step.split(":") for step in STEPS[sim]):
        *outer, name = path.split(".")
        found.append((functools.reduce(getattr, outer, importlib.import_module(module)), name))
    return found


@dataclass(frozen=True)
class Clocked:
    """Evaluate as ``evaluator`` does, with the chunk's times in ``figures`` of its first evaluation."""

    evaluator: Evaluator

    def __call__(self, candidates: Sequence[Candidate]) -> list[Evaluation]:
        clock = _started(self.evaluator)
        before = dict(clock.seconds)
        calls = dict(clock.calls)
        began = time.perf_counter()
        cpu = time.process_time()
        evaluations = self.evaluator(candidates)
        took: dict[str, Any] = {label: total - before[label] for label, total in clock.seconds.items()}
        took["chunk"] = time.perf_counter() - began
        took["cpu"] = time.process_time() - cpu
        took["steps"] = clock.calls["step"] - calls["step"]
        took["pid"] = os.getpid()
        took["peak_mb"] = peak_mb()
        took["mb"] = resident_mb()
        return [replace(evaluations[0], figures=took), *evaluations[1:]]


@dataclass(frozen=True)
class Still:
    """Give every candidate a reward of 0 without simulating it."""

    def __call__(self, candidates: Sequence[Candidate]) -> list[Evaluation]:
        return [Evaluation(candidate, "ok", moved_m={"cube": 0.0}) for candidate in candidates]


@dataclass(frozen=True)
class Roll:
    """Hold each worker until all of them have started and have made their parts."""

    folder: str
    workers: int
    clocked: Clocked

    def __call__(self, chunk: Sequence[Any]) -> list[Any]:
        _started(self.clocked.evaluator)
        self.clocked.evaluator(chunk)
        (Path(self.folder) / str(os.getpid())).touch()
        while len(list(Path(self.folder).iterdir())) < self.workers:
            time.sleep(0.01)
        return [None] * len(chunk)


def peak_mb() -> float:
    """Return the most memory that this process had so far; nan where there is no /proc.

    getrusage won't do: its figure begins with that of the parent process.
    """
    return _memory_mb("VmHWM")


def resident_mb() -> float:
    """Return the memory that this process has now; nan where there is no /proc."""
    return _memory_mb("VmRSS")


def _memory_mb(field: str) -> float:
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
    except OSError:
        return float("nan")
    (line,) = (line for line in lines if line.startswith(f"{field}:"))
    return int(line.split()[1]) / 1024


# --- the reference ----------------------------------------------------------------------------------------------


class _Solving:
    """A world that is given poses, and computes the joints at each step."""

    def __init__(self, world: World, job: Rollout) -> None:
        self._world = world
        self.time_step = world.time_step
        self._arm = ARM
        self._joints = job.trajectory.arm[0]
        settle, times = schedule(job, world.time_step)
        moving = round(job.trajectory.duration / world.time_step)
        self._poses = [self._arm.forward(q) for q in targets(job.trajectory, times, world.time_step)[0]]
        self._solve = range(settle, settle + moving)
        self._count = 0

    def step(self, arm: Array, fingers: float, speeds: Array, finger_speed: float) -> None:
        if self._count in self._solve:
            self._joints = self._arm.inverse(self._poses[self._count], self._joints).joints
        self._count += 1
        self._world.step(self._joints, fingers, speeds, finger_speed)

    def joints(self) -> tuple[Array, Array]:
        return self._world.joints()

    def state(self) -> State:
        return self._world.state()


def reference(task_name: str, sim: str, designs: str, number: int, seed: int) -> float:
    """Return the reward of one rollout as a plain script does it: everything is loaded for it, and inverse kinematics
    is computed at each step of 1 ms.
    """
    plugins = installed()
    task = plugins.create("task", task_name)
    simulator = plugins.create("sim", sim, {"time_step": 0.001})
    candidates = read_designs(load_designs(Path(designs)), plugins.create("tool", "urdf"), SpawnRules(task, seed))
    candidate = [c for c in candidates if c.problem is None][number]
    _, job = prepare(task, candidate, seed, RolloutSettings())
    module = sys.modules[type(simulator).__module__]
    play: Callable[[Any, Rollout], Outcome] = module.play  # type: ignore[attr-defined]
    module.play = lambda world, job: play(_Solving(world, job), job)  # type: ignore[attr-defined]
    (outcome,) = simulator.rollout(task, [job])
    if outcome.start is None or outcome.end is None:
        return 0.0
    complete = task.scene(seed).complete
    return float(np.asarray(task.reward(complete(outcome.start), complete(outcome.end))))


if __name__ == "__main__":
    sys.stdout.write(f"{reference(**json.loads(sys.argv[1]))}\n")
