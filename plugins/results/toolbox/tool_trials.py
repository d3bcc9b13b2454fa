"""Try a tool that was found on other tasks: runs that design plans for it alone, in folders that are kept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, OmegaConf

from core.config.compose import load, part, task_part, tool_part
from core.config.gate import take_stored
from core.design import DesignError
from core.designs.start import SpawnRules
from core.errors import UsageError, UserError
from core.events import INTERRUPTED
from core.plugins import TASK, installed
from core.search.orchestration import run as search
from core.store.library import OF_RUN
from core.store.reader import StoredRun
from core.store.recorder import RunStore
from core.support.cli import key_of
from core.support.files import writing
from core.support.text import hydra_word
from core.values.contents import digest
from plugins.results.artifacts import save_design
from plugins.results.chosen import stored_evaluations
from plugins.results.toolbox.held_tools import (
    Cell,
    Cells,
    HeldTool,
    TaskConfig,
    TaskConfigs,
    best_cell,
    task_configs,
)

BUDGET = {
    "n_agent": 1,
    "n_tool": 1,
    "n_action": 4,
    "n_iteration": 1,
    "k_top": 2,
    "reward_save": 0.0,
}
DEFAULTS = {"film": "false", "listener": "[]"} | {
    f"budget.{key}": str(value) for key, value in BUDGET.items()
}

FREE = ("tool", "task", "executor", "listener", "film")
"""Settings that what was tried does not depend on."""


def attempt(
    held: HeldTool, tasks: TaskConfigs, words: Sequence[str], output: Path
) -> Cells:
    """Find what a tool earns in each task: as its run says, as was tried before, or by a search for plans.

    Args:
        held: the tool, with its best plan.
        tasks: by name.
        words: settings of that search (`core.run`).
        output: the folder in which all that was tried stays.

    Raises:
        UserError: a part or setting can't be used, or a limit ended the search.
        KeyboardInterrupt: the search was interrupted; says how to go on.
    """
    file = output.resolve() / "tried" / held.name / "design.json"
    with writing(output):
        save_design(held.candidate, held.representation, file.parent)

    config = configure(held, file, words)
    cells: Cells = dict.fromkeys(tasks, Cell())
    left = dict(tasks)
    if all(config[kind] == held.config[kind] for kind in OF_RUN):
        for name, task in task_configs(held.config["task"]).items():
            if left.get(name) == task:
                cells[name] = held.earned[name]
                del left[name]

    to_try = [task for task in left.values() if _starts(held, config, task)]
    if not to_try:
        return cells

    folder = _folder(file.parent, config, to_try)
    found = _read(folder, file)
    if found is None:
        _search(config, to_try, folder)
        found = _read(folder, file)

    return cells | (found or {})


def _starts(held: HeldTool, config: DictConfig, settings: TaskConfig) -> bool:
    """Report whether the tool starts clear of everything in a task."""
    robot = held.representation.robot
    task = part(TASK, OmegaConf.create(settings)).create(robot=robot)
    try:
        SpawnRules(task, config.seed).check(held.tool)
    except DesignError:
        return False

    return True


def _folder(parent: Path, config: DictConfig, tasks: Sequence[TaskConfig]) -> Path:
    """Return the folder of a search for plans with these settings, for these tasks."""
    settings = {str(key): value for key, value in config.items() if key not in FREE}
    text = OmegaConf.to_yaml(OmegaConf.create(settings))
    return parent / digest(text)[:8] / digest(sorted(map(str, tasks)))[:8]


def _search(config: DictConfig, tasks: Sequence[TaskConfig], folder: Path) -> None:
    """Search for plans, or go on with what is in the folder.

    Raises:
        UserError: a limit ended the search.
        KeyboardInterrupt: it was interrupted.
    """
    # A given tool is of its own kind.
    rigid = [{**task, "tool_kinds": ["rigid"]} for task in tasks]
    task = rigid[0]
    if len(rigid) > 1:
        task = {"name": "multitask", "of": rigid, "combine": "mean", "tool_kinds": []}

    OmegaConf.update(config, "task", task, merge=False)
    folder.mkdir(parents=True, exist_ok=True)
    stopped = search(config, folder, RunStore.open(folder)).stopped
    if stopped is not None:
        error = KeyboardInterrupt if stopped == INTERRUPTED else UserError
        raise error(f"stopped: {stopped}; the same command goes on")


def _read(folder: Path, file: Path) -> Cells | None:
    """Return what a search found for the tool in ``file``; None: it did not come to its end."""
    store = StoredRun(folder)
    if not store.exists:
        return None

    config = store.config()
    result = store.result()
    if result is None or result.stopped is not None:
        return None

    typed = [f"tool.file={hydra_word(str(file))}"]
    config, _ = take_stored(config, folder, typed, ("task", "tool", "robot"))
    config["tool"]["file"] = str(file)  # the folder may have been moved
    known = OmegaConf.create(config)
    representation = tool_part(known).create()
    found = stored_evaluations(folder, representation, task_part(known).create())

    return {name: best_cell(name, found) for name in task_configs(config["task"])}


def groups(words: Sequence[str]) -> set[str]:
    """Return the first parts of the keys that words set."""
    return {key_of(word).partition(".")[0] for word in words}


def configure(held: HeldTool, file: Path, words: Sequence[str]) -> DictConfig:
    """Compose the configuration of a search for plans for a tool, still for no task.

    Args:
        held: the tool, with the settings of its run, which count.
        file: where the tool is written.
        words: settings that go before those of the run.

    Raises:
        UserError: a setting can't be used.
    """
    given = groups(words)
    refused = given & {"task", "tool"}
    if refused:
        raise UsageError(
            f"{min(refused)} can't be set: tools are those of the runs; more tasks are tasks=[NAME,...]"
        )

    named = {key_of(word) for word in words}
    defaults = [f"{key}={DEFAULTS[key]}" for key in DEFAULTS if key not in named]
    config = load("config", [*defaults, *words])

    run: Mapping[str, Any] = held.config

    for kind in OF_RUN:
        if kind in given:
            continue
        merge = kind in ("material", "printer", "rollout")
        OmegaConf.update(config, kind, run[kind], merge=merge)

    tool = {"name": "known", "file": str(file), "of": run["tool"]}
    OmegaConf.update(config, "tool", tool, merge=False)
    if not getattr(installed().factory("vlm", config.vlm.name), "sees", True):
        config.prompt.picture = False

    return config
