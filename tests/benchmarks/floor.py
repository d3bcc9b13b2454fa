"""What do tasks give for nothing? ``python -m tests.benchmarks.floor`` tries, in the unseen layouts of a protocol and
with its settings:

down: the bare hand is driven down to the table. sweep: it is swept through a body that a goal names, in each of eight
directions; the best of these. random: ``count`` tools, chains of boxes or boxes on the fingers, with a few waypoints
beside, in and beyond such a body; every other plan is anchored to it. All but these see the layout exactly.

Rewards are kept in ``folder``, task by task.  Run by hand.
"""

from __future__ import annotations

import json
import sys
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from omegaconf import DictConfig

from core.config.compose import load, node, task_part, tool_part
from core.design import Candidate, DesignError, Tool
from core.designs.planning import look
from core.designs.rules import SpawnRules, check_tool
from core.geometry import Array
from core.interfaces import Anchor, Perception, RolloutSettings, Task, Waypoints
from core.plugins import installed
from core.robot.extents import extents_at_home
from core.support.cli import arguments, command
from plugins.executors.local import LocalExecutor
from plugins.fitness.layouts import UNSEEN
from tests.benchmarks import measuring
from tests.benchmarks.absurd import random_start
from tests.benchmarks.layouts import Trial

USAGE = (
    "usage: python -m tests.benchmarks.floor [tasks=NAME,...] [count=N] [sim=NAME] [protocol=NAME] [workers=N] "
    "[folder=DIR]"
)
DIRECTIONS, AWAY_M, DRAWS = 8, 0.25, 200


@dataclass
class Settings:
    """``count``: how many random tools are tried for each task, each in one layout."""

    tasks: list[str] = field(default_factory=list)
    count: int = 200
    sim: str = "mujoco"
    protocol: str = "varied"
    workers: int = 1
    folder: str = "floor"


def main() -> None:
    given = measuring.settings(arguments(USAGE, sys.argv[1:]), Settings)
    rows = ["| task | down | sweep | random, mean | random, highest |", "|---|---|---|---|---|"]
    folder = Path(given.folder)
    folder.mkdir(parents=True, exist_ok=True)
    with LocalExecutor(workers=given.workers) as executor:
        for name in measuring.tasks(given.tasks):
            file = folder / f"{name}.json"
            if not file.exists():
                cfg = load("evaluate", [f"protocol={given.protocol}", f"task={name}", f"sim={given.sim}"])
                designs, settings = dict(attempts(cfg, given.count)), node(cfg.rollout, RolloutSettings)
                trial = Trial(task_part(cfg), {key: of for (key, _), of in designs.items()}, settings)
                jobs = [[(key, given.sim, layout)] for key, layout in designs]
                earned = {key: float(reward) for ((key, *_),), reward in executor.map(trial, jobs)}
                measuring.save(file, dict(sorted(earned.items())))
            rows.append(row(name, json.loads(file.read_text())))
            measuring.console.print(rows[-1], highlight=False)
    table = "\n".join([*rows, ""])
    sys.stdout.write(table)


def row(task: str, rewards: dict[str, float]) -> str:
    """Format a task's row; the keys are those of `attempts`."""
    of: dict[str, list[float]] = {}
    for key, reward in rewards.items():
        of.setdefault(key.rpartition(" ")[0], []).append(reward)
    swept = max(np.mean(earned) for what, earned in of.items() if what.startswith("sweep"))
    figures = (np.mean(of["down"]), swept, np.mean(of["random"]), np.max(of["random"]))
    return f"| {task} | {' | '.join(f'{figure:.3f}' for figure in figures)} |"


def attempts(cfg: DictConfig, count: int) -> Iterator[tuple[tuple[str, int], Candidate]]:
    """Yield candidates by what they are, with a number, and by their layout's number."""
    task, material, layouts = task_part(cfg).create(), tool_part(cfg).create().material, int(cfg.protocol.layouts)
    for layout in range(layouts):
        yield (f"down {layout}", layout), bare(task, [task.home.position * (1, 1, 0)])
        for number, swept in enumerate(sweeps(task, UNSEEN + layout)):
            yield (f"sweep {number} {layout}", layout), swept
    for number in range(count):
        layout = number % layouts
        random = np.random.default_rng([zlib.crc32(task.name.encode()), number])
        rules = SpawnRules(task, UNSEEN + layout)
        for _ in range(DRAWS):
            start = random_start(task, UNSEEN + layout, random, flat=False)
            tool = material.made(start.tool)
            try:
                check_tool(tool, task.robot, material)
                rules.check(tool)
            except DesignError:
                continue
            made = Candidate(tool, Waypoints(start.plan))
            yield (f"random {number}", layout), anchored(made, task, UNSEEN + layout) if number % 2 else made
            break


def bare(task: Task, tips: list[Array]) -> Candidate:
    """Lead the lowest point of the bare hand, as it hangs at home, through points."""
    hand = Tool(gripper=task.robot.gripper is not None)
    reach = -min(low[2] for low, _ in extents_at_home(task.robot, hand.gripper, task.home).values())
    rows = [[*tip[:2], max(tip[2], 0.0) + reach, *task.home.rpy, *([1.0] * hand.gripper)] for tip in tips]
    return Candidate(hand, Waypoints(np.array(rows)))


def sweeps(task: Task, seed: int) -> list[Candidate]:
    """Sweep the bare hand through the first body that a goal names, in each of the directions."""
    scene = task.scene(seed)
    names = next((goal.bodies for goal in task.goals if goal.bodies), [body.name for body in scene.bodies])
    at = scene[names[0]].pose.position
    turns = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    ways = [AWAY_M * np.array([np.cos(turn), np.sin(turn), 0.0]) for turn in turns]
    return [bare(task, [at - way + (0.0, 0.0, 0.2), at - way, at, at + way]) for way in ways]


def anchored(candidate: Candidate, task: Task, seed: int) -> Candidate:
    """Anchor the waypoints to the first body of a goal."""
    assert candidate.tool is not None
    assert isinstance(candidate.plan, Waypoints)
    seen = look(task, seed, Perception())
    name = next((goal.bodies[0] for goal in task.goals if goal.bodies), "world")
    actions = installed().create("action", "anchored")
    data = actions.anchor(candidate.plan, [Anchor(name)] * len(candidate.plan), seen)
    return replace(candidate, plan=actions.parse(data, gripper=candidate.tool.gripper))


if __name__ == "__main__":
    command(lambda _: main())
