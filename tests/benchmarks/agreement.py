"""Do engines agree? ``python -m tests.benchmarks.agreement sims=pybullet,sapien designs=100 tasks=BringCube,OneBook``.

For every task the same designs in every engine: the rank correlation of their rewards, and how many of the good ones
stay good. Results are kept in ``folder`` and not measured again;
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from core.simulation.robustness import engines
from core.support.cli import arguments, command
from tests.benchmarks import measuring
from tests.benchmarks.measuring import kept_share, mean, number, share

USAGE = (
    "usage: python -m tests.benchmarks.agreement [sims=NAME,NAME,...] [tasks=NAME,...] [designs=N] [by=NAME] [seed=N] "
    "[workers=N] [folder=DIR]"
)

CORRELATIONS = ("rank_correlation", "of_first_sampling", "of_offspring")


@dataclass
class Settings:
    """``by``: the engine that the designs are evolved in, by default the first of ``sims``, which may have settings, as
    ``{name: pybullet, time_step: 0.004}``.
    """

    sims: list[Any] = field(default_factory=lambda: ["pybullet", "sapien"])
    tasks: list[str] = field(default_factory=list)
    designs: int = 100
    by: str | None = None
    seed: int = 0
    workers: int | None = None
    folder: str = "measured"


def main() -> None:
    given = measuring.settings(arguments(USAGE, sys.argv[1:]), Settings)
    names, sims, folder = measuring.tasks(given.tasks), engines(given.sims), Path(given.folder)
    designer = engines([given.by])[given.by] if given.by is not None else next(iter(sims.values()))
    workers = measuring.workers(given.workers)
    rows = []
    with measuring.executor(workers) as executor:
        for name in names:
            designs = measuring.designs(name, given.designs, designer.name, given.seed, workers, folder)
            records = {shown: measuring.rewards(designs, sim, shown, executor, folder) for shown, sim in sims.items()}
            for one, other in itertools.combinations(sims, 2):
                row = measuring.compare(records[one]["rewards"], records[other]["rewards"], designs.first)
                rows.append({"task": name, "engines": [one, other], **row})
    table = "\n".join(
        markdown(one, other, [row for row in rows if row["engines"] == [one, other]])
        for one, other in itertools.combinations(sims, 2)
    )
    measuring.save(folder / "agreement.json", rows)
    sys.stdout.write(table)


def markdown(one: str, other: str, rows: Sequence[dict[str, Any]]) -> str:
    """Format the table of two engines."""
    lines = [
        f"| task | designs | rank correlation | first | offspring | tied | mean difference | {one} → {other} | "
        f"{other} → {one} | mean {one} | mean {other} |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        many = row["tied"] >= measuring.MANY_TIES
        correlations = (row[key] for key in CORRELATIONS)
        lines.append(
            f"| {row['task']} | {row['designs']} | {' | '.join(number(c, many) for c in correlations)} | "
            f"{row['tied']:.0%} | {row['mean_difference']:.3f} | {share(row['kept'])} | {share(row['kept_back'])} | "
            f"{row['means'][0]:.3f} | {row['means'][1]:.3f} |"
        )
    overall = [number(mean([row[key] for row in rows])) for key in CORRELATIONS]
    ranked = sum(row["rank_correlation"] is not None for row in rows)
    lines.append(
        f"| **mean** of {ranked} | {sum(row['designs'] for row in rows)} | {' | '.join(overall)} | | "
        f"{mean([row['mean_difference'] for row in rows]):.3f} | {kept_share([row['kept'] for row in rows])} | "
        f"{kept_share([row['kept_back'] for row in rows])} | {mean([row['means'][0] for row in rows]):.3f} | "
        f"{mean([row['means'][1] for row in rows]):.3f} |"
    )
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    command(lambda _: main())
