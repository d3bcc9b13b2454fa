"""How much dearer are soft bodies than rigid ones? ``python -m tests.benchmarks.soft [layouts=N]``.

Plays the reference solutions of all benchmarks in MuJoCo in layouts of the test, one after another in this process, and
prints rollouts per second of processor time, and for each soft task how many times the median rigid task it takes.
"""

from __future__ import annotations

import statistics
import sys
import time
from dataclasses import dataclass

from core.interfaces import RolloutSettings
from core.plugins import installed
from core.simulation.rollout import evaluate_batch
from core.support.cli import command
from plugins.fitness.layouts import UNSEEN
from tests.benchmarks import measuring
from tests.solutions import FILES, anchored


@dataclass
class Settings:
    """``layouts``: of each task; the time of a first one, which compiles, is left out."""

    layouts: int = 3


def seconds(name: str, layouts: int) -> float:
    """Measure the processor time of a rollout of a task's reference solution, the median of some layouts."""
    task = installed().create("task", name, variation="wide")
    simulator = installed().create("sim", "mujoco")
    solution = anchored(name)
    times = []
    for seed in range(UNSEEN, UNSEEN + layouts + 1):
        begun = time.process_time()
        evaluate_batch(task, simulator, [solution], seed, RolloutSettings())
        times.append(time.process_time() - begun)
    return statistics.median(times[1:])


def main() -> None:
    given = measuring.settings(sys.argv[1:], Settings)
    found = {name: seconds(name, given.layouts) for name in sorted(FILES)}
    soft = [name for name in found if installed().create("task", name).scene(0).softs]
    rigid = statistics.median(taken for name, taken in found.items() if name not in soft)
    sys.stdout.write(
        f"| task | rollouts/s | times the median rigid task |\n|---|---|---|\n| rigid | {1 / rigid:.1f} | 1 |\n"
    )
    for name in soft:
        sys.stdout.write(f"| {name} | {1 / found[name]:.1f} | {found[name] / rigid:.1f} |\n")


if __name__ == "__main__":
    command(lambda _: main())
