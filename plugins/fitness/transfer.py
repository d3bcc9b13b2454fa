"""``vlmgineer transfer designs=FILE|RUN_DIR task=NAME robots=[NAME,...] sims=[NAME,...] seeds=[N,...]``: try
designs on several arms and in several engines, in the scene as it is and with small perturbations.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from omegaconf import MISSING, DictConfig, OmegaConf
from rich.console import Console
from rich.progress import Progress

from core.config.compose import (
    check_seed,
    engines,
    listed,
    node,
    part,
    robot_part,
    task_part,
    task_parts,
    tool_part,
)
from core.design import Candidate
from core.designs.feedback import statistics
from core.errors import UserError
from core.interfaces import RolloutSettings, Task
from core.plugins import EXECUTOR, PluginPart, RobotPart
from core.robot.kinematics import arm_of
from core.search.trials import Trials
from core.store.reader import chosen_evaluations, config_for
from core.support.cli import arguments, print_table, say, write_bytes
from core.support.text import clean
from core.trial import Condition, Evaluation, Trial
from core.values.materials import Material
from plugins.fitness.robustness import Perturbation, PerturbationRange, check_draws
from plugins.fitness.several import score_by_worst_engine

USAGE = (
    "usage: vlmgineer transfer designs=FILE|RUN_DIR [task=NAME] [robots=[NAME,...]] [sims=[NAME,...]] "
    "[seeds=[N,...]] [perturbation.KEY=X] [top=N] [output=FILE.json] [KEY=VALUE ...]"
)


@dataclass
class TransferConfig:
    """Settings of ``vlmgineer transfer``.

    ``designs``: a designs file, or a run's folder, of which the ``top`` best are taken. ``robots``: entries as those of
    ``sims``; empty: ``robot`` alone. ``seed`` is the layout's, and ``seeds`` are those of the perturbations.
    ``output``: a JSON file to write as well.
    """

    task: dict[str, Any] = MISSING
    robot: dict[str, Any] = field(default_factory=dict)
    tool: dict[str, Any] = MISSING
    material: Material = field(default_factory=Material)
    executor: dict[str, Any] = MISSING
    rollout: RolloutSettings = field(default_factory=RolloutSettings)
    robots: list[Any] = field(default_factory=list)
    sims: list[Any] = MISSING
    seed: int = 0
    seeds: list[int] = MISSING
    perturbation: PerturbationRange = field(default_factory=PerturbationRange)
    designs: str = MISSING
    top: int = 1
    output: str | None = None


def transfer(cfg: DictConfig) -> dict[str, Any]:
    """Try every design in every task on every robot in every engine, in the scene as it is and with each perturbation.

    Returns:
        The content of the output file.

    Raises:
        UserError: the designs can't be used on any robot, or a part or setting is wrong.
    """
    check_seed(cfg.seed)
    check_draws(cfg.seeds)
    each = {task.create().name: _transfer(cfg, task) for task in task_parts(cfg)}
    designs = [
        {"task": task, **design}
        for task, found in each.items()
        for design in found["designs"]
    ]
    return (
        {"task": task_part(cfg).name} | next(iter(each.values())) | {"designs": designs}
    )


def _transfer(cfg: DictConfig, task: PluginPart[Task]) -> dict[str, Any]:
    """Try every design in one task (see `transfer`)."""
    robots = _arms(OmegaConf.to_container(cfg.robots), robot_part(cfg.robot))  # type: ignore[arg-type]
    tasks = {robot: replace(task, robot=part) for robot, part in robots.items()}
    candidates = on_each(cfg, tasks)
    sims = engines(OmegaConf.to_container(cfg.sims))  # type: ignore[arg-type]
    ranges = node(cfg.perturbation, PerturbationRange)
    changes = [Perturbation(ranges, seed) for seed in cfg.seeds]
    settings = node(cfg.rollout, RolloutSettings)

    designs: list[dict[str, Any]] = []
    with part(EXECUTOR, cfg.executor).create() as executor, _progress() as progress:
        for robot, own in tasks.items():
            conditions = [
                Condition(own, sim, cfg.seed, settings, change, engine)
                for engine, sim in sims.items()
                for change in (None, *changes)
            ]
            trials = Trials(
                executor
            )  # a robot's own: conditions do not say which it is
            bar = progress.add_task(f"trials on {robot}", total=len(candidates[robot]))
            for candidate, tried in trials.try_in(conditions, candidates[robot]):
                progress.advance(bar)
                designs.append(
                    record(candidate, robot, tried or _rejected(candidate, conditions))
                )
    order = {
        candidate.id: number
        for number, candidate in enumerate(next(iter(candidates.values())))
    }
    designs.sort(key=lambda design: order[design["design"]])
    return {
        "seed": cfg.seed,
        "seeds": list(cfg.seeds),
        "perturbation": asdict(ranges),
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


def _rejected(
    candidate: Candidate, conditions: Sequence[Condition]
) -> tuple[Trial, ...]:
    """Make the trials of a candidate that breaks a rule in any condition."""
    reason = candidate.problem or ""
    return tuple(
        Trial(condition.where, candidate.id, "rejected", reason=reason)
        for condition in conditions
    )


def _progress() -> Progress:
    console = Console(stderr=True)
    return Progress(console=console, transient=True, disable=not console.is_terminal)


def _arms(
    robots: Sequence[str | Mapping[str, Any]], chosen: RobotPart
) -> dict[str, RobotPart]:
    """Make the robots, by the names under which they are shown: entries as those of `engines`; none: ``chosen`` alone.

    Raises:
        UserError: a robot does not exist or can't be made, or is repeated.
    """
    nodes = listed("robot", "robot", robots or [chosen.name], chosen)
    found = {shown: robot_part(node) for shown, node in nodes.items()}
    for robot in found.values():
        robot.create()  # so that a fault is reported once
    return found


def on_each(
    cfg: DictConfig, tasks: Mapping[str, PluginPart[Task]]
) -> dict[str, list[Candidate]]:
    """Read the designs for each robot, by its rules and with the names of mounts that ``cfg.robot`` has.

    On a robot that can't even start the task, each design has that as its problem.

    Raises:
        UserError: no robot can start it, or the designs can't be read; one line.
    """
    aliases = task_part(cfg).create().robot.aliases
    read: dict[str, list[Candidate]] = {}
    problems: dict[str, str] = {}
    for robot, own in tasks.items():
        arm = own.create().robot
        if not {*aliases} <= {*arm.aliases}:
            arm = replace(arm, aliases=(*arm.aliases, *aliases))
        try:
            arm_of(arm).home_for(
                own.create(robot=arm).home
            )  # an arm that can't start is reported once
            chosen = chosen_evaluations(
                cfg, tool_part(cfg).create(robot=arm), own.create(robot=arm)
            )
            read[robot] = [
                evaluation.candidate.of(own.create().name) for evaluation in chosen
            ]
        except UserError as error:
            problems[robot] = str(error)
    if not read:
        raise UserError("; ".join(dict.fromkeys(problems.values())))
    some = next(iter(read.values()))
    return {
        robot: read[robot]
        if robot in read
        else [replace(candidate, problem=problems[robot]) for candidate in some]
        for robot in tasks
    }


def record(candidate: Candidate, robot: str, tried: Sequence[Trial]) -> dict[str, Any]:
    """The entry of one design on one robot in the output file."""
    nominal = {trial.engine: trial.reward for trial in tried if trial.change is None}
    changed = tuple(trial for trial in tried if trial.change is not None)
    robust = Evaluation(candidate, changed, score_by_worst_engine(changed))
    shown = changed[robust.score.shown]
    return {
        "design": candidate.id,
        "robot": robot,
        "name": candidate.strategy_name,
        "robust": robust.reward,
        "status": robust.status,
        "reason": robust.reason,
        "ik_error_m": None if math.isnan(shown.ik_error_m) else shown.ik_error_m,
        "engines": {
            engine: {"nominal": nominal[engine], **statistics(rewards)}
            for engine, rewards in robust.by_engine.items()
        },
        "warnings": list(robust.warnings),
    }


def configured(words: Sequence[str]) -> DictConfig:
    """Compose the configuration (`config_for`)."""
    return config_for(words, "transfer", TransferConfig, USAGE)


def main(words: list[str]) -> None:
    cfg = configured(arguments(USAGE, words))
    result = transfer(cfg)
    if cfg.output is not None:
        write_bytes(Path(cfg.output), (json.dumps(result, indent=2) + "\n").encode())
    show(result)


def show(result: Mapping[str, Any]) -> None:
    """Print a table of each design on each robot in each engine, as it is and perturbed, and the robust score."""
    numbers = ("nominal", "perturbed", "robust", "IK error (mm)")
    rows = []
    for design in result["designs"]:
        missed = design["ik_error_m"]
        once = (
            f"{design['robust']:.3f}",
            "–" if missed is None else f"{1000 * missed:.0f}",
        )
        names = design["design"], design["task"], design["robot"]
        for engine, figures in design["engines"].items():
            perturbed = f"{figures['mean']:.3f} ± {figures['std']:.3f}"
            rows.append((*names, engine, f"{figures['nominal']:.3f}", perturbed, *once))
            once = "", ""
    print_table(("design", "task", "robot", "engine", *numbers), rows, numbers)
    count = len(result["seeds"])
    lines = [
        f"perturbed: mean ± standard deviation over {count} small perturbation{'s' if count > 1 else ''} of the scene",
        "robust: the lowest of the engines' means; IK error: how far the arm misses the plan at most",
    ]
    for design in result["designs"]:
        remarks = [design["reason"]] if design["reason"] else design["warnings"]
        lines += [
            f"{design['design']}, {design['task']}, {design['robot']}: {clean(remark, 2000)}"
            for remark in remarks
        ]
    say(*lines)
