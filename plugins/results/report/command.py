"""``vlmgineer report FOLDER... output=DIR``: write tables, figures and a page from the runs in folders."""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TextIO

from core.config.compose import load
from core.errors import UsageError, UserError, choices
from core.support.cli import folders_and_overrides, print_table, say, write_bytes
from core.support.text import number
from plugins.results.pages.figure import FORMATS, FigurePage
from plugins.results.pages.formats import Table, printed, to_csv, to_markdown
from plugins.results.pages.page import figure_address, in_viewer, render
from plugins.results.pages.runs import find_runs, short
from plugins.results.pages.tools import Tools, collect
from plugins.results.report.archives import heat_map, picked_table, read_archives
from plugins.results.report.figures import figure_pages
from plugins.results.report.leaderboard import entry_tables, find_entries, read_entry
from plugins.results.report.results import Results
from plugins.results.report.statistics import Resampling, deviation, mean
from plugins.results.report.tables import tables

USAGE = (
    "usage: vlmgineer report FOLDER [FOLDER ...] [output=DIR] [formats=[png,svg]] [confidence=0.95] "
    "[resamples=10000] [name=NAME] [entries=[FILE.json,...]]; FOLDER, or runs=FOLDER, is a run's or holds runs, as a "
    "multirun's does"
)
DATA = "data"  # the folder of tables and figures, beside the page


@dataclass
class ReportConfig:
    """Settings of ``vlmgineer report``.

    ``formats``: the figures' file formats; ``confidence`` and ``resamples`` belong to the bootstrap intervals.
    ``name``: of what is an entry of a benchmark; ``entries``: results files to compare it with.
    """

    output: str = "report"
    formats: list[str] = field(default_factory=lambda: ["png", "svg"])
    confidence: float = 0.95
    resamples: int = 10_000
    name: str = ""
    entries: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Section:
    """A section of the page."""

    id: str
    title: str
    pictures: tuple[str, ...] = ()
    tables: tuple[str, ...] = ()


def report(
    folders: list[Path], output: Path, formats: list[str], how: Resampling, name: str = "", others: Sequence[Path] = ()
) -> Results:
    """Read the runs in ``folders``; write the page, the tables and the figures to ``output``.

    What is an entry of a benchmark becomes a results file, called ``name`` or by its method, and is compared with
    ``others``.

    Raises:
        UserError: a folder holds no run, a results file can't be used, or nothing can be written.
    """
    theirs = [read_entry(file) for file in others]
    finished, left_out = find_runs(folders)
    entries, problems = find_entries(finished, left_out, name)
    for entry in entries:
        file = re.sub(r"[^\w.=-]+", "_", f"{entry.protocol}_{entry.track}_{entry.name}")[:100]
        write_bytes(output / DATA / f"{file}.json", entry.dump())
    say(*problems)
    results = Results(tuple(finished), tuple(left_out), how, (*entries, *theirs))
    shown = collect(results)
    archives = read_archives(results, shown.problems)
    listed = [*tables(results, shown), *([picked_table(archives)] if archives else [])]
    drawn = [*figure_pages(results, shown), *(heat_map(archive, place) for place, archive in enumerate(archives, 1))]
    for table in listed:
        write_bytes(output / DATA / f"{table.name}.csv", to_csv(table, output / DATA).encode(errors="backslashreplace"))
        write_bytes(output / DATA / f"{table.name}.md", to_markdown(table).encode(errors="backslashreplace"))
    for picture in drawn:
        for format_ in formats:
            write_bytes(output / DATA / f"{picture.name}.{format_}", picture.render(format_))
    write_bytes(output / "index.html", page(results, shown, listed, drawn, formats, output).encode())
    return results


def page(
    results: Results, shown: Tools, listed: list[Table], drawn: list[FigurePage], formats: list[str], folder: Path
) -> str:
    """The page with all tables and figures, as it will lie in ``folder``."""
    tools = []
    for (task, method), winner in shown.best.items():
        tools.append(in_viewer(winner, f"{task}, {method}: {winner.name}"))
        first = (shown.courses.get(method, {}).get(task) or [None])[0]
        if first is not None and winner.generation > 0:
            tools.append(in_viewer(first, f"{task}, {method}, before evolution: {first.name}"))
    sections = (
        Section("entries", "Entries of the benchmark", (), ("entries", "entries_by_task")),
        Section("results", "Rewards", ("rewards", "deviations"), ("rewards",)),
        Section("methods", "Over all tasks", ("intervals",), ("methods", "improvements")),
        Section("given", "Given tools and designed ones", ("given_tools",)),
        Section(
            "generations",
            "By generation",
            ("anytime", "generations", "generations_by_task"),
            ("efforts", "generations"),
        ),
        Section("tools", "Tools", ("gallery", *(p.name for p in drawn if p.name.startswith("evolution_"))), ("tools",)),
        Section("archives", "Archives", tuple(p.name for p in drawn if p.name.startswith("archive_")), ("archive",)),
        Section("models", "Models and critics", (), ("models", "critiques")),
        Section("runs", "Runs", (), ("left_out", "runs")),
        Section("parameters", "Parameters, costs, versions", (), ("parameters", "costs", "versions")),
    )
    there = {table.name for table in listed} | {picture.name for picture in drawn}
    methods, tasks = results.methods, results.tasks
    return render(
        "report.html.j2",
        folder,
        tools,
        title="Tools and their rewards",
        summary=(
            f"{_several(len(results.runs), 'finished run')} of {_several(len(methods), 'method')} on "
            f"{_several(len(tasks), 'task')}."
        ),
        warnings=[f"Tools that can't be shown: {problem}" for problem in shown.problems],
        sections=[section for section in sections if there & {*section.pictures, *section.tables}],
        tables={table.name: table for table in listed},
        pictures={picture.name: picture for picture in drawn},
        drawings={p.name: figure_address(p.render("svg", ground="none", titled=False)) for p in drawn},
        formats=formats,
        files=f"{DATA}/",
    )


def _several(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"


def show(results: Results, file: TextIO | None = None) -> None:
    """Print best, average and standard deviation by task and method, and a line for each run that is not counted."""
    file = sys.stdout if file is None else file
    numbers = ("runs", "best", "average", "s.d.", "distance m")
    rows = [
        (
            *(g.task, g.method, str(len(g.runs)), number(g.best.best.reward, 3), number(mean(g.rewards), 3)),
            *(number(deviation(g.rewards), 3), number(g.best.best.distance_m, 2)),
        )
        for g in results.groups
    ]
    if rows:
        print_table(("task", "method", *numbers), rows, numbers, file)
    for table in entry_tables(results.entries, results.how)[:1]:
        cells = [[printed(*pair) for pair in zip(row, table.columns, strict=True)] for row in table.rows]
        digits = [column.name for column in table.columns if column.digits is not None]
        print_table([column.name for column in table.columns], cells, digits, file)
    for run in results.left_out:
        say(f"not counted, {run.status}: {short(str(run.folder))}: {run.reason}", file=file)


def main(words: list[str]) -> None:
    folders, overrides = folders_and_overrides(USAGE, words)
    cfg = load("report", overrides, ReportConfig)
    if not folders and not cfg.entries:
        raise UsageError(f"no folder given; {USAGE}")
    formats = [str(name) for name in cfg.formats]
    for name in formats:
        if name not in FORMATS:
            raise choices("format", name, FORMATS, "formats")
    if not 0 < cfg.confidence < 1:
        raise UsageError(f"confidence must be between 0 and 1, got {cfg.confidence}")
    if cfg.resamples < 1:
        raise UsageError(f"resamples must be at least 1, got {cfg.resamples}")
    how, others = Resampling(cfg.confidence, cfg.resamples), [Path(file) for file in cfg.entries]
    results = report(folders, Path(cfg.output), formats, how, cfg.name, others)
    if not results.runs and results.left_out:
        (first, *_), listed = results.left_out, Path(cfg.output) / "index.html"
        why = f"{first.status}: {short(str(first.folder))}: {first.reason}"
        raise UserError(f"no run is finished; {len(results.left_out)} are listed in {listed}; the first, {why}")
    show(results)
    say(str(Path(cfg.output) / "index.html"))
