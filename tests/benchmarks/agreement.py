"""Do engines agree? ``python -m tests.benchmarks.agreement sims=pybullet,sapien designs=100 tasks=BringCube,OneBook``.

For every task the same designs in every engine: the rank correlation of their rewards, and how many of the good ones
stay good. Results are kept in ``folder`` and not measured again; ``page=docs/agreement.md`` writes the table there.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from core.designs.rules import SpawnRules
from core.plugins import installed
from core.simulation.robustness import engines
from core.support.cli import arguments, command
from tests.benchmarks import measuring
from tests.benchmarks.loosening import loosened
from tests.benchmarks.measuring import kept_share, mean, number, share

USAGE = (
    "usage: python -m tests.benchmarks.agreement [sims=NAME,NAME,...] [tasks=NAME,...] [designs=N] [by=NAME] [seed=N] "
    "[workers=N] [folder=DIR] [page=FILE.md] [estimate=true] [loose=true]"
)

CORRELATIONS = ("rank_correlation", "of_first_sampling", "of_offspring")


@dataclass
class Settings:
    """``by``: the engine that the designs are evolved in, by default the first of ``sims``. ``estimate``: only print
    how long it will take. ``loose``: their tools are made round, and the heads hang on joints (`loosening`); the table
    goes to a place of its own.
    """

    sims: list[Any] = field(default_factory=lambda: ["pybullet", "sapien"])
    tasks: list[str] = field(default_factory=list)
    designs: int = 100
    by: str | None = None
    seed: int = 0
    workers: int | None = None
    folder: str = "measured"
    page: str | None = None
    estimate: bool = False
    loose: bool = False


def main() -> None:
    given = measuring.settings(arguments(USAGE, sys.argv[1:]), Settings)
    names, sims, folder = measuring.tasks(given.tasks), engines(given.sims), Path(given.folder)
    designer = engines([given.by])[given.by] if given.by is not None else next(iter(sims.values()))
    workers = measuring.workers(given.workers)
    measuring.estimate(names, sims, designer, given.designs, workers, folder)
    if given.estimate:
        return
    rows = []
    with measuring.executor(workers) as executor:
        for name in names:
            designs = measuring.designs(name, given.designs, designer.name, given.seed, workers, folder)
            kept = folder
            if given.loose:
                designs, kept = loose(designs), folder / "loose"
            records = {shown: measuring.rewards(designs, sim, shown, executor, kept) for shown, sim in sims.items()}
            for one, other in itertools.combinations(sims, 2):
                row = measuring.compare(records[one]["rewards"], records[other]["rewards"], designs.first)
                rows.append({"task": name, "engines": [one, other], **row})
    table = "\n".join(
        markdown(one, other, [row for row in rows if row["engines"] == [one, other]])
        for one, other in itertools.combinations(sims, 2)
    )
    measuring.save(folder / "agreement.json", rows)
    sys.stdout.write(table)
    if given.page is not None:
        measuring.write_page(Path(given.page), "loose" if given.loose else "agreement", table)


def loose(designs: measuring.Designs) -> measuring.Designs:
    """Return the designs that can be made loose, so made."""
    first = dict(zip((candidate.key for candidate in designs.candidates), designs.first, strict=True))
    spawn = SpawnRules(installed().create("task", designs.task), designs.seed)
    made = loosened(designs.candidates, spawn, designs.seed)
    return replace(designs, candidates=made, first=tuple(first[candidate.key] for candidate in made))


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
