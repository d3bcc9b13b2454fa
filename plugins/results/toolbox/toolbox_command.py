"""``vlmgineer toolbox RUN...``: try the tools of finished runs on each other's tasks, and choose few that do most.

``vlmgineer toolbox add RUN...`` keeps them in a library, which may stand in the place of runs.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from core.config.compose import load, node
from core.designs.planning import parse_plan
from core.errors import UsageError
from core.interfaces import ActionPlan
from core.plugins import ACTION, installed
from core.support.cli import key_of, say, write_bytes
from core.support.templates import macros
from plugins.results.artifacts import save_design
from plugins.results.named_folders import folders_and_overrides
from plugins.results.pages.formats import Table, show_table, to_csv
from plugins.results.pages.runs import find_runs
from plugins.results.toolbox.choice import Toolbox, ToolboxConfig, toolbox
from plugins.results.toolbox.held_tools import find_tools
from plugins.results.toolbox.library import keep_tool

USAGE = (
    "usage: vlmgineer toolbox FOLDER [FOLDER ...] [output=DIR] [tasks=[NAME,...]] [good=0.9] [top=1] "
    "[KEY=VALUE ...]; FOLDER is a run's, holds runs or is a library, and other keys are those of core.run; or "
    "vlmgineer toolbox add FOLDER [FOLDER ...] [output=LIBRARY] [top=1]"
)
CHOSEN = "chosen"
LIBRARY = "library"
TABLE = "rewards.csv"


def tabulate(found: Toolbox) -> Table:
    """Make the table of what each tool earned in each task."""
    head = "|".join(["tool", *(f"{task}:2" for task in found.tasks)])
    rows = zip(found.tools, found.rewards.tolist(), strict=True)
    return Table.of("rewards", head, ((tool.name, *row) for tool, row in rows))


def write(found: Toolbox, output: Path) -> None:
    """Write the rewards as a table, and the chosen tools with their plans."""
    write_bytes(output / TABLE, to_csv(tabulate(found), output).encode())

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

    candidate = replace(tool.candidate, plan=plan)
    save_design(candidate, tool.representation, folder)


def _join_plans(plans: Mapping[str, ActionPlan], *, gripper: bool) -> ActionPlan:
    """Make one plan of those for several tasks."""
    entries = []
    for task, plan in plans.items():
        entries.append({"task": task, "action": plan.action, "plan": plan.dump()})

    return parse_plan(installed().create(ACTION, "multitask"), entries, gripper)


def show(found: Toolbox) -> None:
    """Print the rewards, and the sets that do most."""
    show_table(tabulate(found))
    for tools in found.sets:
        say(macros("plugins.results", "words").do_most(found, tools))


def add(words: list[str]) -> None:
    """Keep the tools of runs in a library."""
    folders, overrides = folders_and_overrides(USAGE, words)
    if not folders:
        raise UsageError(f"no folder given; {USAGE}")

    output = [f"output={LIBRARY}", *overrides]
    cfg = node(load("toolbox", output, ToolboxConfig), ToolboxConfig)
    runs, left_out = find_runs(folders)
    for lost in left_out:
        say(f"not kept, {lost}")
    for run in runs:
        for tool in find_tools([run], cfg.top):
            say(str(keep_tool(run, tool, Path(cfg.output))))


def main(words: list[str]) -> None:
    if words[:1] == ["add"]:
        add(words[1:])
        return

    folders, overrides = folders_and_overrides(USAGE, words)
    if not folders:
        raise UsageError(f"no folder given; {USAGE}")

    keys = vars(ToolboxConfig())
    settings = [word for word in overrides if key_of(word) in keys]
    of_searches = [word for word in overrides if word not in settings]
    cfg = node(load("toolbox", settings, ToolboxConfig), ToolboxConfig)
    found = toolbox(folders, cfg, of_searches)
    output = Path(cfg.output)
    write(found, output)
    show(found)
    say(str(output / TABLE))
