"""Tools that were found, and the tasks that their runs were for."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from omegaconf import OmegaConf

from core.config.compose import read_parts, task_part, tool_part
from core.config.gate import take_stored
from core.design import Candidate, Tool
from core.errors import UsageError
from core.interfaces import ActionPlan, Evaluation, ToolRepresentation
from core.plugins import TASK
from core.store.library import KEPT_SETTINGS
from core.values.contents import digest
from plugins.results.chosen import chosen_evaluations
from plugins.results.pages.figure import slug
from plugins.results.pages.runs import FinishedRun

TaskConfig = dict[str, Any]
TaskConfigs = Mapping[str, TaskConfig]
"""The configurations of tasks, by their names."""


class Cell(NamedTuple):
    """What a tool earned in a task with its best plan, and that plan; None: no plan could be tried."""

    reward: float = 0.0
    plan: ActionPlan | None = None


Cells = dict[str, Cell]
"""What a tool earned, by the names of tasks."""


@dataclass(frozen=True, eq=False)
class HeldTool:
    """A tool with its best plan, of a run or of a library.

    Attributes:
        config: of the run that found it, as far as a tool depends on it.
        candidate: the tool with its best plan.
        representation: of the run; reads and writes the tool.
        earned: in the tasks of the run.
    """

    config: Mapping[str, Any]
    candidate: Candidate
    representation: ToolRepresentation
    earned: Cells

    @property
    def tool(self) -> Tool:
        assert self.candidate.tool is not None  # it was tried
        return self.candidate.tool

    @property
    def name(self) -> str:
        """A name for a folder, the same for the same tool."""
        return f"{slug(self.tool.name, 24) or 'tool'}_{digest(self.tool.content)[:6]}"


def find_tools(runs: Iterable[FinishedRun], top: int) -> list[HeldTool]:
    """Read the tools of the ``top`` candidates of runs again, that which each chose first; a given tool is none.

    Raises:
        UserError: a run can't be read, or a part of it is not installed here.
    """
    tools = {}
    for run in runs:
        stored, _ = take_stored(run.config, run.folder, kinds=KEPT_SETTINGS)
        settings = {**stored, "designs": str(run.folder), "top": top}
        config = OmegaConf.create(settings)
        task = task_part(config).create()
        representation = tool_part(config).create()
        if representation.given(task) is not None:
            continue
        for best in chosen_evaluations(config, representation, task):
            names = task_configs(run.config["task"])
            earned = {name: best_cell(name, [best]) for name in names}
            held = HeldTool(run.config, best.candidate, representation, earned)
            tools[held.name] = held

    return list(tools.values())


def best_cell(task: str, evaluations: Sequence[Evaluation]) -> Cell:
    """Return what was best in a task."""
    found = [evaluation.in_task(task) for evaluation in evaluations]
    tried = [evaluation for evaluation in found if evaluation.candidate.problem is None]
    if not tried:
        return Cell()

    best = max(tried, key=lambda evaluation: evaluation.reward)

    return Cell(best.reward, best.candidate.plan)


def task_configs(task: Mapping[str, Any]) -> TaskConfigs:
    """Return the tasks of a run's configuration of them, by name, as far as they change what happens."""
    found = {}
    for part in read_parts(TASK, task.get("of", [dict(task)])).values():
        found[part.create().name] = {"name": part.name, **dict(part.settings)}

    return found


def all_task_configs(runs: Iterable[FinishedRun], more: list[Any]) -> TaskConfigs:
    """Return the tasks of runs, and ``more``: names, or mappings of a ``name`` and settings.

    Raises:
        UserError: a task has different settings in two of them, or can't be used.
    """
    tasks = []
    for run in runs:
        stored, _ = take_stored(run.config, run.folder, kinds=["task"])
        tasks.append(stored["task"])
    if more:
        tasks.append({"name": "multitask", "of": more})
    found: dict[str, TaskConfig] = {}
    for task in tasks:
        for name, settings in task_configs(task).items():
            if found.setdefault(name, settings) != settings:
                raise UsageError(
                    f"{name} has different settings in these runs; give runs with the same"
                )

    return found
