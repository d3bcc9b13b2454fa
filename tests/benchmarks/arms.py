"""Does the embedded designer solve the tasks with every arm? ``python -m tests.benchmarks.arms robots=panda,ur5``.

A run for each task, arm and engine; the table has its best reward. Runs are kept in ``folder``: one that has ended is
not repeated, one that was interrupted goes on. ``page=docs/robots.md`` writes the tables there.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from core.config.compose import load
from core.errors import UserError, choices
from core.plugins import installed
from core.search.orchestration import resume, run
from core.support.cli import arguments, command
from tests.benchmarks import measuring

USAGE = (
    "usage: python -m tests.benchmarks.arms [robots=NAME,NAME,...] [tasks=NAME,...] [sims=NAME,...] [base=x,y,z,yaw] "
    "[budget=NAME] [overrides=SETTING=VALUE,...] [stop=REWARD] [seed=N] [workers=N] [folder=DIR] [page=FILE.md]"
)


@dataclass
class Settings:
    """``base``: where all the arms stand; ``stop``: the reward at which a run ends; ``overrides``: other settings."""

    robots: list[str] = field(default_factory=list)
    tasks: list[str] = field(default_factory=list)
    sims: list[str] = field(default_factory=lambda: ["mujoco"])
    base: list[float] = field(default_factory=list)
    budget: str = "quick"
    overrides: list[str] = field(default_factory=list)
    stop: float = 0.95
    seed: int = 0
    workers: int | None = None
    folder: str = "measured/arms"
    page: str | None = None


def main() -> None:
    given = measuring.settings(arguments(USAGE, sys.argv[1:]), Settings)
    tasks, robots = measuring.tasks(given.tasks), named(given.robots)
    tables = []
    for sim in given.sims:
        found = {task: {robot: best(task, robot, sim, given) for robot in robots} for task in tasks}
        tables.append(f"In {sim}:\n\n{markdown(found, robots)}")
    sys.stdout.write(text := "\n".join(tables))
    if given.page is not None:
        measuring.write_page(Path(given.page), "arms", text)


def named(names: Sequence[str]) -> list[str]:
    """Return the named robots; if ``names`` is empty all but those of one's own URDF, which need settings.

    Raises:
        UsageError: no robot has such a name.
    """
    there = installed().names("robot")
    for name in names:
        if name not in there:
            raise choices("robot", name, there)
    return list(names) or [name for name in there if name != "urdf"]


def best(task: str, robot: str, sim: str, given: Settings) -> dict[str, Any]:
    """Return the best reward of a run (``reward``), or why there is none (``reason``).

    The run is made, or goes on, unless its folder has it.
    """
    folder = Path(given.folder) / sim / robot / task
    kept = folder.with_suffix(".json")
    if not kept.exists():
        words = [f"task={task}", f"robot={robot}", f"sim={sim}", f"seed={given.seed}", f"budget={given.budget}"]
        words += [f"budget.stop_reward={given.stop}"]
        words += ["vlm=offline", "listener=[]", "film=false", f"executor.workers={measuring.workers(given.workers)}"]
        words += [f"robot.base=[{','.join(map(str, given.base))}]"] if given.base else []
        words += given.overrides
        folder.parent.mkdir(parents=True, exist_ok=True)
        measuring.save(kept, played(words, folder))
    found: dict[str, Any] = json.loads(kept.read_text())
    return found


def played(words: Sequence[str], folder: Path) -> dict[str, Any]:
    """Make a run, or go on with it."""
    try:
        if (folder / "run.sqlite").exists():
            resume(folder)
        else:
            run(load("config", words), folder)
    except UserError as error:
        return {"reward": None, "reason": str(error)}
    result = json.loads((folder / "result.json").read_text())
    if result["best"] is None:
        return {"reward": None, "reason": "no design kept the rules"}
    first = result["generations"][0]["best_reward"]
    return {"reward": result["best"]["reward"], "first": first, "seconds": result["wall_time_s"]}


def markdown(found: Mapping[str, Mapping[str, dict[str, Any]]], robots: Sequence[str]) -> str:
    """Format the table, with the reasons where a task can't be tried at all."""
    lines = [f"| task | {' | '.join(robots)} |", "|---" * (len(robots) + 1) + "|"]
    lines += [f"| {task} | {' | '.join(number(row[robot]) for robot in robots)} |" for task, row in found.items()]
    means = [measuring.mean([row[robot]["reward"] for row in found.values()]) for robot in robots]
    lines.append(f"| **mean** | {' | '.join('–' if mean is None else f'{mean:.3f}' for mean in means)} |")
    reasons = {one["reason"]: None for row in found.values() for one in row.values() if one["reward"] is None}
    return "\n".join([*lines, *(f"\n{reason}" for reason in reasons)]) + "\n"


def number(one: Mapping[str, Any]) -> str:
    return "–" if one["reward"] is None else f"{one['reward']:.3f}"


if __name__ == "__main__":
    command(lambda _: main())
