"""``vlmgineer report FOLDER... output=DIR``: write tables, figures and a page from the runs in folders."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from operator import itemgetter
from pathlib import Path

from core.config.compose import load
from core.errors import UsageError, UserError
from core.support.cli import folders_and_overrides, print_table, say, write_bytes
from plugins.results.pages.formats import printed
from plugins.results.pages.runs import find_runs
from plugins.results.report.contents import DATA, contents
from plugins.results.report.leaderboard import (
    ListedEntry,
    entry_tables,
    find_entries,
    read_entry,
)
from plugins.results.report.results import Results
from plugins.results.report.tables import rewards
from plugins.results.report.verify import verification, verify

USAGE = (
    "usage: vlmgineer report FOLDER [FOLDER ...] [output=DIR] [name=NAME] [entries=[FILE.json,...]] "
    "[verify=FILE.json]; FOLDER, or runs=FOLDER, is a run's or holds runs, as a multirun's does"
)


@dataclass
class ReportConfig:
    """Settings of ``vlmgineer report``.

    Attributes:
        output: the folder to write.
        name: of the entry of a benchmark; empty: the method's (docs/benchmark.md).
        entries: results files of other entries, to compare.
        verify: a results file whose designs are tried again, in some minutes.
    """

    output: str = "report"
    name: str = ""
    entries: list[str] = field(default_factory=list)
    verify: str = ""


def report(
    folders: list[Path],
    output: Path,
    name: str = "",
    others: Sequence[Path] = (),
    claimed: Path | None = None,
) -> Results:
    """Read the runs in ``folders``; write the page, the tables and the figures to ``output``.

    What is an entry of a benchmark becomes a results file, called ``name`` or by its method, and is compared with
    ``others``, and with ``claimed``, whose designs are tried again.

    Raises:
        UserError: a folder holds no run, a results file can't be used, or nothing can be written.
    """
    theirs = [ListedEntry(read_entry(file), "no") for file in others]
    verified = tuple(verify(read_entry(claimed))) if claimed is not None else ()
    if verified:
        theirs.append(
            ListedEntry(
                verified[0].entry,
                f"{sum(run.same for run in verified)} of {len(verified)} runs",
            )
        )
    finished, left_out = find_runs(folders)
    entries, problems = find_entries(finished, left_out, name)
    for entry in entries:
        file = re.sub(
            r"[^\w.=-]+", "_", f"{entry.protocol}_{entry.track}_{entry.name}"
        )[:100]
        write_bytes(output / DATA / f"{file}.json", entry.dump())
    say(*problems)
    listed_entries = (
        *(ListedEntry(entry, "runs at hand") for entry in entries),
        *theirs,
    )
    results = Results(tuple(finished), tuple(left_out), listed_entries, verified)
    for file, make in contents(results, output).items():
        write_bytes(output / file, make())
    return results


def show(results: Results) -> None:
    """Print best, average and standard deviation by task and method, and a line for each run that is not counted."""
    whole = rewards(results)
    short = itemgetter(0, 1, 2, 4, 5, 6, 8)
    short_rewards = replace(
        whole, columns=short(whole.columns), rows=tuple(map(short, whole.rows))
    )
    for table in (
        short_rewards,
        *entry_tables(results.entries)[:1],
        verification(results.verified),
    ):
        if table.rows:
            cells = [
                [printed(*pair) for pair in zip(row, table.columns, strict=True)]
                for row in table.rows
            ]
            digits = [
                column.name for column in table.columns if column.digits is not None
            ]
            print_table([column.name for column in table.columns], cells, digits)
    for run in results.left_out:
        say(f"not counted, {run}")


def main(words: list[str]) -> None:
    folders, overrides = folders_and_overrides(USAGE, words)
    cfg = load("report", overrides, ReportConfig)
    if not (folders or cfg.entries or cfg.verify):
        raise UsageError(f"no folder given; {USAGE}")
    claimed = Path(cfg.verify) if cfg.verify else None
    results = report(
        folders, Path(cfg.output), cfg.name, [*map(Path, cfg.entries)], claimed
    )
    if not results.runs and results.left_out:
        (first, *_), listed = results.left_out, Path(cfg.output) / "index.html"
        raise UserError(
            f"no run is finished; {len(results.left_out)} are listed in {listed}; the first, {first}"
        )
    show(results)
    say(str(Path(cfg.output) / "index.html"))
    if wrong := [
        f"{run.task} with seed {run.seed}"
        for run in results.verified
        if not run.same and run.claimed > 0
    ]:
        raise UserError(
            f"{cfg.verify} claims what its designs don't earn here: {', '.join(wrong)}"
        )
