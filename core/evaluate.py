"""``python -m core.evaluate task=NAME designs=FILE [output=FILE.json]``: rewards of designs in a file; no model
involved.
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, OmegaConf

from core.cli import arguments, command, write_bytes
from core.config.compose import check_seed, load, node, part
from core.design import Candidate, Evaluation
from core.designs.reading import load_designs, read_designs
from core.designs.rules import SpawnRules
from core.errors import UsageError
from core.interfaces import RolloutSettings
from core.search.evolution import evaluate_all
from core.simulation.rollout import Evaluator
from core.text import clean

USAGE = "usage: python -m core.evaluate task=NAME designs=FILE [sim=NAME] [seed=N] [output=FILE.json] [KEY=VALUE ...]"


def evaluate(cfg: DictConfig) -> list[Evaluation]:
    """Try every action plan in ``cfg.designs``, in the file's order.

    Raises:
        UserError: the file can't be used, or a part or setting can't be had.
    """
    check_seed(cfg.seed)
    document = load_designs(Path(cfg.designs))
    task_part, sim_part = part("task", cfg.task), part("sim", cfg.sim)
    sim_part.create()  # a wrong setting is said here, once, rather than by each worker
    representation = part("tool", cfg.tool).create()
    candidates = read_designs(document, representation, SpawnRules(task_part.create(), cfg.seed))
    bench = Evaluator(task_part, sim_part, cfg.seed, node(cfg.rollout, RolloutSettings))
    with part("executor", cfg.executor).create() as executor:
        evaluations = list(evaluate_all(candidates, bench, executor))
    return sorted(evaluations, key=lambda e: e.candidate.key)


def record(evaluation: Evaluation) -> dict[str, Any]:
    """One entry of the output file."""
    candidate: Candidate = evaluation.candidate
    return {
        "strategy": candidate.strategy,
        "plan": candidate.action,
        "reward": evaluation.reward,
        "distance_m": _or_none(evaluation.distance_m),
        "status": evaluation.status,
        "reason": evaluation.reason,
        "ik_error_m": _or_none(evaluation.ik_error_m),
        "ik_error_rad": _or_none(evaluation.ik_error_rad),
        "warnings": list(evaluation.warnings),
    }


def _or_none(value: float) -> float | None:
    return value if math.isfinite(value) else None  # JSON has no nan


def main() -> None:
    cfg = load("evaluate", arguments(USAGE))
    if OmegaConf.is_missing(cfg, "designs"):
        raise UsageError(f"no designs file given; {USAGE}")
    records = [record(evaluation) for evaluation in evaluate(cfg)]
    if cfg.output is not None:
        write_bytes(Path(cfg.output), (json.dumps(records, indent=2) + "\n").encode())
    show(records)


def show(records: list[dict[str, Any]]) -> None:
    """Print a table."""
    import rich.console
    import rich.table
    from rich.markup import escape

    table = rich.table.Table(box=None, header_style="bold")
    for name in ("strategy", "plan", "reward", "distance m", "IK miss mm"):
        table.add_column(name, justify="right")
    for name in ("status", "reason"):
        table.add_column(name)
    for r in records:
        distance = "" if r["distance_m"] is None else f"{r['distance_m']:.2f}"
        miss = "" if r["ik_error_m"] is None else f"{1000 * r['ik_error_m']:.0f}"
        row = (
            str(r["strategy"]),
            str(r["plan"]),
            f"{r['reward']:.3f}",
            distance,
            miss,
            r["status"],
            escape(clean(r["reason"], 2000)),
        )
        table.add_row(*row)
    rich.console.Console(file=sys.stdout).print(table)


if __name__ == "__main__":
    command(main)
