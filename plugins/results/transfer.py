"""``vlmgineer transfer designs=FILE|RUN_DIR task=NAME robots=[NAME,...] sims=[NAME,...] seeds=[N,...]``: try
designs on several arms and in several engines, in the scene as it is and with small perturbations.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from omegaconf import MISSING, DictConfig

from core.config.compose import check_seed, engines, node, part, task_parts
from core.config.schemas import PartConfig
from core.interfaces import Condition, RolloutSettings, Task
from core.plugins import ROBOT, PluginPart
from core.support.cli import arguments, print_table, say, write_bytes
from core.support.text import clean, number
from plugins.results.chosen import DesignsConfig, config_for
from plugins.results.stations import (
    Bench,
    make_robots,
    make_robust,
    read_on_each,
    try_on_each,
)

USAGE = (
    "usage: vlmgineer transfer designs=FILE|RUN_DIR [task=NAME] [robots=[NAME,...]] [sims=[NAME,...]] "
    "[seeds=[N,...]] [perturbation.KEY=X] [top=N] [output=FILE.json] [KEY=VALUE ...]"
)


@dataclass
class TransferConfig(DesignsConfig):
    """Settings of ``vlmgineer transfer``, beside those of all that takes designs.

    Attributes:
        executor: whose workers try them.
        robots: entries as those of ``sims``; empty: ``robot`` alone.
        sims: the engines.
        seeds: those of the perturbations.
        perturbation: of the scene.
        output: a JSON file to write as well.
    """

    executor: PartConfig = MISSING
    robots: list[Any] = field(default_factory=list)
    sims: list[Any] = MISSING
    seeds: list[int] = MISSING
    perturbation: dict[str, Any] = MISSING
    output: str | None = None


def transfer(cfg: DictConfig) -> dict[str, Any]:
    """Try every design in every task on every robot in every engine, in the scene as it is and with each perturbation.

    Returns:
        The content of the output file.

    Raises:
        UserError: the designs can't be used on any robot, or a part or setting is wrong.
    """
    check_seed(cfg.seed)
    designs: list[dict[str, Any]] = []
    result: dict[str, Any] = {}

    for task in task_parts(cfg):
        found = _transfer(cfg, task)
        name = task.create().name
        designs += [{"task": name, **design} for design in found["designs"]]
        result = result or {"task": cfg.task.name, **found}

    return {**result, "designs": designs}


def _transfer(cfg: DictConfig, task: PluginPart[Task]) -> dict[str, Any]:
    """Try every design in one task (see `transfer`)."""
    # Settings first: what is wrong with them is said before anything is made.
    sims = engines(list(cfg.sims))
    settings = node(cfg.rollout, RolloutSettings)
    first = next(iter(sims.values()))
    robust = make_robust(cfg, Condition(task, first, cfg.seed, settings))
    robots = make_robots(list(cfg.robots), part(ROBOT, cfg.robot))
    candidates = read_on_each(cfg, task, robots)
    bench = Bench(task, sims, robust, cfg.seed, settings)
    designs = try_on_each(cfg, bench, robots, candidates)

    return {
        "seed": cfg.seed,
        "seeds": list(cfg.seeds),
        "perturbation": dict(cfg.perturbation),
        "robots": {
            robot: {"name": arm.name, **dict(arm.settings), "base": arm.base}
            for robot, arm in robots.items()
        },
        "engines": {
            engine: {"name": sim.name, **dict(sim.settings)}
            for engine, sim in sims.items()
        },
        "designs": designs,
    }


def configured(words: Sequence[str]) -> DictConfig:
    """Compose the configuration of this command (`config_for`).

    Raises:
        UserError: a word can't be used, or no designs are given.
    """
    return config_for(words, "transfer", TransferConfig, USAGE)


def main(words: list[str]) -> None:
    cfg = configured(arguments(USAGE, words))
    result = transfer(cfg)
    if cfg.output is not None:
        write_bytes(Path(cfg.output), (json.dumps(result, indent=2) + "\n").encode())

    show(result)


def show(result: Mapping[str, Any]) -> None:
    """Print a table of each design on each robot in each engine.

    It has the reward in the scene as it is and perturbed, the robust score, and how far the arm misses the plan.
    Below it stands what is to be said of single designs.
    """
    numbers = ("nominal", "perturbed", "robust", "IK error (mm)")
    rows: list[tuple[str, ...]] = []
    for design in result["designs"]:
        rows += _rows(design)

    print_table(("design", "task", "robot", "engine", *numbers), rows, numbers)

    count = len(result["seeds"])
    say(
        f"perturbed: mean ± standard deviation over {count} small perturbation{'s' if count > 1 else ''} of the scene",
        "robust: the lowest of the engines' means; IK error: how far the arm misses the plan at most",
    )

    for design in result["designs"]:
        name = f"{design['design']}, {design['task']}, {design['robot']}"
        remarks = [design["reason"]] if design["reason"] else design["warnings"]
        for remark in remarks:
            say(f"{name}: {clean(remark, 2000)}")


def _rows(design: Mapping[str, Any]) -> Iterator[tuple[str, ...]]:
    """Yield the row of a design in each engine.

    What holds in all engines stands in the first row alone.
    """
    missed_m = design["ik_error_m"]
    missed = "–" if missed_m is None else f"{1000 * missed_m:.0f}"
    once = (number(design["robust"], 3), missed)

    for engine, figures in design["engines"].items():
        nominal = number(figures["nominal"], 3)
        perturbed = f"{number(figures['mean'], 3)} ± {figures['std']:.3f}"
        names = (design["design"], design["task"], design["robot"])
        yield (*names, engine, nominal, perturbed, *once)
        once = ("", "")
