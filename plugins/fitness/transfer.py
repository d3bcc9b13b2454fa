"""``vlmgineer transfer designs=FILE|RUN_DIR task=NAME robots=[NAME,...] sims=[NAME,...] seeds=[N,...]``: try
designs on several arms and in several engines, in the scene as it is and with small perturbations.
"""

from __future__ import annotations

import itertools
import json
import math
import operator
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from omegaconf import MISSING, DictConfig, OmegaConf
from rich.console import Console
from rich.progress import track

from core.config.compose import check_seed, engines, listed, node, part, robot_part, task_part, task_parts, tool_part
from core.design import Candidate, Evaluation
from core.designs.feedback import statistics
from core.designs.rules import SpawnRules
from core.errors import UserError
from core.interfaces import RolloutSettings, Task
from core.plugins import EXECUTOR, PluginPart, RobotPart
from core.search.evolution import evaluate_all
from core.simulation.rollout import Evaluator
from core.store.reader import chosen_evaluations, config_for
from core.support.cli import arguments, print_table, say, write_bytes
from core.support.text import clean
from core.values.materials import Material
from plugins.fitness.robustness import PerturbationRange, check_draws, perturbed, worst

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


World = tuple[str, str, int | None]
"""A robot, an engine, and the seed of a perturbation (None: the scene as it is)."""


@dataclass(frozen=True, eq=False)
class CandidateInWorld(Candidate):
    """A candidate that is tried in one world."""

    world: World = ("", "", None)
    evaluator: Evaluator = field(kw_only=True)

    @cached_property
    def content(self) -> str:
        """A name of the trial: the design and the world."""
        return f"{self.id} {self.world}"


def attempt(candidates: Sequence[Candidate]) -> list[Evaluation]:
    """Try each candidate with its own evaluator; neighbours that share one go together."""
    groups = itertools.groupby(candidates, key=operator.attrgetter("evaluator"))
    return [evaluation for evaluator, group in groups for evaluation in evaluator(list(group))]


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
    designs = [{"task": task, **of} for task, found in each.items() for of in found["designs"]]
    return {"task": task_part(cfg).name} | next(iter(each.values())) | {"designs": designs}


def _transfer(cfg: DictConfig, task: PluginPart[Task]) -> dict[str, Any]:
    """Try every design in one task (see `transfer`)."""
    robots = _arms(OmegaConf.to_container(cfg.robots), robot_part(cfg.robot))  # type: ignore[arg-type]
    tasks = {robot: replace(task, robot=part) for robot, part in robots.items()}
    candidates = on_each(cfg, tasks)
    sims = engines(OmegaConf.to_container(cfg.sims))  # type: ignore[arg-type]
    settings, ranges = node(cfg.rollout, RolloutSettings), node(cfg.perturbation, PerturbationRange)
    evaluators: dict[World, Evaluator] = {}
    for (robot, own), (engine, sim) in itertools.product(tasks.items(), sims.items()):
        evaluators[robot, engine, None] = nominal = Evaluator(own, sim, cfg.seed, settings)
        evaluators |= {(robot, engine, change): perturbed(nominal, ranges, change) for change in cfg.seeds}
    tried: dict[tuple[str, World], Evaluation] = {}
    with part(EXECUTOR, cfg.executor).create() as executor:
        for evaluation in track(
            evaluate_all(trials(candidates, evaluators), attempt, executor),
            "trials",
            total=sum(len(candidates[robot]) for robot, *_ in evaluators),
            console=(console := Console(stderr=True)),
            transient=True,
            disable=not console.is_terminal,
        ):
            trial = evaluation.candidate
            assert isinstance(trial, CandidateInWorld)
            tried[trial.id, trial.world] = evaluation
    return {
        "seed": cfg.seed,
        "seeds": list(cfg.seeds),
        "perturbation": asdict(ranges),
        "robots": {robot: {"name": arm.name, **dict(arm.settings), "base": arm.base} for robot, arm in robots.items()},
        "engines": {engine: {"name": sim.name, **dict(sim.settings)} for engine, sim in sims.items()},
        "designs": [
            record(
                candidate,
                robot,
                {engine: tried[candidate.id, (robot, engine, None)] for engine in sims},
                {engine: [tried[candidate.id, (robot, engine, change)] for change in cfg.seeds] for engine in sims},
            )
            for alike in zip(*candidates.values(), strict=True)
            for robot, candidate in zip(candidates, alike, strict=True)
        ],
    }


def _arms(robots: Sequence[str | Mapping[str, Any]], chosen: RobotPart) -> dict[str, RobotPart]:
    """Make the robots, by the names under which they are shown: entries as those of `engines`; none: ``chosen`` alone.

    Raises:
        UserError: a robot does not exist or can't be made, or is repeated.
    """
    nodes = listed("robot", "robot", robots or [chosen.name], chosen)
    found = {shown: robot_part(node) for shown, node in nodes.items()}
    for robot in found.values():
        robot.create()  # so that a fault is reported once
    return found


def trials(
    candidates: Mapping[str, Sequence[Candidate]], evaluators: Mapping[World, Evaluator]
) -> Iterator[CandidateInWorld]:
    """Yield each robot's candidates with each of its evaluators; candidates that share a tool stay together."""
    for robot, own in candidates.items():
        worlds = [(world, evaluator) for world, evaluator in evaluators.items() if world[0] == robot]
        for _, alike in itertools.groupby(own, key=lambda candidate: id(candidate.tool)):
            for (world, evaluator), candidate in itertools.product(worlds, list(alike)):
                named = {field.name: getattr(candidate, field.name) for field in fields(Candidate)}
                yield CandidateInWorld(**named, world=world, evaluator=evaluator)


def on_each(cfg: DictConfig, tasks: Mapping[str, PluginPart[Task]]) -> dict[str, list[Candidate]]:
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
            rules = SpawnRules(own.create(robot=arm), cfg.seed)
            chosen = chosen_evaluations(cfg, tool_part(cfg).create(robot=arm), rules)
            read[robot] = [evaluation.candidate.of(own.create().name) for evaluation in chosen]
        except UserError as error:
            problems[robot] = str(error)
    if not read:
        raise UserError("; ".join(dict.fromkeys(problems.values())))
    some = next(iter(read.values()))
    return {
        robot: read[robot] if robot in read else [replace(candidate, problem=problems[robot]) for candidate in some]
        for robot in tasks
    }


def record(
    candidate: Candidate, robot: str, nominal: Mapping[str, Evaluation], changed: Mapping[str, Sequence[Evaluation]]
) -> dict[str, Any]:
    """The entry of one design on one robot in the output file."""
    robust = worst(candidate, changed)
    return {
        "design": candidate.id,
        "robot": robot,
        "name": candidate.strategy_name,
        "robust": robust.reward,
        "status": robust.status,
        "reason": robust.reason,
        "ik_error_m": None if math.isnan(robust.ik_error_m) else robust.ik_error_m,
        "engines": {
            engine: {"nominal": nominal[engine].reward, **statistics(rewards)}
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
        once = f"{design['robust']:.3f}", "–" if missed is None else f"{1000 * missed:.0f}"
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
            f"{design['design']}, {design['task']}, {design['robot']}: {clean(remark, 2000)}" for remark in remarks
        ]
    say(*lines)
