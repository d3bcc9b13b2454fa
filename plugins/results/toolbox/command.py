"""``vlmgineer toolbox RUN...``: try the tools of finished runs on each other's tasks, and choose few that do most."""

from __future__ import annotations

import csv
import io
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from core.config.compose import load, node
from core.designs.planning import parse_plan
from core.designs.reading import save_design
from core.errors import UsageError, UserError
from core.geometry import Array
from core.interfaces import ActionPlan
from core.plugins import ACTION, installed
from core.support.cli import folders_and_overrides, print_table, say, write_bytes
from core.support.text import number
from plugins.results.pages.runs import find_runs
from plugins.results.toolbox.cover import best_sets
from plugins.results.toolbox.trials import (
    OF_RUN,
    Cell,
    Held,
    Nodes,
    attempt,
    groups,
    nodes_of,
    tools_of,
)

USAGE = (
    "usage: vlmgineer toolbox FOLDER [FOLDER ...] [output=DIR] [tasks=[NAME,...]] [good=0.9] [top=1] "
    "[KEY=VALUE ...]; FOLDER is a run's or holds runs, and other keys are those of core.run"
)
CHOSEN = "chosen"
TABLE = "rewards.csv"


@dataclass
class ToolboxConfig:
    """Settings of ``vlmgineer toolbox``.

    Attributes:
        output: the folder to write; what was tried is there, so that the same command goes on.
        tasks: tried besides those of the runs: names, or mappings of a ``name`` and settings.
        good: the reward from which a tool does a task.
        top: the number of candidates from each run, the best first.
    """

    output: str = "toolbox"
    tasks: list[Any] = field(default_factory=list)
    good: float = 0.9
    top: int = 1


@dataclass(frozen=True, eq=False)
class Toolbox:
    """What each tool earned, by task; and ``sets`` of one tool and more, as indices of tools."""

    tools: list[Held]
    tasks: Nodes
    earned: list[dict[str, Cell]]
    good: float
    sets: list[list[int]]

    @property
    def chosen(self) -> list[int]:
        """A small set that does all that any tool does."""
        return self.sets[-1] if self.sets else []

    @property
    def rewards(self) -> Array:
        """Rewards, (tools, tasks)."""
        return np.array([[row[task][0] for task in self.tasks] for row in self.earned])

    def done(self, tools: Sequence[int]) -> list[str]:
        """Name the tasks that tools do."""
        return [
            task
            for task in self.tasks
            if any(self.earned[i][task][0] >= self.good for i in tools)
        ]


def toolbox(
    folders: Sequence[Path], cfg: ToolboxConfig, words: Sequence[str]
) -> Toolbox:
    """Try the tools of all finished runs in all of their tasks and ``cfg.tasks``, and choose.

    Raises:
        UserError: there is no run with a tool, their settings differ, or a part or setting can't be used.
    """
    runs, left_out = find_runs(folders)
    for lost in left_out:
        say(f"not counted, {lost}")
    tools = [
        *{tool.name: tool for run in runs for tool in tools_of(run, cfg.top)}.values()
    ]
    nodes: dict[str, dict[str, Any]] = {}
    more = [{"task": {"name": "several", "of": cfg.tasks}}] if cfg.tasks else []
    for name, own in (
        pair
        for config in [*(run.config for run in runs), *more]
        for pair in nodes_of(config).items()
    ):
        if nodes.setdefault(name, own) != own:
            raise UsageError(
                f"{name} has different settings in these runs; give runs with the same"
            )
    if not tools:
        raise UserError("there is no tool to try")
    for kind in {*OF_RUN} - groups(words):
        if any(tool.run.config[kind] != tools[0].run.config[kind] for tool in tools):
            raise UsageError(
                f"the runs differ in {kind}; set it for all of them, as in {kind}=..."
            )
    earned = [attempt(tool, nodes, words, Path(cfg.output)) for tool in tools]
    covers = np.array([[row[task][0] >= cfg.good for task in nodes] for row in earned])
    return Toolbox(tools, nodes, earned, cfg.good, best_sets(covers))


def write(found: Toolbox, output: Path) -> None:
    """Write the rewards as a table, and the chosen tools with their plans."""
    table = io.StringIO()
    writer = csv.writer(table, lineterminator="\n")
    writer.writerow(["tool", *found.tasks])
    for tool, rewards in zip(found.tools, found.rewards, strict=True):
        writer.writerow([tool.name, *rewards.tolist()])
    write_bytes(output / TABLE, table.getvalue().encode())

    shutil.rmtree(
        output / CHOSEN, ignore_errors=True
    )  # another set may have been chosen
    for index in found.chosen:
        _write_chosen(found, index, output / CHOSEN / found.tools[index].name)


def _write_chosen(found: Toolbox, index: int, folder: Path) -> None:
    """Write a chosen tool with its plan for each task that it does."""
    tool = found.tools[index]
    row = found.earned[index]
    plans = {
        task: plan for task in found.done([index]) if (plan := row[task][1]) is not None
    }
    first, *others = plans.values()
    plan = _join_plans(plans, gripper=tool.tool.gripper) if others else first
    save_design(replace(tool.best.candidate, plan=plan), tool.representation, folder)


def _join_plans(plans: Mapping[str, ActionPlan], *, gripper: bool) -> ActionPlan:
    """Make one plan of those for several tasks."""
    entries = [
        {"task": task, "action": plan.action, "plan": plan.dump()}
        for task, plan in plans.items()
    ]
    return parse_plan(installed().create(ACTION, "several"), entries, gripper)


def show(found: Toolbox) -> None:
    """Print the rewards, and the sets that do most."""
    named = zip(found.tools, found.rewards, strict=True)
    rows = [
        (tool.name, *(number(float(reward), 2) for reward in row))
        for tool, row in named
    ]
    print_table(("tool", *found.tasks), rows, tuple(found.tasks))
    for own in found.sets:
        names = ", ".join(found.tools[i].name for i in own)
        say(
            f"{len(own)} of {len(found.tools)} tools do {len(found.done(own))} of {len(found.tasks)} tasks: {names}"
        )


def main(words: list[str]) -> None:
    folders, overrides = folders_and_overrides(USAGE, words)
    own = [
        word for word in overrides if word.partition("=")[0] in vars(ToolboxConfig())
    ]
    cfg = node(load("toolbox", own, ToolboxConfig), ToolboxConfig)
    if not folders:
        raise UsageError(f"no folder given; {USAGE}")
    found = toolbox(folders, cfg, [word for word in overrides if word not in own])
    output = Path(cfg.output)
    write(found, output)
    show(found)
    say(str(output / TABLE))
