"""How far do known tools come before a model is asked? ``python -m tests.benchmarks.library folder=FOLDER``.

The model's designs of docs/gallery/ are the winners of a run each, and ``vlmgineer toolbox add`` keeps them. In each
task the tools of the other tasks are then tried: ``tool=known tool.library=FOLDER budget.n_iteration=0``. What is in
``folder`` already is not tried again.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from core.errors import UsageError
from core.support.cli import arguments, command
from tasks import tasks as twelve
from tests.benchmarks import measuring

USAGE = (
    "usage: python -m tests.benchmarks.library folder=FOLDER [tasks=NAME,...] [plans=N]"
)
DESIGNS = Path(__file__).parents[2] / "docs" / "gallery" / "model"
GOOD = 0.5
FEW = (
    "sim=mujoco",
    "budget.n_iteration=0",
    "budget.final_s=0",
    "budget.elite_s=0",
    "executor.workers=1",
    "prompt.picture=false",
    "listener=[]",
    "film=false",
)


@dataclass
class Settings:
    """``tasks``: in which the others' tools are tried, without any all; ``plans``: made for each tool."""

    folder: str = ""
    tasks: list[str] = field(default_factory=list)
    plans: int = 4


class Known(NamedTuple):
    """The best known tool in a task: its name, what it earned, and whether with its own plan."""

    tool: str
    reward: float
    own_plan: bool


def main() -> None:
    """Make the library, try it, and print a line for each task."""
    given = measuring.settings(arguments(USAGE, sys.argv[1:]), Settings)
    if not given.folder:
        raise UsageError(f"folder is missing; {USAGE}")

    folder = Path(given.folder)
    runs = {task: keep_winner(task, folder) for task in sorted(twelve())}
    found = {}
    for task in given.tasks or runs:
        others = [run for name, run in runs.items() if name != task]
        found[task] = try_others(task, others, given.plans, folder)
        best = found[task]
        how = "with its own plan" if best.own_plan else "with a plan for the task"
        print(f"| {task} | {best.tool} | {best.reward:.3f} | {how} |")
        sys.stdout.flush()

    good = sum(best.reward >= GOOD for best in found.values())
    print(f"{good} of {len(found)} tasks: a known tool earns {GOOD} or more")


def keep_winner(task: str, folder: Path) -> Path:
    """Make a run whose only candidate is the gallery's design for a task; return its folder."""
    run = folder / "runs" / task
    design = DESIGNS / f"{task}.json"
    one = [f"budget.{key}=1" for key in ("n_agent", "n_tool", "n_action")]
    answer = ["vlm=command", f"vlm.command=[cat,{design}]", "prompt.repair=0"]
    search(run, f"task={task}", *answer, *one)

    return run


def try_others(task: str, runs: Sequence[Path], plans: int, folder: Path) -> Known:
    """Try the winners of runs for other tasks in a task."""
    library = folder / "libraries" / task
    run = folder / "tried" / task
    if not library.exists():
        words = [*map(str, runs), f"output={library}"]
        call("core", "toolbox", "add", *words)

    known = ["tool=known", f"tool.library={library}", f"budget.n_action={plans}"]
    search(run, f"task={task}", *known)
    best = json.loads((run / "result.json").read_text())["best"]
    design = json.loads((run / "best/design.json").read_text())["strategies"][0]

    return Known(design["tool_name"], best["reward"], "-s0-" in best["candidate"])


def search(run: Path, *words: str) -> None:
    """Make a run, unless it is there; one that was cut short is made again."""
    if (run / "result.json").exists():
        return

    shutil.rmtree(run, ignore_errors=True)
    call("core.run", *words, *FEW, f"hydra.run.dir={run}")


def call(module: str, *words: Any) -> None:
    """Run one of the program's commands."""
    subprocess.run(
        [sys.executable, "-m", module, *words], check=True, stdout=subprocess.PIPE
    )


if __name__ == "__main__":
    command(lambda _: main())
