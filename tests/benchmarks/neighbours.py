"""Do engines agree about worse and better designs? ``python -m tests.benchmarks.neighbours`` changes the numbers of
tool and plan of each reference solution at random, a little in the first design and much in the last. Each is tried
in one unseen layout of every engine, with the settings of a protocol.

The table has Spearman's rank correlation of the rewards for each pair of engines. Rewards are kept in ``folder``, task
by task. ``page=FILE.md`` gets the table. Run by hand.
"""

from __future__ import annotations

import itertools
import json
import sys
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from omegaconf import DictConfig

from core.config.compose import load, node, task_part
from core.design import Candidate, DesignError
from core.designs.reading import dump_design, load_designs, read_designs
from core.designs.rules import SpawnRules
from core.interfaces import RolloutSettings
from core.plugins import installed
from core.support.cli import arguments, command
from plugins.executors.local import LocalExecutor
from plugins.fitness.layouts.fitness import UNSEEN
from tests.benchmarks import measuring
from tests.benchmarks.layouts import SOLUTIONS, Trial, representation

USAGE = (
    "usage: python -m tests.benchmarks.neighbours [tasks=NAME,...] [count=N] [sims=NAME,...] [protocol=NAME] "
    "[spread=X] [workers=N] [folder=DIR] [page=FILE.md]"
)
HARD = sorted(name for name, file in SOLUTIONS.items() if file.parent.name == "hardtoolbench")
DRAWS = 20  # of a design, until one keeps the rules


@dataclass
class Settings:
    """``spread``: the standard deviation of the last design's changes, in the representations' steps."""

    tasks: list[str] = field(default_factory=lambda: HARD)
    count: int = 100
    sims: list[str] = field(default_factory=lambda: ["pybullet", "sapien", "mujoco"])
    protocol: str = "varied"
    spread: float = 1.0
    workers: int = 1
    folder: str = "neighbours"
    page: str | None = None


def main() -> None:
    given = measuring.settings(arguments(USAGE, sys.argv[1:]), Settings)
    folder = Path(given.folder)
    folder.mkdir(parents=True, exist_ok=True)
    found: dict[str, dict[str, list[float]]] = {}
    with LocalExecutor(workers=given.workers) as executor:
        for name in measuring.tasks(given.tasks):
            file = folder / f"{name}.json"
            if not file.exists():
                cfg = load("evaluate", [f"protocol={given.protocol}", f"task={name}"])
                designs = neighbours(cfg, given.count, given.spread)
                numbered = {str(number): design for number, design in enumerate(designs)}
                trial = Trial(task_part(cfg), numbered, node(cfg.rollout, RolloutSettings))
                layouts = int(cfg.protocol.layouts)
                jobs = [[(key, sim, int(key) % layouts)] for sim in given.sims for key in numbered]
                earned = {(sim, key): reward for ((key, sim, _),), reward in executor.map(trial, jobs)}
                measuring.save(file, {sim: [float(earned[sim, key]) for key in numbered] for sim in given.sims})
            found[name] = json.loads(file.read_text())
            measuring.console.print(row(name, found[name], given.sims), highlight=False)
    table = markdown(found, given.sims)
    sys.stdout.write(table)
    if given.page is not None:
        measuring.write_page(Path(given.page), "agreement", table)


def neighbours(cfg: DictConfig, count: int, spread: float) -> list[Candidate]:
    """Change a reference solution ``count`` times, from ``spread`` / ``count`` to ``spread`` steps of its numbers.

    A design that still breaks a rule after `DRAWS` draws is the solution itself.
    """
    task = task_part(cfg).create()
    file, actions = SOLUTIONS[task.name], installed().create("action", "anchored")
    tools, spawn = representation(file, cfg.material.name), SpawnRules(task, UNSEEN)
    (known,) = read_designs(load_designs(file), tools, spawn, actions=actions)[:1]
    assert known.tool is not None
    numbers = tools.parameters(known.tool) + actions.parameters(known.plan)
    of_tool = len(tools.parameters(known.tool))
    made = []
    for number in range(count):
        random = np.random.default_rng([zlib.crc32(task.name.encode()), number])
        for _ in range(DRAWS):
            values = numbers.values + numbers.steps * random.normal(size=len(numbers)) * spread * (number + 1) / count
            values = np.clip(values, numbers.lower, numbers.upper)
            try:
                tool = tools.with_parameters(known.tool, values[:of_tool])
                plan = actions.with_parameters(known.plan, values[of_tool:])
                document = {"strategies": [dump_design(replace(known, tool=tool, plan=plan), tools)]}
                (read,) = read_designs(document, tools, spawn, actions=actions)
            except DesignError:
                continue
            if read.problem is None:
                break
        else:
            read = known
        made.append(read)
    return made


def correlations(rewards: dict[str, list[float]], sims: Sequence[str]) -> list[float | None]:
    """Compute the rank correlation of each pair of engines; None where one gives all designs the same reward."""
    rounded = {sim: np.round(rewards[sim], measuring.DIGITS) for sim in sims}
    return [measuring.correlation(rounded[one], rounded[other]) for one, other in itertools.combinations(sims, 2)]


def row(task: str, rewards: dict[str, list[float]], sims: Sequence[str]) -> str:
    """Format a task's correlations, then its mean reward in each engine."""
    figures = [measuring.number(figure) for figure in correlations(rewards, sims)]
    return f"| {task} | {' | '.join([*figures, *(f'{np.mean(rewards[sim]):.3f}' for sim in sims)])} |"


def markdown(found: dict[str, dict[str, list[float]]], sims: Sequence[str]) -> str:
    """Format a row for each task, and the means over the tasks."""
    pairs = [f"{one}, {other}" for one, other in itertools.combinations(sims, 2)]
    head = ["task", *pairs, *(f"mean, {sim}" for sim in sims)]
    columns = zip(*(correlations(rewards, sims) for rewards in found.values()), strict=True)
    means = [np.mean([np.mean(rewards[sim]) for rewards in found.values()]) for sim in sims]
    last = ["**mean**", *(measuring.number(measuring.mean(column)) for column in columns), *(f"{m:.3f}" for m in means)]
    rows = [row(name, rewards, sims) for name, rewards in found.items()]
    return "\n".join(["| " + " | ".join(head) + " |", "|---" * len(head) + "|", *rows, f"| {' | '.join(last)} |", ""])


if __name__ == "__main__":
    command(lambda _: main())
