"""``python -m core.transfer designs=FILE|RUN_DIR task=NAME robots=[NAME,...] sims=[NAME,...] seeds=[N,...]``: try
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

from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from rich.console import Console
from rich.progress import track

from core.cli import arguments, command, print_table, say, write_bytes
from core.config.compose import check_seed, first_line, load, node, part, robot_part, task_part, tool_part
from core.config.settings import PerturbationRange
from core.design import TIE, Candidate, Evaluation, best_first
from core.designs.reading import load_designs, read_designs
from core.designs.rules import SpawnRules
from core.errors import UsageError, UserError
from core.interfaces import RolloutSettings, ToolRepresentation
from core.plugins import TaskPart
from core.search.evolution import evaluate_all
from core.simulation.robustness import arms, check_draws, engines, perturbed, worst
from core.simulation.rollout import Evaluator
from core.store.reader import stored_config, stored_evaluations
from core.text import clean

USAGE = (
    "usage: python -m core.transfer designs=FILE|RUN_DIR [task=NAME] [robots=[NAME,...]] [sims=[NAME,...]] "
    "[seeds=[N,...]] [perturbation.KEY=X] [top=N] [output=FILE.json] [KEY=VALUE ...]"
)


World = tuple[str, str, int | None]
"""A robot, an engine, and the seed of a perturbation (None: the scene as it is)."""


@dataclass(frozen=True, eq=False)
class Trial(Candidate):
    """A candidate that is tried in one world."""

    world: World = ("", "", None)
    evaluator: Evaluator = field(kw_only=True)

    @cached_property
    def content(self) -> str:
        """A name of the trial: the design and the world."""
        return f"{self.id} {self.world}"


def attempt(trials: Sequence[Candidate]) -> list[Evaluation]:
    """Try each trial with its own evaluator; neighbours that share one go together."""
    groups = itertools.groupby(trials, key=operator.attrgetter("evaluator"))
    return [evaluation for evaluator, group in groups for evaluation in evaluator(list(group))]


def transfer(cfg: DictConfig) -> dict[str, Any]:
    """Try every design on every robot in every engine, in the scene as it is and with each perturbation.

    Returns:
        The content of the output file.

    Raises:
        UserError: the designs can't be used on any robot, or a part or setting is wrong.
    """
    check_seed(cfg.seed)
    check_draws(cfg.seeds)
    task = task_part(cfg)
    robots = arms(OmegaConf.to_container(cfg.robots), robot_part(cfg.robot))  # type: ignore[arg-type]
    tasks = {robot: replace(task, robot=part) for robot, part in robots.items()}
    candidates = on_each(cfg, tasks)
    sims = engines(OmegaConf.to_container(cfg.sims))  # type: ignore[arg-type]
    settings, ranges = node(cfg.rollout, RolloutSettings), node(cfg.perturbation, PerturbationRange)
    evaluators: dict[World, Evaluator] = {}
    for (robot, of), (engine, sim) in itertools.product(tasks.items(), sims.items()):
        evaluators[robot, engine, None] = nominal = Evaluator(of, sim, cfg.seed, settings)
        evaluators |= {(robot, engine, change): perturbed(nominal, ranges, change) for change in cfg.seeds}
    tried: dict[tuple[str, World], Evaluation] = {}
    with part("executor", cfg.executor).create() as executor:
        for evaluation in track(
            evaluate_all(trials(candidates, evaluators), attempt, executor),
            "trials",
            total=sum(len(candidates[robot]) for robot, *_ in evaluators),
            console=(console := Console(stderr=True)),
            transient=True,
            disable=not console.is_terminal,
        ):
            trial = evaluation.candidate
            assert isinstance(trial, Trial)
            tried[trial.id, trial.world] = evaluation
    return {
        "task": task.name,
        "seed": cfg.seed,
        "seeds": list(cfg.seeds),
        "perturbation": asdict(ranges),
        "robots": {robot: {"name": of.name, **dict(of.settings), "base": of.base} for robot, of in robots.items()},
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


def trials(candidates: Mapping[str, Sequence[Candidate]], evaluators: Mapping[World, Evaluator]) -> Iterator[Trial]:
    """Yield each robot's candidates with each of its evaluators; candidates that share a tool stay together."""
    for robot, of in candidates.items():
        for _, group in itertools.groupby(of, key=lambda candidate: id(candidate.tool)):
            alike = list(group)
            for world, evaluator in evaluators.items():
                for candidate in alike if world[0] == robot else ():
                    named = {field.name: getattr(candidate, field.name) for field in fields(Candidate)}
                    yield Trial(**named, world=world, evaluator=evaluator)


def on_each(cfg: DictConfig, tasks: Mapping[str, TaskPart]) -> dict[str, list[Candidate]]:
    """Read the designs for each robot, by its rules and with the names of mounts that ``cfg.robot`` has.

    On a robot that can't even start the task, each design has that as its problem.

    Raises:
        UserError: no robot can start it, or the designs can't be read; one line.
    """
    representation = tool_part(cfg).create()
    aliases = task_part(cfg).create().robot.aliases
    found: dict[str, list[Candidate]] = {}
    problems: dict[str, str] = {}
    for robot, task_of in tasks.items():
        task = task_of.create()
        if not {*aliases} <= {*task.robot.aliases}:
            task.robot = replace(task.robot, aliases=(*task.robot.aliases, *aliases))
        try:
            found[robot] = designs(cfg, representation, SpawnRules(task, cfg.seed))
        except UserError as error:
            problems[robot] = str(error)
    if not found:
        raise UserError("; ".join(dict.fromkeys(problems.values())))
    some = next(iter(found.values()))
    return {
        robot: found[robot] if robot in found else [replace(one, problem=problems[robot]) for one in some]
        for robot in tasks
    }


def designs(cfg: DictConfig, representation: ToolRepresentation, spawn: SpawnRules) -> list[Candidate]:
    """Read all designs of the file, or the best of the run, that ``cfg.designs`` names."""
    path = Path(cfg.designs)
    if not path.is_dir():
        return read_designs(load_designs(path), representation, spawn)
    if cfg.top < 1:
        raise UsageError(f"top must be at least 1, got {cfg.top}")
    tie = stored_config(path).get("evolution", {}).get("tie", TIE)  # as the run chose its best
    return [e.candidate for e in best_first(stored_evaluations(path, representation, spawn), tie)[: cfg.top]]


def as_the_run(words: Sequence[str], config: str = "transfer", usage: str = USAGE) -> DictConfig:
    """The primary ``config`` with the command line's words. Where designs are a run's, its task, robot, tool, material,
    layout and rollout settings count too, unless the command line sets them.
    """
    cfg = load(config, words)
    if OmegaConf.is_missing(cfg, "designs"):
        raise UsageError(f"no designs given; {usage}")
    if not Path(cfg.designs).is_dir():
        return cfg
    run = stored_config(Path(cfg.designs))
    named = {word.lstrip("+~").partition("=")[0] for word in words}
    try:
        below = [f"{group}.{name}" for group in ("rollout", "material") for name in run.get(group, {})]
        for key in ("seed", *below):
            if not {key, key.partition(".")[0]} & named:
                OmegaConf.update(cfg, key, OmegaConf.select(OmegaConf.create(run), key))
        kinds = {"task", "tool", *(["robot"] if run.get("robot") else [])}  # runs of earlier versions had no robot
        for kind in kinds - {key.partition(".")[0] for key in named}:
            OmegaConf.update(cfg, kind, run[kind], merge=False, force_add=True)
    except (KeyError, OmegaConfBaseException) as error:
        raise UserError(f"{cfg.designs}: its configuration can't be used here: {first_line(error)}") from error
    return cfg


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
            engine: {"nominal": nominal[engine].reward, **figures}
            for engine, figures in robust.details["engines"].items()
        },
        "warnings": list(robust.warnings),
    }


def main() -> None:
    cfg = as_the_run(arguments(USAGE))
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
        for engine, found in design["engines"].items():
            perturbed = f"{found['mean']:.3f} ± {found['std']:.3f}"
            rows.append((design["design"], design["robot"], engine, f"{found['nominal']:.3f}", perturbed, *once))
            once = "", ""
    print_table(("design", "robot", "engine", *numbers), rows, numbers)
    count = len(result["seeds"])
    lines = [
        f"perturbed: mean ± standard deviation over {count} small perturbation{'s' if count > 1 else ''} of the scene",
        "robust: the lowest of the engines' means; IK error: how far the arm misses the plan at most",
    ]
    for design in result["designs"]:
        remarks = [design["reason"]] if design["reason"] else design["warnings"]
        of = f"{design['design']}, {design['robot']}"
        lines += [f"{of}: {clean(remark, 2000)}" for remark in remarks]
    say(*lines)


if __name__ == "__main__":
    command(main)
