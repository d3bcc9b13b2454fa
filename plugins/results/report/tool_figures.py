"""The figures of tools. Covered by `tests/plugins/results/report/test_figures.py`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from plugins.results.pages.drawing import draw, painted
from plugins.results.pages.figure import FigurePage, new_figure, slug, wrapped
from plugins.results.pages.tools import Tools, Winner
from plugins.results.report.results import Results

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MAX_GENERATIONS = 5  # side by side in a row of tools


def gallery(results: Results, tools: Tools) -> FigurePage | None:
    """The best tools side by side: a row per task and a column per method, or all in rows of four of one method."""
    methods = [method for method in results.methods if any(of == method for _, of in tools.best)]
    if not methods:
        return None
    tasks = [task for task in results.tasks if any((task, method) in tools.best for method in methods)]
    grid = [[(task, tools.best.get((task, method))) for method in methods] for task in tasks]
    heads = methods
    if len(methods) == 1:
        cells = [cell for row in grid for cell in row]
        grid, heads = [cells[i : i + 4] for i in range(0, len(cells), 4)], []
    caption = (
        "The tool of the best run's best candidate, as the arm holds it at home: forward is to the right and toward "
        "the reader, grey is the flange or the fingers. Each is drawn to its own scale; the size is its extent along "
        "x, y and z."
    )
    return FigurePage("gallery", "The best tools", caption, lambda: _grid(grid, heads))


def evolution(method: str, rows: dict[str, list[Winner | None]], place: int) -> FigurePage:
    """The best tool of each generation: before evolution, and after it."""
    count = max(len(row) for row in rows.values())
    chosen = sorted({round(i) for i in np.linspace(0, count - 1, min(count, MAX_GENERATIONS))})
    grid = [[(task, row[i] if i < len(row) else None) for i in chosen] for task, row in rows.items()]
    caption = (
        f"The best tool of each generation of the best run of each task with {method}: generation 0 is before "
        "evolution, the last one after it. Each is drawn to its own scale."
    )
    heads = [f"generation {i}" for i in chosen]
    title = f"Before and after evolution: {method}"
    return FigurePage(f"evolution_{place}_{slug(method) or 'method'}", title, caption, lambda: _grid(grid, heads))


def _grid(grid: Sequence[Sequence[tuple[str, Winner | None]]], heads: Sequence[str]) -> Figure:
    """Tools by row: with ``heads`` of the columns a row is a task's, else each tool is named by its task."""
    columns = max(len(row) for row in grid)
    figure = new_figure(max(5.0, 2.3 * columns), 0.7 + 2.15 * len(grid))
    axes = figure.subplots(len(grid), columns, squeeze=False)
    bold = {"fontsize": 9, "fontweight": "bold"}
    for ax in axes.ravel():
        ax.set(xticks=[], yticks=[])
        ax.spines[:].set_visible(False)
    for r, row in enumerate(grid):
        for c, (task, winner) in enumerate(row):
            ax = axes[r][c]
            if not heads or r == 0:
                ax.set_title(wrapped(heads[c] if heads else task, 26), **bold)
            if heads and c == 0:
                ax.set_ylabel(wrapped(task, 24), **bold)
            if winner is None:
                ax.text(0.5, 0.5, "–", ha="center", va="center", transform=ax.transAxes)
                continue
            ax.set_facecolor("white")  # tools may be dark
            ax.imshow(draw(painted(winner.tool, winner.robot), 300, 225))
            ax.set_xlabel(f"{wrapped(winner.name, 32, 2)}\n{winner.summary}", fontsize=7.5)
    return figure
