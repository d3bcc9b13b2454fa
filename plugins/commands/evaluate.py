"""``vlmgineer evaluate task=NAME designs=FILE [output=FILE.json]``: rewards of the designs in a file, without a
model. With ``designs=RUN_FOLDER`` the best design of a run is tried as the run did.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, OmegaConf

from core.config.compose import load, task_part
from core.config.schemas import PromptSettings
from core.designs.reading import load_designs
from core.errors import UsageError, UserError
from core.interfaces import Task
from core.plugins import installed
from core.search.run_settings import KINDS, take_over, take_run
from core.search.saved_designs import build_fitness, read_candidates, try_all
from core.simulation.checking import find_problems
from core.simulation.measuring import figures
from core.support.cli import (
    arguments,
    key_of,
    print_table,
    read_path,
    say,
    write_bytes,
)
from core.support.text import by_reason, clean, number
from core.trial import Evaluation, mean_figure
from plugins.commands.filming import film_best

USAGE = (
    "usage: vlmgineer evaluate task=NAME designs=FILE | designs=RUN_FOLDER [sim=NAME] [seed=N] [output=FILE.json] "
    "[film=true] [KEY=VALUE ...]"
)
MISSES = ("ik_error_m", "ik_error_rad", "tracking_error_rad")
MAX_REMARK = 2000  # characters
_KINDS = (*KINDS, "sim", "fitness")


def evaluate(cfg: DictConfig) -> list[Evaluation]:
    """Try every action plan in ``cfg.designs``, in the file's order.

    Returns:
        An evaluation of each, those that break a rule included.

    Raises:
        UserError: the file can't be used, or a part or setting is wrong.
    """
    document = load_designs(Path(cfg.designs))
    fitness = build_fitness(cfg)

    return try_all(cfg, read_candidates(cfg, document), fitness)


def check_all(cfg: DictConfig) -> Iterator[str]:
    """Yield what is wrong with the plans in ``cfg.designs`` before they are played, a line for each.

    Of several layouts the line says in how many of them, and in which one first. Below it stand the blocks of a plan
    that looks again.

    Raises:
        UserError: see `evaluate`.
    """
    conditions = build_fitness(cfg).conditions()
    document = load_designs(Path(cfg.designs))

    for candidate in read_candidates(cfg, document):
        found = [
            (f"layout {condition.layout}", problem)
            for condition in conditions
            for problem in find_problems(condition, candidate)
        ]
        alone = list(dict.fromkeys(problem for _, problem in found))
        several = len(conditions) > 1
        lines = list(map(str, by_reason(found))) if several else alone
        problems = clean("; ".join(lines), MAX_REMARK) or "nothing found"
        yield f"design {candidate.design} plan {candidate.action}: {problems}"
        for line in candidate.plan.outline():
            yield f"  {line}"


def record(evaluation: Evaluation, task: Task) -> dict[str, Any]:
    """Make one entry of the output file.

    Numbers that are not known are null. What was observed of the rollout stands in words, as in prompts.
    """
    shown = evaluation.shown
    misses = {
        name: None if shown is None else _known(shown.figure(name)) for name in MISSES
    }
    means = {
        name: _known(mean_figure(evaluation.trials, name))
        for name in figures()
        if name not in MISSES
    }
    level = installed().factory("level", PromptSettings.context)()

    hardest = evaluation.hardest
    least = evaluation.least_margin

    return {
        "design": evaluation.candidate.design,
        "plan": evaluation.candidate.action,
        "reward": evaluation.reward,
        "solved": evaluation.solved,
        **means,
        "status": evaluation.status,
        "reason": evaluation.reason,
        "refusals": [refusal.dump() for refusal in evaluation.refusals],
        **misses,
        "torque_share": None if hardest is None else hardest.share,
        "torque_joint": None if hardest is None else hardest.joint,
        "room": None if least is None else evaluation.room_left,
        "least_margin": "" if least is None else str(least),
        "warnings": list(evaluation.warnings),
        **level.report(evaluation, task),
    }


def _known(number: float) -> float | None:
    """Return a number that JSON can hold; None: it is not known."""
    return number if math.isfinite(number) else None


def configured(words: Sequence[str]) -> DictConfig:
    """Compose the configuration of this command; of a run's folder its settings count, and its best design.

    Raises:
        UserError: no designs are given, or the run's configuration can't be used here.
    """
    run, left = take_run(words, _KINDS)
    cfg = load("evaluate", left)
    if OmegaConf.is_missing(cfg, "designs"):
        raise UsageError(f"no designs file given; {USAGE}")

    if run is not None:
        take_over(cfg, run, set(map(key_of, left)), _KINDS)
        cfg.designs = str(read_path(cfg.designs) / "best" / "design.json")

    return cfg


def main(words: list[str]) -> None:
    """Try the designs that the command line names, and print what they earned; or with ``check`` what is wrong.

    Raises:
        UserError: no designs are given, all are rejected, or see `evaluate`.
    """
    cfg = configured(arguments(USAGE, words))

    if cfg.check:
        for line in check_all(cfg):
            say(line)

        return

    task = task_part(cfg).create()
    evaluations = evaluate(cfg)
    records = [record(evaluation, task) for evaluation in evaluations]
    if cfg.output is not None:
        write_bytes(Path(cfg.output), (json.dumps(records, indent=2) + "\n").encode())

    show(records)
    if all(evaluation.status == "rejected" for evaluation in evaluations):
        raise UserError(
            f"none of {len(evaluations)} plans was tried: all are rejected, for the reasons above"
        )

    if cfg.film:
        film_best(cfg, evaluations, task)


def show(records: Sequence[Mapping[str, Any]]) -> None:
    """Print a table, and below it what is to be said of single plans.

    That is why one was rejected or earned nothing, warnings, and the rewards in each engine where there are several.
    """
    misses = ("IK miss mm", "lag rad", "torque %")
    numbers = ("design", "plan", "reward", "room %", "distance m", *misses)
    print_table((*numbers, "status"), [_row(entry) for entry in records], numbers)

    for entry in records:
        engines = entry.get("details", {}).get("engines", {})
        observed = entry.get("observed") or ""
        causes = filter(None, (entry["reason"], *entry["warnings"]))
        remarks = [cause for cause in causes if cause not in observed]
        least = entry.get("least_margin")
        if least and not entry["reason"]:
            remarks.append(f"least margin: {least}")

        remarks.append(observed)
        for engine, summary in engines.items():
            rewards = " ".join(number(reward, 3) for reward in summary["rewards"])
            remarks.append(f"{engine}: {rewards}")

        for remark in filter(None, remarks):
            name = f"design {entry['design']} plan {entry['plan']}"
            say(f"{name}: {clean(remark, MAX_REMARK)}")


def _row(entry: Mapping[str, Any]) -> tuple[str, ...]:
    """Make the row of an entry; the misses are in mm and rad, the torque in % of the hardest joint's limit."""
    return (
        str(entry["design"]),
        str(entry["plan"]),
        number(entry["reward"], 3),
        _format(entry["room"], ".0f", 100),
        _format(entry["distance_m"], ".2f"),
        _format(entry["ik_error_m"], ".0f", 1000),
        _format(entry["tracking_error_rad"], ".3f"),
        _format(entry["torque_share"], ".0f", 100),
        entry["status"],
    )


def _format(value: float | None, form: str, scale: float = 1) -> str:
    """Write a number, scaled; empty where it is not known."""
    return "" if value is None else format(scale * value, form)
