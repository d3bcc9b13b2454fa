"""``python -m core.transfer designs=FILE|RUN_DIR task=NAME sims=[NAME,...] seeds=[N,...]``: designs in several engines,
with the scene as it is and with small changes.
"""

from __future__ import annotations

import itertools
import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, OmegaConf
from rich.console import Console
from rich.markup import escape
from rich.progress import track
from rich.table import Table

from core.cli import arguments, command, write_bytes
from core.config.compose import check_seed, load, node, part
from core.config.settings import PerturbationRange
from core.design import Candidate, Evaluation, best_first
from core.designs.reading import load_designs, read_designs
from core.designs.rules import SpawnRules
from core.errors import UsageError
from core.interfaces import RolloutSettings, ToolRepresentation
from core.search.evolution import evaluate_all
from core.simulation.robustness import check_draws, engines, perturbed, worst
from core.simulation.rollout import Evaluator
from core.store.reader import stored_config, stored_evaluations

USAGE = (
    "usage: python -m core.transfer designs=FILE|RUN_DIR [task=NAME] [sims=[NAME,...]] [seeds=[N,...]] "
    "[perturbation.KEY=X] [top=N] [output=FILE.json] [KEY=VALUE ...]"
)


@dataclass(frozen=True, eq=False)
class Trial(Candidate):
    """A candidate that is tried in one engine; ``change`` is the seed of a change of the scene, None: as it is."""

    engine: str = ""
    change: int | None = None
    bench: Evaluator = field(kw_only=True)

    @cached_property
    def content(self) -> str:
        """Names what is tried, as of every candidate; here that is a design on a bench."""
        return f"{self.id} {self.engine} {self.change}"


def attempt(trials: Sequence[Candidate]) -> list[Evaluation]:
    """Each trial on its own bench; those in a row that share one together."""
    evaluations: list[Evaluation] = []
    for bench, group in itertools.groupby(trials, key=_bench):
        evaluations += bench(list(group))
    return evaluations


def _bench(trial: Candidate) -> Evaluator:
    assert isinstance(trial, Trial)
    return trial.bench


def transfer(cfg: DictConfig) -> dict[str, Any]:
    """Try every design in every engine, with the scene as it is and with each change; what comes out is the content of
    the output file.

    Raises:
        UserError: the designs can't be used, or a part or setting can't be had.
    """
    check_seed(cfg.seed)
    check_draws(cfg.seeds)
    task = part("task", cfg.task)
    candidates = designs(cfg, part("tool", cfg.tool).create(), SpawnRules(task.create(), cfg.seed))
    sims = engines(OmegaConf.to_container(cfg.sims))  # type: ignore[arg-type]
    settings, ranges = node(cfg.rollout, RolloutSettings), node(cfg.perturbation, PerturbationRange)
    benches: dict[tuple[str, int | None], Evaluator] = {}
    for engine, sim in sims.items():
        bench = Evaluator(task, sim, cfg.seed, settings)
        benches[engine, None] = bench
        benches |= {(engine, change): perturbed(bench, ranges, change) for change in cfg.seeds}
    tried: dict[tuple[str, str, int | None], Evaluation] = {}
    with part("executor", cfg.executor).create() as executor:
        for evaluation in track(
            evaluate_all(spread_out(candidates, benches), attempt, executor),
            "trials",
            total=len(candidates) * len(benches),
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


def spread_out(candidates: Sequence[Candidate], benches: Mapping[tuple[str, int | None], Evaluator]) -> Iterator[Trial]:
    """Every candidate on every bench; candidates that share a tool stay together."""
    for _, group in itertools.groupby(candidates, key=lambda candidate: id(candidate.tool)):
        alike = list(group)
        for (engine, change), bench in benches.items():
            for candidate in alike:
                named = {field.name: getattr(candidate, field.name) for field in fields(Candidate)}
                yield Trial(**named, engine=engine, change=change, bench=bench)


def designs(cfg: DictConfig, representation: ToolRepresentation, spawn: SpawnRules) -> list[Candidate]:
    """All in the file, or the best of the run, that ``cfg.designs`` names."""
    path = Path(cfg.designs)
    if not path.is_dir():
        return read_designs(load_designs(path), representation, spawn)
    if cfg.top < 1:
        raise UsageError(f"top must be at least 1, got {cfg.top}")
    return [e.candidate for e in best_first(stored_evaluations(path, representation, spawn))[: cfg.top]]


def as_the_run(words: Sequence[str]) -> DictConfig:
    """The configuration that the command line asks for. Where designs are a run's, so are the task, the tool, the
    layout and how plans are executed, as far as the command line doesn't say otherwise.
    """
    cfg = load("transfer", words)
    if OmegaConf.is_missing(cfg, "designs"):
        raise UsageError(f"no designs given; {USAGE}")
    if not Path(cfg.designs).is_dir():
        return cfg
    run = stored_config(Path(cfg.designs))
    cfg = load("transfer", [f"seed={run['seed']}", *(f"rollout.{k}={v}" for k, v in run["rollout"].items()), *words])
    named = {word.lstrip("+~").partition("=")[0].partition(".")[0] for word in words}
    for kind in {"task", "tool"} - named:
        OmegaConf.update(cfg, kind, run[kind], merge=False, force_add=True)
    return cfg


def record(
    candidate: Candidate, nominal: Mapping[str, Evaluation], changed: Mapping[str, Sequence[Evaluation]]
) -> dict[str, Any]:
    """One design's entry in the output file."""
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
    """Print a table: each design in each engine, nominal and changed, and the robust score."""
    table = Table(box=None, header_style="bold")
    table.add_column("design", no_wrap=True)
    for engine in result["engines"]:
        name = escape(engine.replace(" ", "\n"))
        table.add_column(f"{name}\nnominal", justify="right", no_wrap=True)
        table.add_column(f"{name}\nchanged", justify="right", no_wrap=True)
    table.add_column("robust", justify="right", no_wrap=True)
    for design in result["designs"]:
        row = [design["design"]]
        for figures in design["engines"].values():
            row += [f"{figures['nominal']:.3f}", f"{figures['mean']:.3f} ± {figures['std']:.3f}"]
        table.add_row(*row, f"{design['robust']:.3f}")
    console = Console(file=sys.stdout, highlight=False)
    console.print(table)
    changes = len(result["seeds"])
    console.print(f"changed: mean ± standard deviation over {changes} small changes of the scene")
    console.print("robust: the lowest of the engines' means")
    for design in result["designs"]:
        for remark in [design["reason"]] if design["reason"] else design["warnings"]:
            console.print(f"{design['design']}: {remark}", markup=False)


if __name__ == "__main__":
    command(main)
