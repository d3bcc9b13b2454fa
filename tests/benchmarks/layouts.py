"""How well do designs do in other layouts? ``python -m tests.benchmarks.layouts solutions``.

Tried are the anchored solutions in unseen layouts of each engine, and the same tools with literal plans in the last
engine; with noise in what the plans see, if asked. Literal plans are what the anchored ones come to in the task's usual
layout.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from core.config.compose import load, tool_part
from core.design import Candidate
from core.designs.planning import resolve
from core.designs.reading import load_designs, read_designs
from core.designs.rules import SpawnRules
from core.errors import UsageError
from core.interfaces import Perception, RolloutSettings, Task, ToolRepresentation
from core.plugins import PluginPart, installed
from core.simulation.robustness import CheckedEvaluator
from core.support.cli import command
from plugins.executors.local import LocalExecutor
from plugins.fitness.layouts import UNSEEN
from tests.benchmarks import measuring

USAGE = (
    "usage: python -m tests.benchmarks.layouts solutions [tasks=NAME,...] [sims=NAME,...] [layouts=N] "
    "[position=METRES] [yaw=RADIANS] [material=NAME] [workers=N] [folder=FOLDER]"
)
TASKS = Path(__file__).parents[1] / "tasks"
SOLUTIONS = {file.stem: file for place in ("anchored", "hardtoolbench") for file in (TASKS / place).glob("*.json")}
HARD = sorted(name for name, file in SOLUTIONS.items() if file.parent.name == "hardtoolbench")


@dataclass
class Settings:
    """``position``, ``yaw``: noise in what plans see. ``material``: of the tools. ``folder``: keeps the rewards of
    ``solutions``, task by task.
    """

    tasks: list[str] = field(default_factory=list)
    sims: list[str] = field(default_factory=lambda: ["pybullet", "sapien", "mujoco"])
    layouts: int = 50
    position: float = 0.0
    yaw: float = 0.0
    material: str = "paper"
    workers: int = 2
    folder: str = "layouts"


def main() -> None:
    match sys.argv[1:]:
        case ["--help" | "-h"]:
            sys.stdout.write(f"{USAGE}\n")
        case ["solutions", *words]:
            given = measuring.settings(words, Settings)
            given.tasks = given.tasks or sorted(SOLUTIONS)
            sys.stdout.write(solutions(given))
        case _:
            raise UsageError(USAGE)


def designs(name: str, settings: RolloutSettings, material: str = "paper") -> dict[str, Candidate]:
    """Return the anchored solution of a task, and the same tool with the plan's waypoints of the usual layout."""
    usual = installed().create("task", name)
    file = SOLUTIONS[name]
    (anchored,) = read_designs(load_designs(file), representation(file, material), SpawnRules(usual, 0))[:1]
    literal = resolve(anchored.plan, usual, 0, replace(settings, perception=Perception()))
    return {"anchored": anchored, "literal": replace(anchored, plan=literal)}


def representation(file: Path, material: str = "paper") -> ToolRepresentation:
    """Make the representation that a designs file was written for, by its fields."""
    written = load_designs(file)["strategies"][0]
    words = [[f"tool={name}", f"material={material}"] for name in ("urdf", "boxes", "solids")]
    tools = [tool_part(load("evaluate", of)).create() for of in words]
    return next(tool for tool in tools if {*tool.schema()} <= {*written})


def solutions(given: Settings) -> str:
    """Try the solutions, and return a row for each task."""
    folder = Path(given.folder)
    folder.mkdir(parents=True, exist_ok=True)
    settings = RolloutSettings(perception=Perception(given.position, given.yaw))
    found: dict[str, dict[str, dict[str, list[float]]]] = {}
    with LocalExecutor(workers=given.workers) as executor:
        for name in given.tasks:
            file = folder / f"{name}.json"
            if not file.exists():
                task = PluginPart("task", name, (("variation", "wide"),))
                exact = given.position == given.yaw == 0  # what a literal plan sees makes no difference
                ways = [*(("anchored", sim) for sim in given.sims), *[("literal", given.sims[-1])] * exact]
                jobs = [(*way, number) for way in ways for number in range(given.layouts)]
                trial = Trial(task, designs(name, settings, given.material), settings)
                earned = {job: reward for (job,), reward in executor.map(trial, [[job] for job in jobs])}
                rewards: dict[str, dict[str, list[float]]] = {"anchored": {}, "literal": {}}
                for way, sim in ways:
                    rewards[way][sim] = [float(earned[way, sim, number]) for number in range(given.layouts)]
                file.write_text(json.dumps(rewards, indent=1))
            found[name] = json.loads(file.read_text())
            measuring.console.print(row(name, found[name], given.sims), highlight=False)
    return markdown(found, given.sims)


@dataclass(frozen=True)
class Trial:
    """A picklable function of jobs: way, engine, number of the layout."""

    task: PluginPart[Task]
    designs: dict[str, Candidate]
    settings: RolloutSettings

    def __call__(self, jobs: Sequence[tuple[str, str, int]]) -> float:
        ((way, sim, number),) = jobs
        evaluate = CheckedEvaluator(self.task, PluginPart("sim", sim), UNSEEN + number, self.settings)
        return evaluate([self.designs[way]])[0].reward


def row(name: str, rewards: dict[str, dict[str, list[float]]], sims: Sequence[str]) -> str:
    """Format the means of each engine, the worst layout of all, and the literal plan's mean if it was tried."""
    means = [np.mean(rewards["anchored"][sim]) for sim in sims]
    worst = min(min(rewards["anchored"][sim]) for sim in sims)
    literal = "".join(f" {np.mean(of):.3f} |" for of in rewards["literal"].values())
    return f"| {name} | {' | '.join(f'{mean:.3f}' for mean in means)} | {worst:.2f} |{literal}"


def markdown(found: dict[str, dict[str, dict[str, list[float]]]], sims: Sequence[str]) -> str:
    """Format a row for each task, and the means over the tasks."""
    every = list(found.values())
    means = [np.mean([np.mean(rewards["anchored"][sim]) for rewards in every]) for sim in sims]
    literal = [sim for sim in sims if all(sim in rewards["literal"] for rewards in every)]
    last = [f"{np.mean([np.mean(rewards['literal'][sim]) for rewards in every]):.3f}" for sim in literal]
    head = ["task", *sims, "worst layout", *(f"literal plan, {sim}" for sim in literal)]
    mean = ["**mean**", *(f"{mean:.3f}" for mean in means), "", *last]
    rows = [row(name, rewards, sims) for name, rewards in found.items()]
    return "\n".join(["| " + " | ".join(head) + " |", "|---" * len(head) + "|", *rows, f"| {' | '.join(mean)} |", ""])


if __name__ == "__main__":
    command(lambda _: main())
