"""What a report consists of: the page, and the tables and figures beside it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from markupsafe import Markup

from core.support.files import read_untrusted
from core.support.text import number
from plugins.results.pages.formats import to_csv
from plugins.results.pages.page import data_address, figure_address, in_viewer, render
from plugins.results.pages.tools import size
from plugins.results.report.figures import comparable, figure_pages
from plugins.results.report.results import Results
from plugins.results.report.statistics import CONFIDENCE, RESAMPLES
from plugins.results.report.tables import REASONS, tables
from plugins.results.report.verify import TOLERANCE

DATA = "data"  # the folder of tables and figures, beside the page
FILM_BYTES, FILMS_BYTES = 5_000_000, 20_000_000  # of one, and of all on a page


def _films(results: Results) -> list[tuple[str, Markup]]:
    """The films of the best runs, with what they show, as far as they are small enough for a page."""
    films = []
    left = FILMS_BYTES
    for g in results.groups:
        for film in g.best.films():
            if (size := film.stat().st_size) <= min(FILM_BYTES, left):
                left -= size
                address = data_address(read_untrusted(film, FILM_BYTES), "gif")
                task = g.task if film.parent.name == "best" else film.parent.name
                films.append((f"{task}, {g.method}: the best motion", address))
    return films


def _in_viewer(results: Results) -> list[dict[str, Any]]:
    """The best tools, to turn around."""
    shown = []
    for (task, method), winner in results.tools.best.items():
        said = f"reward {number(winner.reward, 3)}, {size(winner.tool, winner.robot)}"
        shown.append(
            in_viewer(
                winner.tool, winner.robot, f"{task}, {method}: {winner.name}", said
            )
        )
    return shown


def contents(results: Results, folder: Path) -> dict[str, Callable[[], bytes]]:
    """The files of a report that will lie in ``folder``, each with what makes it; the page is ``index.html``."""
    listed = tables(results)
    drawn = figure_pages(results)
    drawings = {
        picture.name: picture.render("svg", ground="none", titled=False)
        for picture in drawn
    }
    counts = {
        "finished run": results.runs,
        "method": results.methods,
        "task": results.tasks,
    }
    runs, methods, tasks = (
        f"{len(of)} {what}{'' if len(of) == 1 else 's'}" for what, of in counts.items()
    )
    page = render(
        "report.html.j2",
        folder,
        _in_viewer(results),
        title="Tools and their rewards",
        summary=f"{runs} of {methods} on {tasks}.",
        films=_films(results),
        warnings=[
            f"Tools that can't be shown: {problem}"
            for problem in results.tools.problems
        ],
        tables={table.name: table for table in listed},
        pictures={picture.name: picture for picture in drawn},
        drawings={name: figure_address(drawing) for name, drawing in drawings.items()},
        files=f"{DATA}/",
        interval=f"{100 * CONFIDENCE:g} % percentiles of {RESAMPLES} bootstrap samples",
        most={"reasons": REASONS, "tolerance": TOLERANCE},
        shared=comparable(results)[0],
    )
    files: dict[str, Callable[[], bytes]] = {"index.html": page.encode}
    csv = {table.name: to_csv(table, folder / DATA) for table in listed}
    files |= {
        f"{DATA}/{name}.csv": partial(text.encode, errors="backslashreplace")
        for name, text in csv.items()
    }
    files |= {
        f"{DATA}/{picture.name}.png": partial(picture.render, "png")
        for picture in drawn
    }
    return files | {
        f"{DATA}/{name}.svg": partial(bytes, drawing)
        for name, drawing in drawings.items()
    }
