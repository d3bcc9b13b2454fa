"""Shared by the measurements: the designs, and their rewards in an engine.

All results are kept in a folder, so that an interrupted measurement can go on: ``designs/TASK.json`` is a designs file,
``rewards/TASK.json`` has a record per engine.
"""

from __future__ import annotations

import json
import math
import os
import tempfile
import typing
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException
from rich.console import Console
from rich.progress import track

from core.config.compose import load, part
from core.design import Candidate
from core.designs.reading import dump_design, load_designs, read_designs
from core.designs.rules import SpawnRules
from core.errors import UsageError, UserError, choices
from core.interfaces import Executor, RolloutSettings
from core.plugins import installed
from core.search.evolution import evaluate_all
from core.search.orchestration import INTERRUPTED, run
from core.simulation.rollout import Evaluator, PluginPart
from core.store.reader import stored_evaluations

T = TypeVar("T")

SOLUTIONS = Path(__file__).parents[1] / "tasks" / "solutions"
N_TOOL = 5
N_ACTION = 3
N_ITERATION = 2
SPARE = 1.2  # designs more than needed in a generation, since some may be rejected

console = Console(stderr=True)


# --- the command line -------------------------------------------------------------------------------------------


def settings(words: Sequence[str], of: type[T]) -> T:
    """Parse ``KEY=VALUE`` words into a dataclass; a list may be written without brackets.

    Raises:
        UsageError: an unknown key, or a value of the wrong type.
    """
    known = OmegaConf.structured(of)
    lists = {f.name for f in fields(of) if str(f.type).startswith("list")}  # type: ignore[arg-type]
    dotted = []
    for word in words:
        key, _, value = word.partition("=")
        if key not in known:
            raise choices("key", key, [str(name) for name in known])
        dotted.append(f"{key}=[{value}]" if key in lists and not value.startswith("[") else word)
    try:
        made = OmegaConf.to_object(OmegaConf.merge(known, OmegaConf.from_dotlist(dotted)))
    except OmegaConfBaseException as error:
        raise UsageError(" ".join(str(error).split())) from error
    return typing.cast(T, made)


def tasks(names: Sequence[str]) -> list[str]:
    """Return the named tasks; all that every engine can play if ``names`` is empty.

    Raises:
        UsageError: no task has such a name.
    """
    there = installed().ready("task")
    for name in names:
        if name not in there:
            raise choices("task", name, there)
    return list(names) or [name for name in there if not installed().create("task", name).scene(0).softs]


def workers(number: int | None) -> int:
    """Return the number of workers, by default the number of cores.

    Raises:
        UsageError: fewer than one.
    """
    if number is not None and number < 1:
        raise UsageError(f"workers must be at least 1, got {number}")
    return number if number is not None else len(os.sched_getaffinity(0))


def executor(workers: int) -> Executor:
    """Make the worker processes for all measurements."""
    made: Executor = part("executor", load("evaluate", [f"executor.workers={workers}"]).executor).create()
    return made


# --- designs ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Designs:
    """A task's candidates of the embedded designer: half are its first samples, half are offspring."""

    task: str
    seed: int
    candidates: tuple[Candidate, ...]


def designs(task: str, count: int, by: str, seed: int, workers: int, folder: Path) -> Designs:
    """Return about ``count`` designs of a short run in the engine ``by``, taken evenly from all that it tried.

    The run's elites are its best, however little they earn; the choice does not depend on rewards. Designs of such a
    run that the folder already has are used as they are.

    Raises:
        UserError: the folder has another run's designs.
    """
    file = folder / "designs" / f"{task}.json"
    origin = {"task": task, "by": by, "seed": seed}
    if not file.exists():
        file.parent.mkdir(parents=True, exist_ok=True)
        save(file, origin | {"count": count} | _designed(task, count, by, seed, workers))
    document = typing.cast(dict[str, Any], load_designs(file))
    stored = {key: document[key] for key in origin}
    if stored != origin:
        raise UserError(f"{file} has other designs, {stored}; choose another folder=...")
    plugins = installed()
    spawn = SpawnRules(plugins.create("task", task), seed)
    return Designs(task, seed, tuple(read_designs(document, plugins.create("tool", "urdf"), spawn)))


def population(count: int) -> dict[str, int]:
    """Return the run's budget for ``count`` designs."""
    half = math.ceil(count / 2)
    n_tool = min(N_TOOL, half)
    n_action = min(N_ACTION, half)
    return {"n_agent": math.ceil(SPARE * half / (n_tool * n_action)), "n_tool": n_tool, "n_action": n_action}


def _designed(task: str, count: int, by: str, seed: int, workers: int) -> dict[str, Any]:
    words = [f"task={task}", f"sim={by}", f"seed={seed}", "film=false", "listener=[]", "vlm=offline", "tool=urdf"]
    words += [f"budget.{key}={value}" for key, value in population(count).items()]
    words += [f"budget.n_iteration={N_ITERATION}", "budget.reward_save=0", f"executor.workers={workers}"]
    plugins = installed()
    representation = plugins.create("tool", "urdf")
    with tempfile.TemporaryDirectory() as folder:
        if run(load("config", words), Path(folder) / "run").stopped == INTERRUPTED:
            raise KeyboardInterrupt  # half of a run is not kept as the whole
        spawn = SpawnRules(plugins.create("task", task), seed)
        tried = [e.candidate for e in stored_evaluations(Path(folder) / "run", representation, spawn)]
    first = [c for c in tried if c.generation == 0]
    later = [c for c in tried if c.parents]
    chosen = evenly(first, math.ceil(count / 2)) + evenly(later, count // 2)
    strategies: dict[tuple[int, int, int], dict[str, Any]] = {}
    for candidate in chosen:
        design = dump_design(candidate, representation)
        plans = strategies.setdefault(candidate.key[:3], design | {"action_sets": []})["action_sets"]
        plans += design["action_sets"]
    return {"ids": [c.id for c in chosen], "strategies": list(strategies.values())}


def evenly(items: Sequence[T], count: int) -> list[T]:
    """Pick ``count`` items at equal distances, in their order; all if there are fewer."""
    indices = np.linspace(0, len(items) - 1, min(count, len(items))).round().astype(int)
    return [items[i] for i in indices]


# --- rewards ----------------------------------------------------------------------------------------------------


def rewards(of: Designs, sim: PluginPart, shown: str, executor: Executor, folder: Path) -> dict[str, Any]:
    """Return a record of each design in an engine: ``rewards``, ``reasons`` of those that broke (their reward is
    0), and the engine's settings.

    Raises:
        UserError: the folder has a record of other designs.
    """
    file = folder / "rewards" / f"{of.task}.json"
    records: list[dict[str, Any]] = json.loads(file.read_text()) if file.exists() else []
    engine = {"name": sim.name, **dict(sim.settings)}
    plans = [candidate.plan.poses.tolist() for candidate in of.candidates]
    for record in records:
        if record["engine"] == engine:
            if len(record["rewards"]) != len(plans):
                raise UserError(f"{file} has rewards of {len(record['rewards'])} designs; choose another folder=...")
            return record
    evaluator = Evaluator(PluginPart("task", of.task), sim, of.seed, RolloutSettings())
    evaluations = list(
        track(
            evaluate_all(of.candidates, evaluator, executor),
            f"{of.task} in {shown}",
            total=len(of.candidates),
            console=console,
            disable=not console.is_terminal,
        )
    )
    evaluations.sort(key=lambda e: e.candidate.key)
    record = {
        "engine": engine,
        "rewards": [e.reward for e in evaluations],
        "reasons": {e.candidate.id: e.reason for e in evaluations if e.status != "ok"},
    }
    file.parent.mkdir(parents=True, exist_ok=True)
    save(file, [*records, record])
    return record


# --- files ------------------------------------------------------------------------------------------------------


def save(file: Path, content: Any) -> None:
    """Write JSON, so that the file is whole or absent."""
    new = file.with_suffix(".new")
    new.write_text(json.dumps(content, indent=1) + "\n")
    new.replace(file)
