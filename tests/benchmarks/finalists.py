"""Do finalists choose better winners? ``python -m tests.benchmarks.finalists tasks=NAME,... seeds=N``.

Each search is run once, and its winner chosen by both rules: the shortest of those that tie, and the finalist that
holds best. Both are tried in the same unseen layouts. Runs are kept in ``folder``, with a record each: an interrupted
measurement goes on with the search that it was at, from its begin.
"""

from __future__ import annotations

import json
import shutil
import statistics
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from core.config.compose import load, node, part, task_part
from core.design import Candidate
from core.interfaces import RolloutSettings
from core.plugins import FITNESS, SIMULATOR
from core.search.orchestration import run
from core.simulation.rollout import Evaluator
from core.support.cli import arguments, command
from tests.benchmarks import measuring

USAGE = (
    "usage: python -m tests.benchmarks.finalists [tasks=NAME,...] [seeds=N] [layouts=N] [final=N] [unseen=N] "
    "[also=[WORD,...]] [folder=DIR]"
)
EASY = ["BringCube", "CleanTable", "GatherSpheres", "MoveBall", "SnatchCookie"]
HARD = ["AroundCorner", "OpenLatch", "PastGlasses", "StopCart", "SweepCards"]
BASE = ["vlm=offline", "sim=mujoco", "action=anchored", "task.variation=wide", "fitness=layouts", "fitness.unseen=0"]
BASE += ["budget=quick", "film=false", "listener=[]", "executor.workers=1"]


@dataclass
class Settings:
    """``layouts``: of the search. ``final``: layouts that decide. ``unseen``: layouts in which winners are tried.
    ``also``: further words of each run's command line.
    """

    tasks: list[str] = field(default_factory=lambda: [*EASY, *HARD])
    seeds: int = 5
    layouts: int = 3
    final: int = 8
    unseen: int = 20
    also: list[str] = field(default_factory=lambda: ["budget.n_agent=1", "budget.n_iteration=1"])
    folder: str = "finalists"


def main() -> None:
    given = measuring.settings(arguments(USAGE, sys.argv[1:]), Settings)
    records: dict[str, list[dict[str, Any]]] = {}
    for seed in range(given.seeds):  # what is there when time is up has all tasks
        for task in given.tasks:
            records.setdefault(task, []).append(record(task, seed, given))
            sys.stderr.write(f"{task} {seed}: {records[task][-1]}\n")
    sys.stdout.write(table(records))


def record(task: str, seed: int, given: Settings) -> dict[str, Any]:
    """Run a search unless it was, and try the winners of both rules."""
    folder = Path(given.folder) / f"{task}-{seed}"
    file = folder / "record.json"
    if file.exists():
        found: dict[str, Any] = json.loads(file.read_text())
        return found
    counts = [f"fitness.layouts={given.layouts}", f"fitness.final={given.final}"]
    words = [*BASE, f"task={task}", f"seed={1000 * seed}", *counts, *given.also]  # seeds share no layout
    shutil.rmtree(folder, ignore_errors=True)
    cfg = load("config", words)
    result = run(cfg, folder)
    extra = sum(len(rewards) for engines in result.finals.values() for rewards in engines.values())
    cfg.fitness.unseen = given.unseen
    evaluator = Evaluator(task_part(cfg), part(SIMULATOR, cfg.sim), cfg.seed, node(cfg.rollout, RolloutSettings))
    (unseen,) = part(FITNESS, cfg.fitness).create(evaluator=evaluator).unseen().values()
    assert result.best is not None
    shortest = result.ranking[0].candidate
    without, same = tried(shortest, unseen), result.best.candidate.id == shortest.id
    found = {
        **{"finalists": len(result.finals), "extra": extra, "rollouts": result.rollouts - extra, "same": same},
        **{"without": without, "with": without if same else tried(result.best.candidate, unseen)},
    }
    file.write_text(json.dumps(found))
    return found


def tried(candidate: Candidate, trials: Sequence[Evaluator]) -> list[float]:
    """Return the rewards of a candidate in each trial; what fails earns 0."""
    return [float(trial([candidate])[0].reward) for trial in trials]


def table(records: dict[str, list[dict[str, Any]]]) -> str:
    """Write the table: means over the searches, the mean of their worst layouts, and the rollouts."""
    lines = [
        "| task | tied | other winner | mean, without | mean, with | worst, without | worst, with | rollouts | more |"
    ]
    lines += ["|---|---|---|---|---|---|---|---|---|"]
    for name, known in [*records.items(), ("**all**", [r for of in records.values() for r in of])]:
        tied, other = sum(r["finalists"] > 1 for r in known), sum(not r["same"] for r in known)
        means = [statistics.fmean(statistics.fmean(r[rule]) for r in known) for rule in ("without", "with")]
        worst = [statistics.fmean(min(r[rule]) for r in known) for rule in ("without", "with")]
        spent = [round(statistics.fmean(r[what] for r in known)) for what in ("rollouts", "extra")]
        figures = " | ".join(f"{x:.3f}" for x in (*means, *worst))
        lines.append(f"| {name} | {tied} of {len(known)} | {other} | {figures} | {spent[0]} | {spent[1]} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    command(lambda _: main())
