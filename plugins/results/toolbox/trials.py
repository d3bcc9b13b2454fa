"""Try a tool of a finished run on other tasks: runs that design plans for it alone, in folders that are kept."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, OmegaConf

from core.config.compose import listed, load, part, task_part, tool_part
from core.design import DesignError, Tool
from core.designs.reading import save_design
from core.designs.start import SpawnRules
from core.errors import UsageError, UserError
from core.events import INTERRUPTED
from core.interfaces import ActionPlan, ToolRepresentation
from core.plugins import TASK, installed
from core.search.orchestration import run as search
from core.store.database import writing
from core.store.reader import StoredRun, chosen_evaluations, stored_evaluations
from core.store.recorder import RunStore
from core.trial import Evaluation
from core.values.plans import digest
from plugins.results.pages.figure import slug
from plugins.results.pages.runs import FinishedRun

BUDGET = {"n_agent": 1, "n_action": 4, "n_iteration": 1, "k_top": 2, "reward_save": 0.0}
DEFAULTS = (
    "film=false",
    "listener=[]",
    *(f"budget.{key}={value}" for key, value in BUDGET.items()),
)
OF_RUN = (
    "robot",
    "sim",
    "action",
    "material",
    "fitness",
    "rollout",
    "seed",
)  # settings that tools are tried with
FREE = {
    "tool",
    "task",
    "executor",
    "listener",
    "film",
}  # settings that what was tried does not depend on

Nodes = Mapping[str, dict[str, Any]]
"""The configurations of tasks, by their names."""


Cell = tuple[float, ActionPlan | None]
"""What a tool earned in a task with its best plan, and that plan; None: no plan could be tried."""
NOTHING: Cell = (0.0, None)


@dataclass(frozen=True, eq=False)
class Held:
    """A tool of a run, with its best plan."""

    run: FinishedRun
    best: Evaluation
    representation: ToolRepresentation

    @property
    def tool(self) -> Tool:
        assert self.best.candidate.tool is not None  # it was tried
        return self.best.candidate.tool

    @property
    def name(self) -> str:
        """A name for a folder, the same for the same tool."""
        return f"{slug(self.tool.name, 24) or 'tool'}_{digest(self.tool.content)[:6]}"


def tools_of(run: FinishedRun, top: int) -> list[Held]:
    """Read the tools of the ``top`` candidates of a run again, that which it chose first; a given tool is none.

    Raises:
        UserError: the run can't be read, or a part of it is not installed here.
    """
    config = OmegaConf.create({**run.config, "designs": str(run.folder), "top": top})
    task, representation = task_part(config).create(), tool_part(config).create()
    if representation.given(task) is not None:
        return []
    return [
        Held(run, best, representation)
        for best in chosen_evaluations(config, representation, task)
    ]


def nodes_of(config: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the configurations of a run's tasks, by name, as far as they change what happens."""
    task = config["task"]
    each = (
        listed("task", "task", task["of"]).values()
        if "of" in task
        else [OmegaConf.create(task)]
    )
    plain = [
        {str(key): node[key] for key in node if key not in ("paper", "tool_kinds")}
        for node in each
    ]
    return {part(TASK, OmegaConf.create(node)).create().name: node for node in plain}


def together(nodes: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the configuration of a task of several parts, or of one; a given tool is of its own kind."""
    each = [{**node, "tool_kinds": ["rigid"]} for node in nodes]
    return (
        each[0]
        if len(each) == 1
        else {"name": "several", "of": each, "combine": "mean", "tool_kinds": []}
    )


def _cells(
    config: Mapping[str, Any], tried: Sequence[Evaluation]
) -> Iterator[tuple[str, dict[str, Any], Cell]]:
    """Yield the name and configuration of each task of a run, and what was best in it."""
    for name, node in nodes_of(config).items():
        plans = [
            one for e in tried if (one := e.in_task(name)).candidate.problem is None
        ]
        best = max(plans, key=lambda e: e.reward, default=None)
        yield (
            name,
            node,
            NOTHING if best is None else (best.reward, best.candidate.plan),
        )


def attempt(
    held: Held, nodes: Nodes, words: Sequence[str], output: Path
) -> dict[str, Cell]:
    """Return what a tool earns in each task: as its run says, as was tried before, or by a search for plans.

    ``words`` are settings of that search (`core.run`). What was tried stays in ``output``.

    Raises:
        UserError: a part or setting can't be used, or a limit ended the search.
        KeyboardInterrupt: the search was interrupted; says how to go on.
    """
    file = output.resolve() / "tried" / held.name / "design.json"
    with writing(output):
        save_design(held.best.candidate, held.representation, file.parent)
    config = configured(held, file, words)
    settings = {str(key): value for key, value in config.items() if key not in FREE}
    folder = file.parent / digest(OmegaConf.to_yaml(OmegaConf.create(settings)))[:8]
    same = all(config[kind] == held.run.config[kind] for kind in OF_RUN)
    tried = _cells(held.run.config, [held.best]) if same else ()
    found = {name: cell for name, node, cell in tried if nodes.get(name) == node}
    left = [
        node
        for name, node in nodes.items()
        if name not in found and _starts(held, config, node)
    ]
    if left:
        one = folder / digest(sorted(map(str, left)))[:8]
        if not _tried(one, file):
            OmegaConf.update(config, "task", together(left), merge=False)
            one.mkdir(parents=True, exist_ok=True)
            stopped = search(
                config, one, RunStore.open(one)
            ).stopped  # goes on with what is there
            if stopped is not None:
                error = KeyboardInterrupt if stopped == INTERRUPTED else UserError
                raise error(f"stopped: {stopped}; the same command goes on")
        found |= {name: cell for name, _, cell in _tried(one, file)}
    return dict.fromkeys(nodes, NOTHING) | found


def _starts(held: Held, config: DictConfig, node: Mapping[str, Any]) -> bool:
    """Report whether the tool starts clear of everything in a task."""
    task = part(TASK, OmegaConf.create(dict(node))).create(
        robot=held.representation.robot
    )
    try:
        SpawnRules(task, config.seed).check(held.tool)
    except DesignError:
        return False
    return True


def groups(words: Sequence[str]) -> set[str]:
    """Return the first parts of the keys that words set."""
    return {word.lstrip("+~").partition("=")[0].partition(".")[0] for word in words}


def configured(held: Held, file: Path, words: Sequence[str]) -> DictConfig:
    """Compose the configuration of a search for plans for the tool in ``file``, still for no task.

    Raises:
        UserError: a setting can't be used.
    """
    named = {word.lstrip("+~").partition("=")[0] for word in words}
    if given := groups(words) & {"task", "tool"}:
        raise UsageError(
            f"{min(given)} can't be set: tools are those of the runs; more tasks are tasks=[NAME,...]"
        )
    config = load(
        "config",
        [*(word for word in DEFAULTS if word.partition("=")[0] not in named), *words],
    )
    for kind in {*OF_RUN} - groups(words):
        OmegaConf.update(
            config, kind, held.run.config[kind], merge=kind in ("material", "rollout")
        )
    OmegaConf.update(
        config,
        "tool",
        {"name": "known", "file": str(file), "of": held.run.config["tool"]},
        merge=False,
    )
    if not getattr(installed().factory("vlm", config.vlm.name), "sees", True):
        config.prompt.picture = False
    return config


def _tried(folder: Path, file: Path) -> list[tuple[str, dict[str, Any], Cell]]:
    """Return what a search that came to its end found for the tool in ``file``."""
    store = StoredRun(folder)
    if not store.exists:
        return []
    config, result = store.config(), store.result()
    if result is None or result.stopped is not None:
        return []
    config["tool"]["file"] = str(file)  # the folder may have been moved
    known = OmegaConf.create(config)
    representation, tasks = tool_part(known).create(), task_part(known).create()
    found = stored_evaluations(folder, representation, tasks)
    return [*_cells(config, found)]
