"""Search in rebuilt benches, with ``seen`` and without, and play the winners in the benches as they are.

``python -m tests.benchmarks.winners folder=FOLDER [count=10] [cameras=off]``. The folder is what
`tests.benchmarks.benches` kept. The embedded designer's tools push the block to a spot that a person measured: a goal
simple enough for a small search.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from core.errors import UsageError
from core.support.cli import arguments, command
from tests.benchmarks import measuring

USAGE = "usage: python -m tests.benchmarks.winners folder=FOLDER [count=N] [cameras=off|true|board]"
GOALS = """\
  - {{name: spot, position: [{x}, {y}, 0], radius: 0.03}}  # told
goals:
  - {{bodies: [block], at: spot, place: [0, 0, null], tolerance: 0.02, rest: true, keep: [jar]}}
"""
BUDGET = (
    "budget=quick",
    "budget.n_agent=1",
    "budget.n_tool=4",
    "budget.n_action=2",
    "budget.n_iteration=1",
    "budget.elite_s=0",
    "budget.final_s=5",
    "executor.workers=1",
    "sim=mujoco",
    "listener=[]",
    "film=false",
)
SEARCHES = {
    "seen": ("task.variation=seen", "fitness=layouts", "fitness.unseen=0"),
    "without": ("task.variation=none", "fitness=nominal"),
}


@dataclass
class Settings:
    """``folder``: of the benches; ``cameras``: how they were measured, a word of `tests.benchmarks.benches`."""

    folder: str = ""
    count: int = 10
    cameras: str = "off"


def main() -> None:
    """Search, and print what the winners earn in the benches as they are."""
    given = measuring.settings(arguments(USAGE, sys.argv[1:]), Settings)
    folder = Path(given.folder)
    last = folder / f"{given.cameras}_{given.count - 1}.yaml"
    if given.count < 1 or not last.is_file():
        raise UsageError(f"there is no {last}; {USAGE}")

    earned = dict[str, list[float]]()
    for seed in range(given.count):
        spot = draw_spot(seed)
        rebuilt = set_goal(folder / f"{given.cameras}_{seed}.yaml", spot)
        true = set_goal(folder / f"is_{seed}.yaml", spot)
        for name, settings in SEARCHES.items():
            run = folder / f"runs/{given.cameras}_{seed}_{name}"
            search = (f"task.file={rebuilt}", *settings, *BUDGET, f"seed={seed}")
            call("core.run", *search, f"hydra.run.dir={run}")
            best = json.loads((run / "result.json").read_text())["best"]
            reward = play(true, run)
            earned.setdefault(name, []).append(reward)
            searched = best["reward"]
            print(f"bench {seed}, {name}: {searched:.3f}, in the true one {reward:.3f}")
            sys.stdout.flush()

    for name, rewards in earned.items():
        mean = np.mean(rewards)
        print(f"{name}: mean {mean:.3f}, worst {min(rewards):.3f} of {len(rewards)}")


def draw_spot(seed: int) -> tuple[float, float]:
    """Draw where the block is to be pushed, m."""
    rng = np.random.default_rng(seed)
    x = 0.65 + 0.03 * rng.uniform(-1, 1)
    y = -0.15 + 0.05 * rng.uniform(-1, 1)
    return round(x, 3), round(y, 3)


def set_goal(file: Path, spot: tuple[float, float]) -> Path:
    """Write a scene file beside another, in which the block is to be pushed to a spot."""
    x, y = spot
    goals = GOALS.format(x=x, y=y)
    text = re.sub(r"goals:\n.*\n", goals, file.read_text(encoding="utf-8"), count=1)
    pushed = file.with_name(f"push_{file.name}")
    pushed.write_text(text, encoding="utf-8")
    return pushed


def play(file: Path, run: Path) -> float:
    """Play a run's winner in a scene, and return its reward."""
    output = run / "true.json"
    best = f"designs={run / 'best/design.json'}"
    call("core.evaluate", f"task.file={file}", "sim=mujoco", best, f"output={output}")
    return float(json.loads(output.read_text())[0]["reward"])


def call(module: str, *words: str) -> None:
    """Run one of the program's commands on a scene file."""
    whole = [sys.executable, "-m", module, "task=file", *words]
    subprocess.run(whole, check=True, stdout=subprocess.PIPE)


if __name__ == "__main__":
    command(lambda _: main())
