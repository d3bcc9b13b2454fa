"""``python -m core.transfer designs=FILE|RUN_DIR task=NAME sims=[NAME,...] seeds=[N,...]``: try designs in several
engines, in the scene as it is and with small perturbations.
"""

from __future__ import annotations

import itertools
import json
import operator
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from rich.console import Console
from rich.progress import track

from core.cli import arguments, command, print_table, say, write_bytes
from core.config.compose import check_seed, first_line, load, node, part, task_part
from core.config.settings import PerturbationRange
from core.design import TIE, Candidate, Evaluation, best_first
from core.designs.reading import load_designs, read_designs
from core.designs.rules import SpawnRules
from core.errors import UsageError, UserError
from core.interfaces import RolloutSettings, ToolRepresentation
from core.search.evolution import evaluate_all
from core.simulation.robustness import check_draws, engines, perturbed, worst
from core.simulation.rollout import Evaluator
from core.store.reader import stored_config, stored_evaluations
from core.text import clean

USAGE = (
    "usage: python -m core.transfer designs=FILE|RUN_DIR [task=NAME] [sims=[NAME,...]] [seeds=[N,...]] "
    "[perturbation.KEY=X] [top=N] [output=FILE.json] [KEY=VALUE ...]"
)


@dataclass(frozen=True, eq=False)
class Trial(Candidate):
    """A candidate that is tried in one engine; ``change`` is the seed of a perturbation, None: the scene as it is."""

    engine: str = ""
    change: int | None = None
    evaluator: Evaluator = field(kw_only=True)

    @cached_property
    def content(self) -> str:
        """A name of the trial: the design, the engine and the perturbation."""
        return f"{self.id} {self.engine} {self.change}"


def attempt(trials: Sequence[Candidate]) -> list[Evaluation]:
    """Try each trial with its own evaluator; neighbours that share one go together."""
    groups = itertools.groupby(trials, key=operator.attrgetter("evaluator"))
    return [evaluation for evaluator, group in groups for evaluation in evaluator(list(group))]


def transfer(cfg: DictConfig) -> dict[str, Any]:
    """Try every design in every engine, in the scene as it is and with each perturbation.

    Returns:
        The content of the output file.

    Raises:
        UserError: the designs can't be used, or a part or setting is wrong.
    """
    check_seed(cfg.seed)
    check_draws(cfg.seeds)
    task = task_part(cfg)
    candidates = designs(cfg, part("tool", cfg.tool).create(), SpawnRules(task.create(), cfg.seed))
    sims = engines(OmegaConf.to_container(cfg.sims))  # type: ignore[arg-type]
    settings, ranges = node(cfg.rollout, RolloutSettings), node(cfg.perturbation, PerturbationRange)
    evaluators: dict[tuple[str, int | None], Evaluator] = {}
    for engine, sim in sims.items():
        evaluators[engine, None] = nominal = Evaluator(task, sim, cfg.seed, settings)
        evaluators |= {(engine, change): perturbed(nominal, ranges, change) for change in cfg.seeds}
    tried: dict[tuple[str, str, int | None], Evaluation] = {}
    with part("executor", cfg.executor).create() as executor:
        for evaluation in track(
            evaluate_all(trials(candidates, evaluators), attempt, executor),
            "trials",
            total=len(candidates) * len(evaluators),
            console=(console := Console(stderr=True)),
            transient=True,
            disable=not console.is_terminal,
        ):
            trial = evaluation.candidate
            assert isinstance(trial, Trial)
            tried[trial.id, trial.engine, trial.change] = evaluation
    return {
        "task": task.name,
        "seed": cfg.seed,
        "seeds": list(cfg.seeds),
        "perturbation": asdict(ranges),
        "engines": {engine: {"name": sim.name, **dict(sim.settings)} for engine, sim in sims.items()},
        "designs": [
            record(
                candidate,
                {engine: tried[candidate.id, engine, None] for engine in sims},
                {engine: [tried[candidate.id, engine, change] for change in cfg.seeds] for engine in sims},
            )
            for candidate in candidates
        ],
    }


def trials(candidates: Sequence[Candidate], evaluators: Mapping[tuple[str, int | None], Evaluator]) -> Iterator[Trial]:
    """Yield every candidate with every evaluator; candidates that share a tool stay together."""
    for _, group in itertools.groupby(candidates, key=lambda candidate: id(candidate.tool)):
        alike = list(group)
        for (engine, change), evaluator in evaluators.items():
            for candidate in alike:
                named = {field.name: getattr(candidate, field.name) for field in fields(Candidate)}
                yield Trial(**named, engine=engine, change=change, evaluator=evaluator)


def designs(cfg: DictConfig, representation: ToolRepresentation, spawn: SpawnRules) -> list[Candidate]:
    """Read all designs of the file, or the best of the run, that ``cfg.designs`` names."""
    path = Path(cfg.designs)
    if not path.is_dir():
        return read_designs(load_designs(path), representation, spawn)
    if cfg.top < 1:
        raise UsageError(f"top must be at least 1, got {cfg.top}")
    tie = stored_config(path).get("evolution", {}).get("tie", TIE)  # as the run chose its best
    return [e.candidate for e in best_first(stored_evaluations(path, representation, spawn), tie)[: cfg.top]]


def as_the_run(words: Sequence[str]) -> DictConfig:
    """The configuration of the command line. Where designs are a run's, the task, the tool, the layout and the rollout
    settings are the run's too, unless the command line sets them.
    """
    cfg = load("transfer", words)
    if OmegaConf.is_missing(cfg, "designs"):
        raise UsageError(f"no designs given; {USAGE}")
    if not Path(cfg.designs).is_dir():
        return cfg
    run = stored_config(Path(cfg.designs))
    named = {word.lstrip("+~").partition("=")[0] for word in words}
    try:
        for key in ("seed", *(f"rollout.{name}" for name in run.get("rollout", {}))):
            if key not in named:
                OmegaConf.update(cfg, key, OmegaConf.select(OmegaConf.create(run), key))
        for kind in {"task", "tool"} - {key.partition(".")[0] for key in named}:
            OmegaConf.update(cfg, kind, run[kind], merge=False, force_add=True)
    except (KeyError, OmegaConfBaseException) as error:
        raise UserError(f"{cfg.designs}: its configuration can't be used here: {first_line(error)}") from error
    return cfg


def record(
    candidate: Candidate, nominal: Mapping[str, Evaluation], changed: Mapping[str, Sequence[Evaluation]]
) -> dict[str, Any]:
    """The entry of one design in the output file."""
    robust = worst(candidate, changed)
    return {
        "design": candidate.id,
        "name": candidate.strategy_name,
        "robust": robust.reward,
        "status": robust.status,
        "reason": robust.reason,
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
    """Print a table of each design in each engine, as it is and perturbed, and the robust score."""
    numbers = ("nominal", "perturbed", "robust")
    rows = []
    for design in result["designs"]:
        robust = f"{design['robust']:.3f}"
        for engine, found in design["engines"].items():
            perturbed = f"{found['mean']:.3f} ± {found['std']:.3f}"
            rows.append((design["design"], engine, f"{found['nominal']:.3f}", perturbed, robust))
            robust = ""  # once per design
    print_table(("design", "engine", *numbers), rows, numbers)
    count = len(result["seeds"])
    lines = [
        f"perturbed: mean ± standard deviation over {count} small perturbation{'s' if count > 1 else ''} of the scene",
        "robust: the lowest of the engines' means",
    ]
    for design in result["designs"]:
        remarks = [design["reason"]] if design["reason"] else design["warnings"]
        lines += [f"{design['design']}: {clean(remark, 2000)}" for remark in remarks]
    say(*lines)


if __name__ == "__main__":
    command(main)
