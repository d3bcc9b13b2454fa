"""``vlmgineer toolbox RUN...``: try the tools of finished runs on each other's tasks, and choose few that do most."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
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
from plugins.results.pages.formats import Column, Table, to_csv
from plugins.results.pages.runs import find_runs
from plugins.results.toolbox.cover import best_sets
from plugins.results.toolbox.tools import (
    HeldTool,
    TaskConfigs,
    all_task_configs,
    find_tools,
)
from plugins.results.toolbox.trials import OF_RUN, Cells, attempt, groups

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
    """What each tool earned, by task; a tool does a task from the reward ``good``."""

    tools: list[HeldTool]
    tasks: TaskConfigs
    earned: list[Cells]
    good: float

    @cached_property
    def rewards(self) -> Array:
        """Rewards, (tools, tasks)."""
        rewards = np.empty((len(self.tools), len(self.tasks)))
        for row, cells in zip(rewards, self.earned, strict=True):
            row[:] = [cells[task].reward for task in self.tasks]
        return rewards

    @cached_property
    def sets(self) -> list[list[int]]:
        """Sets of one tool and more that do most, as indices of tools (`best_sets`)."""
        return best_sets(self.rewards >= self.good)

    @property
    def chosen(self) -> list[int]:
        """A small set that does all that any tool does."""
        return self.sets[-1] if self.sets else []

    def done(self, tools: Sequence[int]) -> list[str]:
        """Name the tasks that tools do."""
        best = self.rewards[list(tools)].max(axis=0)
        pairs = zip(self.tasks, best, strict=True)
        return [task for task, reward in pairs if reward >= self.good]


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
    tools = find_tools(runs, cfg.top)
    tasks = all_task_configs(runs, cfg.tasks)
    if not tools:
        raise UserError("there is no tool to try")
    for kind in set(OF_RUN) - groups(words):
        if any(tool.run.config[kind] != tools[0].run.config[kind] for tool in tools):
            raise UsageError(
                f"the runs differ in {kind}; set it for all of them, as in {kind}=..."
            )
    earned = [attempt(tool, tasks, words, Path(cfg.output)) for tool in tools]
    return Toolbox(tools, tasks, earned, cfg.good)


def write(found: Toolbox, output: Path) -> None:
    """Write the rewards as a table, and the chosen tools with their plans."""
    columns = tuple(Column(name) for name in ("tool", *found.tasks))
    rows = zip(found.tools, found.rewards.tolist(), strict=True)
    cells = tuple((tool.name, *rewards) for tool, rewards in rows)
    table = to_csv(Table("rewards", columns, cells), output)
    write_bytes(output / TABLE, table.encode())

    # Another set may have been chosen before.
    shutil.rmtree(output / CHOSEN, ignore_errors=True)
    for index in found.chosen:
        _write_chosen(found, index, output / CHOSEN / found.tools[index].name)


def _write_chosen(found: Toolbox, index: int, folder: Path) -> None:
    """Write a chosen tool with its plan for each task that it does."""
    tool = found.tools[index]
    plans = {}
    for task in found.done([index]):
        plan = found.earned[index][task].plan
        if plan is not None:
            plans[task] = plan
    plan, *others = plans.values()
    if others:
        plan = _join_plans(plans, gripper=tool.tool.gripper)
    candidate = replace(tool.best.candidate, plan=plan)
    save_design(candidate, tool.representation, folder)


def _join_plans(plans: Mapping[str, ActionPlan], *, gripper: bool) -> ActionPlan:
    """Make one plan of those for several tasks."""
    entries = []
    for task, plan in plans.items():
        entries.append({"task": task, "action": plan.action, "plan": plan.dump()})
    return parse_plan(installed().create(ACTION, "several"), entries, gripper)


def show(found: Toolbox) -> None:
    """Print the rewards, and the sets that do most."""
    rows = []
    for tool, rewards in zip(found.tools, found.rewards.tolist(), strict=True):
        rows.append((tool.name, *(number(reward, 2) for reward in rewards)))
    print_table(("tool", *found.tasks), rows, tuple(found.tasks))
    for tools in found.sets:
        names = ", ".join(found.tools[i].name for i in tools)
        count = f"{len(tools)} of {len(found.tools)} tools"
        done = f"{len(found.done(tools))} of {len(found.tasks)} tasks"
        say(f"{count} do {done}: {names}")


def main(words: list[str]) -> None:
    folders, overrides = folders_and_overrides(USAGE, words)
    if not folders:
        raise UsageError(f"no folder given; {USAGE}")
    settings = vars(ToolboxConfig())
    own = [word for word in overrides if word.partition("=")[0] in settings]
    cfg = node(load("toolbox", own, ToolboxConfig), ToolboxConfig)
    found = toolbox(folders, cfg, [word for word in overrides if word not in own])
    output = Path(cfg.output)
    write(found, output)
    show(found)
    say(str(output / TABLE))
