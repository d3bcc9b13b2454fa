"""How long may a time step be? ``python -m tests.benchmarks.timestep sim=pybullet steps=0.001,0.002,0.004167``.

For every task the same designs at every time step: the rank correlation of their rewards with those at the shortest,
and the cost of a rollout. Results are kept in ``folder`` and not measured again;
``page=docs/agreement.md`` writes the table there.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from core.errors import UsageError
from core.simulation.robustness import engines
from core.support.cli import arguments, command
from tests.benchmarks import measuring
from tests.benchmarks.measuring import kept_share, mean, number, share

USAGE = (
    "usage: python -m tests.benchmarks.timestep [sim=NAME] [steps=SECONDS,SECONDS,...] [tasks=NAME,...] [designs=N] "
    "[by=NAME] [seed=N] [workers=N] [folder=DIR] [page=FILE.md] [estimate=true]"
)


@dataclass
class Settings:
    """``by``: the engine that the designs are evolved in, by default ``sim``. ``estimate``: only print how long it will
    take.
    """

    sim: str = "pybullet"
    steps: list[float] = field(default_factory=lambda: [0.001, 0.002, 0.004167])
    tasks: list[str] = field(default_factory=list)
    designs: int = 100
    by: str | None = None
    seed: int = 0
    workers: int | None = None
    folder: str = "measured"
    page: str | None = None
    estimate: bool = False


def main() -> None:
    given = measuring.settings(arguments(USAGE, sys.argv[1:]), Settings)
    steps, names, folder = sorted(set(given.steps)), measuring.tasks(given.tasks), Path(given.folder)
    if len(steps) < 2:
        raise UsageError(f"steps: at least two different time steps are needed, got {given.steps}")
    sims = dict(zip(steps, engines([{"name": given.sim, "time_step": step} for step in steps]).values(), strict=True))
    shown = {f"{given.sim} at {step:g} s": sim for step, sim in sims.items()}
    designer = engines([given.by or given.sim])[given.by or given.sim]
    workers = measuring.workers(given.workers)
    measuring.estimate(names, shown, designer, given.designs, workers, folder)
    if given.estimate:
        return
    rows = []
    with measuring.executor(workers) as executor:
        for name in names:
            designs = measuring.designs(name, given.designs, designer.name, given.seed, workers, folder)
            records = [measuring.rewards(designs, sim, text, executor, folder) for text, sim in shown.items()]
            for step, record in zip(steps, records, strict=True):
                row = measuring.compare(records[0]["rewards"], record["rewards"], designs.first)
                cost = mean(record["cpu_s"])
                rows.append({"task": name, "sim": given.sim, "time_step": step, "cpu_s": cost, **row})
    table = markdown(steps, rows)
    measuring.save(folder / f"timestep-{given.sim}.json", rows)
    sys.stdout.write(table)
    if given.page is not None:
        measuring.write_page(Path(given.page), f"timestep {given.sim}", table)


def markdown(steps: Sequence[float], rows: Sequence[dict[str, Any]]) -> str:
    """Format a row per task, with four columns per time step but the shortest."""
    shortest, *longer = steps
    columns = [f"| task | designs | {shortest:g} s: CPU s | tied |"]
    columns += [f" {step:g} s: rank correlation | mean difference | kept | CPU s |" for step in longer]
    lines = ["".join(columns), "|" + "---|" * (4 + 4 * len(longer))]
    for task in dict.fromkeys(row["task"] for row in rows):
        base, *others = (row for row in rows if row["task"] == task)
        tied = max(row["tied"] for row in others)
        line = f"| {task} | {base['designs']} | {number(base['cpu_s'])} | {tied:.0%} |"
        for row in others:
            correlation = number(row["rank_correlation"], tied >= measuring.MANY_TIES)
            line += f" {correlation} | {row['mean_difference']:.3f} | {share(row['kept'])} | {number(row['cpu_s'])} |"
        lines.append(line)
    line = f"| **mean** | {sum(r['designs'] for r in rows if r['time_step'] == shortest)} | "
    line += f"{number(mean([r['cpu_s'] for r in rows if r['time_step'] == shortest]))} | |"
    for step in longer:
        same = [row for row in rows if row["time_step"] == step]
        line += f" {number(mean([row['rank_correlation'] for row in same]))} | "
        line += f"{mean([row['mean_difference'] for row in same]):.3f} | {kept_share([row['kept'] for row in same])} | "
        line += f"{number(mean([row['cpu_s'] for row in same]))} |"
    return "\n".join([*lines, line]) + "\n"


if __name__ == "__main__":
    command(lambda _: main())
