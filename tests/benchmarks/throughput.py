"""How much does a population cost beyond the engine's own steps? ``python -m tests.benchmarks.throughput task=BringCube
sim=pybullet workers=2 tools=20 plans=10``.

Designs of the embedded designer are tried as a run tries them, with a clock in each part, after all workers have
started. The code that is measured is unchanged: clocks are put around its functions. The result goes to ``output`` as
JSON.
"""

from __future__ import annotations

import functools
import importlib
import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rich.progress import track

import core.simulation.rollout
from core.config.compose import load, node, part
from core.design import Candidate, Evaluation
from core.errors import UsageError, choices
from core.interfaces import Executor, RolloutSettings
from core.search.evolution import Trials
from core.simulation.rollout import Evaluator, PluginPart
from core.support.cli import arguments, command
from plugins.simulators import fresh
from tests.benchmarks import measuring

USAGE = (
    "usage: python -m tests.benchmarks.throughput [task=NAME] [sim=NAME] [time_step=SECONDS] [workers=N] [tools=N] "
    "[plans=N] [seed=N] [executor=NAME] [output=FILE.json]"
)

STEPS = {  # where each engine's own steps are called: nothing of ours is in there
    "pybullet": ["pybullet:stepSimulation"],
    "sapien": ["sapien.physx:PhysxCpuSystem.step"],
    # A whole trajectory's steps, or one where forces are measured or latches pull.
    "mujoco": ["plugins.simulators.mujoco.world:rollout", "mujoco:mj_step"],
}


@dataclass
class Settings:
    """``time_step``: the default is the engine's own."""

    task: str = "BringCube"
    sim: str = "pybullet"
    time_step: float | None = None
    workers: int | None = None
    tools: int = 20
    plans: int = 10
    seed: int = 0
    executor: str = "local"
    output: str = "throughput.json"


def main() -> None:
    given = measuring.settings(arguments(USAGE, sys.argv[1:]), Settings)
    (task,) = measuring.tasks([given.task])
    workers = measuring.workers(given.workers)
    for name in ("tools", "plans"):
        if getattr(given, name) < 1:
            raise UsageError(f"{name} must be at least 1, got {getattr(given, name)}")
    words = [f"task={task}", f"sim={given.sim}", f"seed={given.seed}"]
    if given.time_step is not None:
        words.append(f"sim.time_step={given.time_step}")
    cfg = load("evaluate", [*words, "designs=none", f"executor={given.executor}", f"executor.workers={workers}"])
    sim = part("sim", cfg.sim)
    steps_of(sim.name)
    evaluator = Evaluator(PluginPart("task", task), sim, given.seed, node(cfg.rollout, RolloutSettings))
    candidates = measuring.designs(task, given.tools, given.plans, given.seed)

    with part("executor", cfg.executor).create() as executor:
        figures = population(candidates, evaluator, executor, workers)

    found = {"task": task, "sim": {"name": sim.name, **dict(sim.settings)}, "executor": given.executor} | figures
    measuring.save(Path(given.output), found)
    sys.stdout.write(summary(found) + f"{given.output}\n")


def population(
    candidates: Sequence[Candidate], evaluator: Evaluator, executor: Executor, workers: int
) -> dict[str, Any]:
    """Measure rollouts per second, and the time of each part."""
    clock = Clocked(evaluator)
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        for _, result in executor.map(Roll(folder, workers, clock), [[c] for c in candidates[:1] * workers]):
            if isinstance(result, Exception):
                raise result
    started = time.perf_counter() - began

    began = time.perf_counter()
    tried = Trials(clock, executor)(candidates)
    shown = track(tried, total=len(candidates), console=measuring.console, disable=not measuring.console.is_terminal)
    evaluations = list(shown)
    wall = time.perf_counter() - began

    total: Counter[str] = Counter()
    for evaluation in evaluations:
        total.update(evaluation.figures)
    all_time = workers * wall
    parts = {
        "stepping": total["step"],
        "driving": total["playing"] - total["step"],  # commands, states and recordings between steps
        "loading": total["simulator"] - total["playing"],
        "ik": total["ik"],
        "checks": total["checks"],
        "reward": total["reward"],
    }
    parts["rest"] = total["chunk"] - sum(parts.values())
    parts["transport"] = all_time - total["chunk"]  # and waiting for the last
    return {
        "workers": workers,
        "rollouts": len(candidates),
        "tried": Counter(evaluation.status for evaluation in evaluations),
        "started_s": started,
        "wall_s": wall,
        "rollouts_per_s": len(candidates) / wall,
        "steps": total["steps"],
        "engine_s": total["step"],
        "overhead": all_time / total["step"],
        "overhead_in_worker": total["chunk"] / total["step"],
        "shares": {name: seconds / all_time for name, seconds in parts.items()},
    }


def summary(found: dict[str, Any]) -> str:
    """Return what is printed."""
    shares = ", ".join(f"{name} {share:.1%}" for name, share in found["shares"].items())
    return (
        f"{found['task']} in {found['sim']['name']}: {found['rollouts']} rollouts with {found['workers']} workers, "
        f"{found['rollouts_per_s']:.2f} a second\n"
        f"workers x wall / seconds in the engine's steps: {found['overhead']:.2f}\n"
        f"shares: {shares}\n"
    )


# --- the clock --------------------------------------------------------------------------------------------------


class Clock:
    """Seconds inside functions, by name. A function inside another is counted in both."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.steps = 0

    def around(self, holder: Any, name: str, label: str) -> None:
        """Replace a function by a timed one."""
        inner: Callable[..., Any] = getattr(holder, name)
        self.seconds.setdefault(label, 0.0)

        @functools.wraps(inner)
        def timed(*args: Any, **named: Any) -> Any:
            began = time.perf_counter()
            try:
                return inner(*args, **named)
            finally:
                self.seconds[label] += time.perf_counter() - began
                self.steps += label == "step"

        setattr(holder, name, timed)


_clocks: list[Clock] = []  # the process's


def _started(evaluator: Evaluator) -> Clock:
    """Return the process's clock, around the parts of this evaluator."""
    if not _clocks:
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
        own = sys.modules[type(simulator).__module__]
        player = fresh if isinstance(simulator, fresh.FreshWorlds) else own.World  # type: ignore[attr-defined]
        clock.around(player, "play", "playing")
        _clocks.append(clock)
    return _clocks[0]


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
        steps = clock.steps
        began = time.perf_counter()
        evaluations = self.evaluator(candidates)
        took: dict[str, Any] = {"chunk": time.perf_counter() - began, "steps": clock.steps - steps}
        took |= {label: total - before[label] for label, total in clock.seconds.items()}
        first, *others = (replace(evaluation, figures={}) for evaluation in evaluations)
        return [replace(first, figures=took), *others]


@dataclass(frozen=True)
class Roll:
    """Hold each worker until all of them have started and have made their parts."""

    folder: str
    workers: int
    clocked: Clocked

    def __call__(self, chunk: Sequence[Any]) -> list[Any]:
        self.clocked(chunk)
        (Path(self.folder) / str(os.getpid())).touch()
        while len(list(Path(self.folder).iterdir())) < self.workers:
            time.sleep(0.01)
        return [None] * len(chunk)


if __name__ == "__main__":
    command(lambda _: main())
