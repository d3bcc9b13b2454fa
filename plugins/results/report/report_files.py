"""What a report consists of: the page, and the tables and figures beside it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from markupsafe import Markup

from core.support.files import read_untrusted
from core.support.text import number
from plugins.results.pages.best_tool import size
from plugins.results.pages.formats import to_csv
from plugins.results.pages.page import data_address, figure_address, in_viewer, render
from plugins.results.report.figures import comparable, figure_pages
from plugins.results.report.methods import rank
from plugins.results.report.results import Results
from plugins.results.report.statistics import CONFIDENCE, RESAMPLES
from plugins.results.report.tables import REASONS, tables
from plugins.results.report.verify import TOLERANCE

DATA = "data"
"""The folder of tables and figures, beside the page."""

FILM_BYTES = 5_000_000
FILMS_BYTES = 20_000_000  # of all on a page


def contents(results: Results, folder: Path) -> dict[str, bytes]:
    """Return the files of a report that will lie in ``folder``; the page is ``index.html``."""
    listed = tables(results)
    pictures = figure_pages(results, listed)
    drawings = {
        picture.name: picture.render("svg", ground="none", titled=False)
        for picture in pictures
    }
    page = render(
        "report.html.j2",
        folder,
        _in_viewer(results),
        title="Tools and their rewards",
        results=results,
        films=_films(results),
        warnings=[
            f"Tools that can't be shown: {problem}"
            for problem in results.tools.problems
        ],
        tables={table.name: table for table in listed},
        pictures={picture.name: picture for picture in pictures},
        drawings={name: figure_address(drawing) for name, drawing in drawings.items()},
        files=f"{DATA}/",
        interval=f"{100 * CONFIDENCE:g} % percentiles of {RESAMPLES} bootstrap samples",
        most={"reasons": REASONS, "tolerance": TOLERANCE},
        shared=comparable(results)[0],
    )

    files = {"index.html": page.encode()}
    for table in listed:
        text = to_csv(table, folder / DATA)
        files[f"{DATA}/{table.name}.csv"] = text.encode(errors="backslashreplace")

    for picture in pictures:
        files[f"{DATA}/{picture.name}.png"] = picture.render("png")
        files[f"{DATA}/{picture.name}.svg"] = drawings[picture.name]
        files[f"{DATA}/{picture.name}.pdf"] = picture.render("pdf", titled=False)

    return files


def _films(results: Results) -> list[tuple[str, Markup]]:
    """Return a film for each task, of the best run that has one, as far as it is small enough for a page."""
    films = {}
    left = FILMS_BYTES

    for g in sorted(results.groups, key=lambda g: rank(g.best)):
        for task, film in g.best.films().items():
            length = film.stat().st_size
            if task in films or length > min(FILM_BYTES, left):
                continue

            left -= length
            address = data_address(read_untrusted(film, FILM_BYTES), "gif")
            films[task] = (f"{task}, {g.method}: the best motion", address)

    return [films[task] for task in sorted(films)]


def _in_viewer(results: Results) -> list[dict[str, Any]]:
    """Return the best tools, to turn around."""
    shown = []
    for (task, method), winner in results.tools.best.items():
        name = f"{task}, {method}: {winner.name}"
        extent = size(winner.tool, winner.robot)
        caption = f"reward {number(winner.run.best.reward, 3)}, {extent}"
        shown.append(in_viewer(winner.tool, winner.robot, name, caption))

    return shown
