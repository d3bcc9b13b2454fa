"""Try the tools of finished runs on each other's tasks, and choose few that do most."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from core.errors import UsageError, UserError
from core.geometry import Array
from core.store.library import OF_RUN, is_library
from core.support.cli import say
from plugins.results.pages.runs import find_runs
from plugins.results.toolbox.cover import best_sets
from plugins.results.toolbox.held_tools import (
    Cells,
    HeldTool,
    TaskConfigs,
    all_task_configs,
    find_tools,
)
from plugins.results.toolbox.library import read_library
from plugins.results.toolbox.tool_trials import attempt, groups


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
    """What each tool earned, by task, and which few do most.

    Attributes:
        tools: all that were tried.
        tasks: in which they were tried, by name.
        earned: by each tool, in their order.
        good: the reward from which a tool does a task.
    """

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
    """Try the tools of all finished runs and of libraries in all tasks of these runs, and choose.

    Args:
        folders: of runs, or that hold runs; or libraries.
        cfg: the settings of the command.
        words: settings of the searches for plans (`core.run`).

    Raises:
        UserError: there is no run with a tool, their settings differ, or a part or setting can't be used.
    """
    libraries = [folder for folder in folders if is_library(folder)]
    others = [folder for folder in folders if folder not in libraries]
    runs, left_out = find_runs(others)
    for lost in left_out:
        say(f"not counted, {lost}")

    kept = [tool for library in libraries for tool in read_library(library)]
    by_name = {tool.name: tool for tool in (*kept, *find_tools(runs, cfg.top))}
    tools = [*by_name.values()]
    tasks = all_task_configs(runs, cfg.tasks)
    if not tools:
        raise UserError("there is no tool to try")
    if not tasks:
        raise UsageError("a library names no tasks to try; give tasks=[NAME,...]")
    _check_agreement(tools, groups(words))

    earned = [attempt(tool, tasks, words, Path(cfg.output)) for tool in tools]

    return Toolbox(tools, tasks, earned, cfg.good)


def _check_agreement(tools: Sequence[HeldTool], given: set[str]) -> None:
    """Check that tools come from runs whose settings agree, but for those that are ``given`` for all of them.

    Raises:
        UsageError: they differ.
    """
    differing = []
    for kind in OF_RUN:
        settings = [tool.config[kind] for tool in tools]
        if kind not in given and settings.count(settings[0]) < len(settings):
            differing.append(kind)

    if differing:
        words = " ".join(f"{kind}=..." for kind in differing)
        raise UsageError(
            f"the runs differ in {', '.join(differing)}; set for all of them {words}"
        )
