"""``vlmgineer gallery FOLDER... output=DIR``: write a page of the best tools of each task, and files to print."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from core.config.compose import load
from core.design import ranked
from core.errors import UsageError, UserError
from core.simulation.pictures import png
from core.support.cli import folders_and_overrides, print_table, say, write_bytes
from core.support.text import number
from plugins.results.pages.drawing import draw, painted
from plugins.results.pages.figure import slug
from plugins.results.pages.page import data_address, in_viewer, render
from plugins.results.pages.runs import FinishedRun, LeftOutRun, find_runs, reasons, short
from plugins.results.pages.tools import Winner, distinct, size, winners
from plugins.results.report.methods import label
from plugins.results.workshop.printing import PrintedPart, grams, to_3mf, to_stl
from plugins.results.workshop.settings import Printer
from plugins.results.workshop.tool import pieces

USAGE = (
    "usage: vlmgineer gallery FOLDER [FOLDER ...] [output=DIR] [top=3] [plate_mm=[250,210,220]] "
    "[min_wall_mm=0.8]; FOLDER, or runs=FOLDER, is a run's or holds runs, as a multirun's does"
)
PICTURE = (640, 480)
REASONS = 12  # of a run
APART = 0.01  # metres: tools with all corners closer count as one


@dataclass
class GalleryConfig:
    """Settings of ``vlmgineer gallery``.

    ``top``: the number of tools for each task; ``plate_mm``: the printer's build volume (x, y, z); ``min_wall_mm``: the
    thinnest wall that it prints.
    """

    output: str = "gallery"
    top: int = 3
    plate_mm: list[float] = field(default_factory=lambda: [250.0, 210.0, 220.0])
    min_wall_mm: float = 0.8


@dataclass(frozen=True, eq=False)
class Exhibit:
    """A tool of the gallery: ``place`` is 1 for the best of its task, ``folder`` is that of its files, relative to the
    gallery's.
    """

    place: int
    method: str
    winner: Winner
    pieces: tuple[PrintedPart, ...]
    folder: Path

    @property
    def ready(self) -> bool:
        return all(piece.ready for piece in self.pieces)


def gallery(
    folders: Sequence[Path], output: Path, top: int, printer: Printer
) -> tuple[list[Exhibit], list[LeftOutRun]]:
    """Write pictures, STL, 3MF and designs files of the ``top`` best tools of each task, and a page of them, to
    ``output``. Tools with equally many components and all corners within `APART` count as one: the best of them.

    Returns:
        The tools, and the runs that were left out since they failed, are unfinished or can't be read.

    Raises:
        UserError: a folder holds no run, no tool can be shown, or nothing can be written.
    """
    runs, left_out = find_runs(folders)
    best_of: dict[FinishedRun, list[Winner]] = {}
    for run in runs:
        try:
            best_of[run] = winners(run, top, apart=APART)
        except UserError as error:
            left_out.append(LeftOutRun(run.folder, "unreadable", short(str(error)), run.task, run.config))
    finished = list(best_of)
    entries = []
    methods = dict(zip(finished, label([(run.task, run.config) for run in finished]), strict=True))
    for task in sorted({run.task for run in finished}):
        made = [w for run in finished if run.task == task for w in best_of[run] if w.tool.components]
        best = ranked(made, lambda winner: (winner.reward, winner.distance_m))
        for place, winner in enumerate(distinct(best, top, APART), 1):
            folder = Path(slug(task, 40)) / f"{place}_{slug(winner.name, 40) or 'tool'}"
            entries.append(Exhibit(place, methods[winner.run], winner, tuple(pieces(winner.tool, printer)), folder))
    if not entries:
        if left_out and not finished:
            raise UserError(f"no tool to show: not counted, {left_out[0]}")
        raise UserError(f"no tool to show: {len(finished)} finished runs, all with the bare hand")
    pictures = {entry.folder: data_address(_write(entry, output)) for entry in entries}
    page = render(
        "gallery.html.j2",
        output,
        [in_viewer(e.winner, f"{e.winner.run.task}, {e.place}: {e.winner.name}") for e in entries],
        title="Tools to print",
        tasks=list(dict.fromkeys(entry.winner.run.task for entry in entries)),
        entries=entries,
        grams=grams,
        size=size,
        root=output,
        pictures=pictures,
        left_out=len(left_out),
        reasons=[(run, lines[:REASONS]) for run in finished if (lines := reasons(run.store))],
        printer=printer,
    )
    write_bytes(output / "index.html", page.encode())
    return entries, left_out


def _write(entry: Exhibit, output: Path) -> bytes:
    """Write the entry's files, and return its picture."""
    folder = output / entry.folder
    picture = png(draw(painted(entry.winner.tool, entry.winner.robot), *PICTURE))
    write_bytes(folder / "picture.png", picture)
    for piece in entry.pieces:
        write_bytes(folder / f"{piece.name}.stl", to_stl(piece))
    write_bytes(folder / "tool.3mf", to_3mf(entry.pieces))
    design = json.dumps({"strategies": [entry.winner.design]}, indent=2) + "\n"
    write_bytes(folder / "design.json", design.encode())
    return picture


def show(entries: Sequence[Exhibit]) -> None:
    """Print a table, and below it what speaks against printing a tool."""
    numbers = ("place", "reward")
    rows = [
        (e.winner.run.task, str(e.place), e.winner.name, number(e.winner.reward, 3), "yes" if e.ready else "no")
        for e in entries
    ]
    print_table(("task", "place", "tool", "reward", "ready to print"), rows, numbers)
    for e in entries:
        for piece in e.pieces:
            which = f" ({piece.name})" if len(e.pieces) > 1 else ""
            faults = [f"✗ {check.name}: {check.found}{which}" for check in piece.checks if not check.passed]
            say(*(f"{e.winner.run.task} {e.place}: {fault}" for fault in faults))


def main(words: list[str]) -> None:
    folders, overrides = folders_and_overrides(USAGE, words)
    cfg = load("gallery", overrides, GalleryConfig)
    if not folders:
        raise UsageError(f"no folder given; {USAGE}")
    if cfg.top < 1:
        raise UsageError(f"top must be at least 1, got {cfg.top}")
    printer = Printer(list(cfg.plate_mm), cfg.min_wall_mm)
    entries, left_out = gallery(folders, Path(cfg.output), cfg.top, printer)
    show(entries)
    for run in left_out:
        say(f"not counted, {run}")
    say(str(Path(cfg.output) / "index.html"))
