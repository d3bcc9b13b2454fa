"""``vlmgineer report FOLDER... output=DIR``: write tables, figures and a page from the runs in folders."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from operator import itemgetter
from pathlib import Path

from core.config.compose import load
from core.errors import UsageError, UserError
from core.support.cli import say, write_bytes
from plugins.results.named_folders import folders_and_overrides
from plugins.results.pages.figure import slug
from plugins.results.pages.formats import show_table
from plugins.results.pages.runs import find_runs
from plugins.results.report.entries import ListedEntry, read_entry
from plugins.results.report.entry_tables import entry_tables
from plugins.results.report.own_entries import find_entries
from plugins.results.report.report_files import DATA, contents
from plugins.results.report.results import Results
from plugins.results.report.tables import rewards
from plugins.results.report.verify import verification, verify
from plugins.results.study.study_files import find_record

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
    """Read runs, and write the page, the tables and the figures.

    What is an entry of a benchmark becomes a results file, and is compared with others.

    Args:
        folders: of runs, or that hold runs.
        output: the folder to write.
        name: of the entry; empty: its method's.
        others: results files to compare with.
        claimed: a results file whose designs are tried again; None: none is.

    Raises:
        UserError: a folder holds no run, a results file can't be used, or nothing can be written.
    """
    theirs = [ListedEntry(read_entry(file), "no") for file in others]
    verified = tuple(verify(read_entry(claimed))) if claimed is not None else ()
    if verified:
        same = sum(run.same for run in verified)
        verdict = f"{same} of {len(verified)} runs"
        theirs.append(ListedEntry(verified[0].entry, verdict))

    finished, left_out = find_runs(folders)
    entries, problems = find_entries(finished, left_out, name)
    for entry in entries:
        file = slug(f"{entry.protocol}_{entry.track}_{entry.name}", 100)
        write_bytes(output / DATA / f"{file}.json", entry.dump())

    say(*problems)

    ours = [ListedEntry(entry, "runs at hand") for entry in entries]
    study = find_record(folders)
    results = Results(
        tuple(finished), tuple(left_out), (*ours, *theirs), verified, study
    )
    for file, data in contents(results, output).items():
        write_bytes(output / file, data)

    return results


def show(results: Results) -> None:
    """Print best, average and standard deviation by task and method, and a line for each run that is not counted."""
    full = rewards(results)
    shorten = itemgetter(0, 1, 2, 4, 5, 6, 8)
    rows = tuple(shorten(row) for row in full.rows)
    short = replace(full, columns=shorten(full.columns), rows=rows)
    entries = entry_tables(results.entries)[:1]
    for table in (short, *entries, verification(results.verified)):
        if table.rows:
            show_table(table)

    for run in results.left_out:
        say(f"not counted, {run}")


def main(words: list[str]) -> None:
    """Write a report, and print its first table.

    Raises:
        UserError: see `report`; or no run is finished, or a results file claims what its designs don't earn.
    """
    folders, overrides = folders_and_overrides(USAGE, words)
    cfg = load("report", overrides, ReportConfig)
    if not (folders or cfg.entries or cfg.verify):
        raise UsageError(f"no folder given; {USAGE}")

    others = [Path(file) for file in cfg.entries]
    claimed = Path(cfg.verify) if cfg.verify else None
    results = report(folders, Path(cfg.output), cfg.name, others, claimed)
    page = Path(cfg.output) / "index.html"
    left_out = results.left_out
    if left_out and not results.runs:
        raise UserError(
            f"no run is finished; {len(left_out)} are listed in {page}; the first, {left_out[0]}"
        )

    show(results)
    say(str(page))

    wrong = [
        f"{run.task} with seed {run.seed}"
        for run in results.verified
        if not run.same and run.claimed > 0
    ]
    if wrong:
        raise UserError(
            f"{cfg.verify} claims what its designs don't earn here: {', '.join(wrong)}"
        )
