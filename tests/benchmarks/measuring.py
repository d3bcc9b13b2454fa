"""Shared by the measurements: their command lines, designs, and rewards in an engine."""

from __future__ import annotations

import itertools
import json
import math
import os
import typing
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException
from rich.console import Console
from rich.progress import track

from core.config.compose import load, part
from core.design import Candidate
from core.designs.reading import read_designs
from core.designs.replies import parse_reply
from core.errors import UsageError, UserError, choices
from core.interfaces import Executor
from core.plugins import PluginPart, installed
from core.trial import Condition
from plugins.commands.prompt import PromptConfig, compose
from plugins.conformance.shared import ready
from tests.support.playing import evaluate_all

T = TypeVar("T")

SOLUTIONS = Path(__file__).parents[1] / "tasks" / "solutions"
SPARE = 1.25  # tools more than needed, since some may be rejected

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
        dotted.append(
            f"{key}=[{value}]" if key in lists and not value.startswith("[") else word
        )
    try:
        made = OmegaConf.to_object(
            OmegaConf.merge(known, OmegaConf.from_dotlist(dotted))
        )
    except OmegaConfBaseException as error:
        raise UsageError(" ".join(str(error).split())) from error
    return typing.cast(T, made)


def tasks(names: Sequence[str]) -> list[str]:
    """Return the named tasks; all that every engine can play if ``names`` is empty.

    Raises:
        UsageError: no task has such a name.
    """
    there = ready("task")
    for name in names:
        if name not in there:
            raise choices("task", name, there)
    return list(names) or [
        name for name in there if not installed().create("task", name).scene(0).softs
    ]


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
    made: Executor = part(
        "executor", load("evaluate", [f"executor.workers={workers}"]).executor
    ).create()
    return made


# --- designs ----------------------------------------------------------------------------------------------------


def designs(task: str, tools: int, plans: int, seed: int) -> list[Candidate]:
    """Return ``plans`` motions for each of ``tools`` tools, from the embedded designer's first answer.

    Raises:
        UserError: too few of them keep the rules.
    """
    n_tool = math.ceil(SPARE * tools)
    words = [f"task={task}", "vlm=offline", "tool=urdf", f"seed={seed}"]
    budget = {"n_agent": 1, "n_tool": n_tool, "n_action": plans, "n_iteration": 0}
    words += [f"budget.{key}={value}" for key, value in budget.items()]
    cfg = load("prompt", words, PromptConfig)
    (reply,) = part("vlm", cfg.vlm).create().complete([compose(cfg)])
    representation = part("tool", cfg.tool).create()
    read = read_designs(
        parse_reply(reply.text),
        representation,
        installed().create("task", task),
        most=(n_tool, plans),
    )
    groups = itertools.groupby(
        (c for c in read if c.problem is None), key=lambda c: c.design
    )
    whole = [
        group for group in (list(group) for _, group in groups) if len(group) == plans
    ]
    if len(whole) < tools:
        raise UserError(
            f"{task}: {len(whole)} tools of {n_tool} keep the rules; ask for fewer than tools={tools}"
        )
    return [candidate for group in whole[:tools] for candidate in group]


# --- rewards ----------------------------------------------------------------------------------------------------


def rewards(
    task: str,
    candidates: Sequence[Candidate],
    sim: PluginPart,
    seed: int,
    executor: Executor,
    file: Path,
) -> None:
    """Add a record of each design in an engine to a file: ``rewards``, ``reasons`` of those that broke (their reward is
    0), and the engine's settings; unless the file has it.
    """
    records: list[dict[str, Any]] = (
        json.loads(file.read_text()) if file.exists() else []
    )
    engine = {"name": sim.name, **dict(sim.settings)}
    if any(record["engine"] == engine for record in records):
        return
    tried = evaluate_all(
        candidates, Condition(PluginPart("task", task), sim, seed), executor
    )
    shown = track(
        tried,
        f"{task} in {sim.name}",
        len(candidates),
        console=console,
        disable=not console.is_terminal,
    )
    evaluations = sorted(shown, key=lambda evaluation: evaluation.candidate.key)
    record = {
        "engine": engine,
        "rewards": [evaluation.reward for evaluation in evaluations],
        "reasons": {e.candidate.id: e.reason for e in evaluations if e.status != "ok"},
    }
    file.parent.mkdir(parents=True, exist_ok=True)
    save(file, [*records, record])


# --- files ------------------------------------------------------------------------------------------------------


def save(file: Path, content: Any) -> None:
    """Write JSON, so that the file is whole or absent."""
    new = file.with_suffix(".new")
    new.write_text(json.dumps(content, indent=1) + "\n")
    new.replace(file)
