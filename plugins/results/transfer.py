"""``vlmgineer transfer designs=FILE|RUN_DIR task=NAME robots=[NAME,...] sims=[NAME,...] seeds=[N,...]``: try
designs on several arms and in several engines, in the scene as it is and with small perturbations.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from omegaconf import MISSING, DictConfig

from core.config.compose import (
    check_seed,
    engines,
    node,
    part,
    read_parts,
    task_part,
    task_parts,
    tool_part,
)
from core.config.schemas import PartConfig
from core.design import Candidate
from core.errors import UserError
from core.interfaces import Condition, Fitness, Robot, RolloutSettings, Task
from core.plugins import EXECUTOR, FITNESS, ROBOT, PluginPart, installed
from core.robot.kinematics import arm_of
from core.search.trials import Trials
from core.support.cli import arguments, print_table, say, write_bytes
from core.support.progress_display import busy
from core.support.text import clean, number
from core.trial import Evaluation, Trial, summarise_rewards
from plugins.results.chosen import DesignsConfig, chosen_evaluations, config_for

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
    perturbing = {
        "sims": [first.name],
        "seeds": list(cfg.seeds),
        "perturbation": dict(cfg.perturbation),
    }
    where = Condition(task, first, cfg.seed, settings)
    robust = installed().create(FITNESS, "robust", perturbing, condition=where)
    chosen = part(ROBOT, cfg.robot)
    robots = read_parts(ROBOT, list(cfg.robots) or [chosen.name], chosen)
    for robot in robots.values():
        robot.create()  # so that a fault is reported once

    changes = [None, *(condition.change for condition in robust.conditions())]
    read = _read_on_each(cfg, task, robots)
    designs: list[dict[str, Any]] = []
    with part(EXECUTOR, cfg.executor).create() as executor, busy("trials") as step:
        for name, robot in robots.items():
            on_robot = replace(task, robot=robot)
            conditions = [
                Condition(on_robot, sim, cfg.seed, settings, change, engine)
                for engine, sim in sims.items()
                for change in changes
            ]
            trials = Trials(executor)  # a robot's own: trials don't say which it is
            found = trials.try_in(conditions, read[name])
            for count, (candidate, tried) in enumerate(found, 1):
                step.what = f"trials on {name}  {count}/{len(read[name])}"
                all_tried = tried or _reject(candidate, conditions)
                designs.append(record(candidate, name, all_tried, robust))

    order = [candidate.id for candidate in next(iter(read.values()))]
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
        "designs": sorted(designs, key=lambda design: order.index(design["design"])),
    }


def _read_on_each(
    cfg: DictConfig, task: PluginPart[Task], robots: Mapping[str, PluginPart[Robot]]
) -> dict[str, list[Candidate]]:
    """Read the designs for each robot, by its rules and with the names of mounts that ``cfg.robot`` has.

    On a robot that can't even start the task, each design has that as its problem.

    Raises:
        UserError: no robot can start it, or the designs can't be read; one line.
    """
    aliases = task_part(cfg).create().robot.aliases
    read: dict[str, list[Candidate]] = {}
    problems: dict[str, str] = {}
    for name, robot in robots.items():
        arm = robot.create()
        if not {*aliases} <= {*arm.aliases}:
            arm = replace(arm, aliases=(*arm.aliases, *aliases))

        try:
            stage = task.create(robot=arm)
            arm_of(arm).home_for(stage.home)  # an arm that can't start is reported once
            chosen = chosen_evaluations(cfg, tool_part(cfg).create(robot=arm), stage)
        except UserError as error:
            problems[name] = str(error)
        else:
            read[name] = [found.candidate.of(stage.name) for found in chosen]

    if not read:
        raise UserError("; ".join(dict.fromkeys(problems.values())))

    some = next(iter(read.values()))
    for name, problem in problems.items():
        read[name] = [replace(candidate, problem=problem) for candidate in some]

    return read


def _reject(candidate: Candidate, conditions: Sequence[Condition]) -> tuple[Trial, ...]:
    """Make the trials of a candidate that breaks a rule in any condition."""
    reason = candidate.problem or ""
    return tuple(
        Trial(condition.where, candidate.id, "rejected", reason=reason)
        for condition in conditions
    )


def record(
    candidate: Candidate, robot: str, tried: Sequence[Trial], fitness: Fitness
) -> dict[str, Any]:
    """Make the entry of one design on one robot in the output file."""
    nominal = {
        trial.engine: trial.reward for trial in tried if trial.where.change is None
    }
    changed = tuple(trial for trial in tried if trial.where.change is not None)
    robust = Evaluation(candidate, changed, fitness.score(candidate, changed))
    missed_m = changed[robust.score.shown].figure("ik_error_m")
    return {
        "design": candidate.id,
        "robot": robot,
        "name": candidate.design_name,
        "robust": robust.reward,
        "status": robust.status,
        "reason": robust.reason,
        "ik_error_m": None if math.isnan(missed_m) else missed_m,
        "engines": {
            engine: {"nominal": nominal[engine], **summarise_rewards(rewards)}
            for engine, rewards in robust.by_engine.items()
        },
        "warnings": list(robust.warnings),
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
