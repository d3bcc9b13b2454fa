"""How much does a population cost beyond the engine's own steps? ``python -m tests.benchmarks.throughput task=BringCube
sim=pybullet workers=2 tools=20 plans=10``.

Designs of the embedded designer are tried as a run tries them, with a clock in each part, after all workers have
started. The code that is measured is unchanged: clocks are put around its functions. The result goes to ``output`` as
JSON.
"""

from __future__ import annotations

import functools
import importlib
import itertools
import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.progress import Progress

from core.config.compose import load, node, part
from core.design import Candidate
from core.errors import UsageError, choices
from core.interfaces import Executor, RolloutSettings
from core.plugins import PluginPart
from core.search.trials import Chunk
from core.simulation import attempt, engines, judging
from core.simulation.play import play
from core.support.cli import arguments, command
from core.trial import Condition, Trial
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
    cfg = load(
        "evaluate",
        [
            *words,
            "designs=none",
            f"executor={given.executor}",
            f"executor.workers={workers}",
        ],
    )
    sim = part("sim", cfg.sim)
    steps_of(sim.name)
    condition = Condition(
        PluginPart("task", task), sim, given.seed, node(cfg.rollout, RolloutSettings)
    )
    candidates = measuring.designs(task, given.tools, given.plans, given.seed)

    with part("executor", cfg.executor).create() as executor:
        figures = population(candidates, condition, executor, workers)

    found = {
        "task": task,
        "sim": {"name": sim.name, **dict(sim.settings)},
        "executor": given.executor,
    } | figures
    measuring.save(Path(given.output), found)
    sys.stdout.write(summary(found) + f"{given.output}\n")


def population(
    candidates: Sequence[Candidate],
    condition: Condition,
    executor: Executor,
    workers: int,
) -> dict[str, Any]:
    """Measure rollouts per second, and the time of each part."""
    clock = Clocked()
    alike = itertools.groupby(candidates, key=lambda candidate: candidate.design)
    chunks = [Chunk(condition, tuple(group)) for _, group in alike]
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        single = Chunk(condition, (candidates[0],))
        for _, result in executor.map(Roll(folder, workers, clock), [single] * workers):
            if isinstance(result, Exception):
                raise result
    started = time.perf_counter() - began

    began = time.perf_counter()
    tried = executor.map(clock, chunks)
    total: Counter[str] = Counter()
    statuses: Counter[str] = Counter()
    shown = Progress(
        console=measuring.console, disable=not measuring.console.is_terminal
    )
    with shown:
        bar = shown.add_task("rollouts", total=len(candidates))
        for _, result in tried:
            if isinstance(result, Exception):
                raise result
            trials, took = result
            total.update(took)
            statuses.update(trial.status for trial in trials)
            shown.advance(bar, len(trials))
    wall = time.perf_counter() - began

    all_time = workers * wall
    parts = {
        "stepping": total["step"],
        "driving": total["playing"]
        - total["step"],  # commands, states and recordings between steps
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
        "tried": statuses,
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
    """Seconds inside functions, by name. A function inside another is counted in both.

    Args:
        now: tells the time, seconds.
    """

    def __init__(self, now: Callable[[], float] = time.perf_counter) -> None:
        self.seconds: dict[str, float] = {}
        self.steps = 0
        self._now = now
        self._replaced: list[tuple[Any, str, Any]] = []

    def around(self, holder: Any, name: str, label: str) -> None:
        """Replace a function by a timed one."""
        inner: Callable[..., Any] = getattr(holder, name)
        self.seconds.setdefault(label, 0.0)
        self._replaced.append((holder, name, inner))

        @functools.wraps(inner)
        def timed(*args: Any, **named: Any) -> Any:
            began = self._now()
            try:
                return inner(*args, **named)
            finally:
                self.seconds[label] += self._now() - began
                self.steps += label == "step"

        setattr(holder, name, timed)

    def remove(self) -> None:
        """Put the functions back."""
        for holder, name, inner in reversed(self._replaced):
            setattr(holder, name, inner)


_clocks: list[Clock] = []  # the process's


def _started(condition: Condition) -> Clock:
    """Return the process's clock, around the parts of this condition."""
    if not _clocks:
        play(condition, [])  # its parts are made before the clock runs
        clock = Clock()
        for holder, name in steps_of(condition.sim.name):
            clock.around(holder, name, "step")
        clock.around(attempt, "prepare", "ik")
        for holder, check in (
            (attempt, "_self_collision"),
            (attempt, "find_self_collision"),
            (judging, "findings"),
            (judging, "find_contacts"),
        ):
            clock.around(holder, check, "checks")
        task = condition.task.shared()
        simulator = condition.sim.shared()
        clock.around(type(task), "reward", "reward")
        clock.around(type(simulator), "rollout", "simulator")
        clock.around(engines, "play", "playing")
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
        found.append(
            (functools.reduce(getattr, outer, importlib.import_module(module)), name)
        )
    return found


@dataclass(frozen=True)
class Clocked:
    """Try a chunk, and return its trials with the times that they took."""

    def __call__(self, chunk: Chunk) -> tuple[list[Trial], dict[str, float]]:
        clock = _started(chunk.condition)
        before = dict(clock.seconds)
        steps = clock.steps
        began = time.perf_counter()
        trials = play(chunk.condition, chunk.candidates)
        took: dict[str, float] = {
            "chunk": time.perf_counter() - began,
            "steps": clock.steps - steps,
        }
        took |= {label: total - before[label] for label, total in clock.seconds.items()}
        return trials, took


@dataclass(frozen=True)
class Roll:
    """Hold each worker until all of them have started and have made their parts."""

    folder: str
    workers: int
    clocked: Clocked

    def __call__(self, chunk: Chunk) -> None:
        self.clocked(chunk)
        (Path(self.folder) / str(os.getpid())).touch()
        while len(list(Path(self.folder).iterdir())) < self.workers:
            time.sleep(0.01)


if __name__ == "__main__":
    command(lambda _: main())
