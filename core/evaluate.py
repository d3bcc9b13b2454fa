"""``python -m core.evaluate task=NAME designs=FILE [output=FILE.json]``: rewards of the designs in a file, without a
model.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, OmegaConf

from core.config.compose import check_seed, load, node, part, task_part, tool_part
from core.design import Candidate
from core.designs.feedback import combined_figures, describe
from core.designs.reading import load_designs, read_designs
from core.errors import UsageError
from core.interfaces import Fitness, RolloutSettings, Task
from core.plugins import EXECUTOR, SIMULATOR
from core.plugins.blame import refuse_exit
from core.search.builder import builder_for, check_starts
from core.search.trials import Trials
from core.simulation.play import find_problems
from core.support.cli import arguments, command, print_table, say, write_bytes
from core.support.text import by_reason, clean
from core.trial import Evaluation

STOPPED_RAD = 0.02  # lag of a joint above which something held it back; reference solutions stay below 0.012
USAGE = "usage: python -m core.evaluate task=NAME designs=FILE [sim=NAME] [seed=N] [output=FILE.json] [KEY=VALUE ...]"


@refuse_exit()
def evaluate(cfg: DictConfig) -> list[Evaluation]:
    """Try every action plan in ``cfg.designs``, in the file's order.

    Raises:
        UserError: the file can't be used, or a part or setting is wrong.
    """
    check_seed(cfg.seed)
    document = load_designs(Path(cfg.designs))
    part(
        SIMULATOR, cfg.sim
    ).create()  # a wrong setting is reported here, once, rather than by each worker
    task = task_part(cfg).create()
    check_starts(task)
    fitness = _build_fitness(cfg)
    evaluations = try_all(
        cfg, read_designs(document, tool_part(cfg).create(), task), fitness
    )
    return sorted(evaluations, key=lambda e: e.candidate.key)


def try_all(
    cfg: DictConfig, candidates: Iterable[Candidate], fitness: Fitness
) -> list[Evaluation]:
    """Try candidates with the configured executor, judged by ``fitness``."""
    with part(EXECUTOR, cfg.executor).create() as executor:
        return list(Trials(executor).evaluate(candidates, fitness))


def _build_fitness(cfg: DictConfig) -> Fitness:
    builder = builder_for(task_part(cfg))
    return builder.build_fitness(cfg, node(cfg.rollout, RolloutSettings))


def check_all(cfg: DictConfig) -> Iterator[str]:
    """Yield what is wrong with the plans in ``cfg.designs`` before they are played, a line for each; see `evaluate`."""
    fitness = _build_fitness(cfg)
    conditions = fitness.conditions()
    document = load_designs(Path(cfg.designs))
    for candidate in read_designs(
        document, tool_part(cfg).create(), task_part(cfg).create()
    ):
        found: list[tuple[str, str]] = []
        for condition in conditions:
            place = f"layout {condition.layout}"
            found += [
                (place, problem) for problem in find_problems(condition, candidate)
            ]
        lines = (
            by_reason(found)
            if len(conditions) > 1
            else dict.fromkeys(problem for _, problem in found)
        )
        said = clean("; ".join(lines), 2000) or "nothing found"
        yield f"strategy {candidate.strategy} plan {candidate.action}: {said}"


def record(evaluation: Evaluation, task: Task) -> dict[str, Any]:
    """One entry of the output file."""
    figures = {
        name: getattr(evaluation, name)
        for name in ("reward", "distance_m", "status", "reason")
    }
    shown = evaluation.shown
    for name in ("ik_error_m", "ik_error_rad", "tracking_error_rad"):
        figures[name] = math.nan if shown is None else getattr(shown, name)
    warnings = list(evaluation.warnings)
    lag_rad = figures["tracking_error_rad"]
    if lag_rad > STOPPED_RAD:
        warnings.append(
            f"stopped or held back on its way: a joint of the arm fell {lag_rad:.2f} rad behind its target"
        )
    return {
        "strategy": evaluation.candidate.strategy,
        "plan": evaluation.candidate.action,
        **{
            k: None if isinstance(v, float) and not math.isfinite(v) else v
            for k, v in figures.items()
        },  # JSON: no nan
        "warnings": warnings,
        **(
            {"observed": describe(evaluation)}
            if evaluation.observation is not None
            else {}
        ),
        **(
            {"details": combined}
            if (combined := combined_figures(evaluation, task))
            else {}
        ),
    }


def main(words: list[str]) -> None:
    cfg = load("evaluate", arguments(USAGE, words))
    if OmegaConf.is_missing(cfg, "designs"):
        raise UsageError(f"no designs file given; {USAGE}")
    if cfg.check:
        for line in check_all(cfg):
            say(line)
        return
    task = task_part(cfg).create()
    records = [record(evaluation, task) for evaluation in evaluate(cfg)]
    if cfg.output is not None:
        write_bytes(Path(cfg.output), (json.dumps(records, indent=2) + "\n").encode())
    show(records)


def show(records: list[dict[str, Any]]) -> None:
    """Print a table, and below it what is to be said of single plans."""
    numbers = ("strategy", "plan", "reward", "distance m", "IK miss mm", "lag rad")
    rows = [
        (
            *(
                str(r["strategy"]),
                str(r["plan"]),
                f"{r['reward']:.3f}",
                _number(r["distance_m"], 2),
            ),
            *(
                _number(r["ik_error_m"], 0, 1000),
                _number(r["tracking_error_rad"], 3),
                r["status"],
            ),
        )
        for r in records
    ]
    print_table((*numbers, "status"), rows, numbers)
    for r in records:
        engines = r.get("details", {}).get("engines", {})
        tried = [
            f"{engine}: {' '.join(f'{x:.2f}' for x in of['rewards'])}"
            for engine, of in engines.items()
        ]
        for remark in filter(
            None, (r["reason"], *r["warnings"], r.get("observed"), *tried)
        ):
            say(f"strategy {r['strategy']} plan {r['plan']}: {clean(remark, 2000)}")


def _number(value: float | None, digits: int, scale: float = 1) -> str:
    return "" if value is None else f"{scale * value:.{digits}f}"


if __name__ == "__main__":
    command(main)
