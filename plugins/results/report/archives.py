"""The archives of runs: what each cell's best tool looks like and earns, and the picks."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from core.design import Candidate, Evaluation, ranked
from core.designs.planning import NO_PLAN
from core.designs.reading import MAX_DESCRIPTION
from core.errors import UserError
from core.interfaces import Robot
from core.search.archive import UNITS, VALUES, Kept, Measure, handed_over, measures_of
from core.support.text import clean, number
from plugins.results.pages.drawing import Pixels, draw, painted
from plugins.results.pages.figure import INK, FigurePage, new_figure, slug, wrapped
from plugins.results.pages.formats import Cell, Table, columns
from plugins.results.pages.runs import FinishedRun
from plugins.results.pages.tools import every_tool
from plugins.results.report.results import Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WIDTH, _CELL = 14.0, 1.05  # inches, at most
_TALL = 0.75  # of a cell, over its width
_GROUND = ("#fffbe6", "#fde0a3", "#f9b877", "#ea8a66")  # of cells, by reward: tools of most colours stand out


@dataclass(frozen=True, eq=False)
class Archived:
    """The archive of a method's best run of a task."""

    task: str
    method: str
    robot: Robot
    measures: tuple[Measure, ...]
    kept: list[Kept]

    @property
    def filled(self) -> int:
        """The number of cells with a candidate."""
        return sum(kept.cell is not None for kept in self.kept)


def read_archive(task: str, method: str, run: FinishedRun) -> Archived | None:
    """Read the archive of a run from its store; None: its strategy has no measures.

    Raises:
        UserError: a part of the run is not installed here, or its store is missing or damaged.
    """
    measures = measures_of(run.config.get("evolution", {}))
    if not measures:
        return None
    winners = list(every_tool(run))
    tools = {winner.candidate.rpartition("-")[0]: winner.tool for winner in winners}
    evaluations = []
    for stored in run.store.evaluations():
        tool = tools.get(stored.candidate.rpartition("-")[0])
        if stored.status == "ok" and tool is not None:  # none: all its plans stopped
            evaluations.append(stored.of(Candidate(tool, NO_PLAN, *stored.design, stored.number)))
    kept = handed_over(measures, evaluations, run.figures.tie)
    return Archived(task, method, winners[0].robot, measures, kept)


def read_archives(results: Results, problems: list[str]) -> list[Archived]:
    """Read the archives of the best runs; what can't be read is added to ``problems``."""
    archives = []
    for g in results.groups:
        try:
            archives.append(read_archive(g.task, g.method, g.best))
        except UserError as error:
            problems.append(f"archive of {g.task}, {g.method}: {clean(str(error), MAX_DESCRIPTION)}")
    return [archive for archive in archives if archive is not None]


def picked_table(archives: Iterable[Archived]) -> Table:
    """The picks of each archive."""
    head = columns(
        "task|method|cells filled:0|pick|tool|reward:3|mass (g):1|extent (mm):0|components:0|distance (m):2|candidate"
    )
    units = {"kg": 1000.0, "m": 1000.0, "": 1.0}
    rows: list[tuple[Cell, ...]] = [
        (
            *(archive.task, archive.method, archive.filled, ", ".join(kept.picked)),
            *(_name(kept.evaluation), kept.evaluation.reward),
            *(units[UNITS[name]] * VALUES[name](kept.evaluation) for name in ("mass", "extent", "components")),
            *(kept.evaluation.distance_m, kept.evaluation.candidate.id),
        )
        for archive in archives
        for kept in sorted(archive.kept, key=lambda kept: kept.evaluation.reward, reverse=True)
        if kept.picked
    ]
    note = (
        "Of all candidates of the method's best run. Best: of those that earned about the most (`evolution.tie`) the "
        "shortest motion; light: the best tool below 200 g; plate: the best tool with no side above 220 mm. The run's "
        "folder has all of them, and the best of each cell, in `archive/`."
    )
    return Table("archive", "Picks", head, tuple(rows), note)


def _name(evaluation: Evaluation) -> str:
    tool = evaluation.candidate.tool
    return tool.name if tool is not None and tool.name else evaluation.candidate.id


def heat_map(archive: Archived, place: int) -> FigurePage:
    """The archive as a map of its first two measures, with the best tool in each cell."""
    first, *others = [measure.name for measure in archive.measures]
    over = f"; of cells that differ in {', '.join(others[1:])} alone the best one is shown" if others[1:] else ""
    caption = (
        f"{archive.filled} cells of the best run of {archive.task} with {archive.method}, by {first}"
        f"{f' and {others[0]}' if others else ''}: the colour and the number are the best reward in the cell, the "
        f"drawing is its tool, each to its own scale{over}. Rows and columns without any are cut off at the edges."
    )
    name = f"archive_{place}_{slug(f'{archive.task}_{archive.method}')}"
    pictures: dict[str, Pixels] = {}  # drawn once for all formats
    return FigurePage(name, "The best of each kind", caption, lambda: _map(archive, pictures))


def _map(archive: Archived, pictures: dict[str, Pixels]) -> Figure:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LinearSegmentedColormap, Normalize

    axes, best = (*archive.measures, None)[:2], _flat(archive)
    low, high = np.min(list(best), axis=0), np.max(list(best), axis=0) + 1
    size = min(_CELL, _WIDTH / (high - low)[0])
    figure = new_figure(*np.maximum((high - low) * size * (1, _TALL) + (2.2, 1.2), (6.0, 2.6)))
    ax, colors = figure.subplots(), LinearSegmentedColormap.from_list("reward", _GROUND)
    for (x, y), kept in best.items():
        reward, candidate = kept.evaluation.reward, kept.evaluation.candidate
        ax.fill([x, x + 1, x + 1, x], [y, y, y + 1, y + 1], color=colors(reward), ec="white", lw=0.8, zorder=1)
        assert candidate.tool is not None
        if candidate.id not in pictures:
            pictures[candidate.id] = draw(painted(candidate.tool, archive.robot), 120, 90)
        ax.imshow(pictures[candidate.id], extent=(x + 0.08, x + 0.92, y + 0.04, y + 0.84), zorder=2)
        small: dict[str, Any] = {"fontsize": 6.5 * size / _CELL, "color": INK, "va": "top", "zorder": 3}
        ax.text(x + 0.96, y + 0.95, number(reward, 2), ha="right", **small)
        ax.text(x + 0.04, y + 0.95, ", ".join(kept.picked), ha="left", fontweight="bold", **small)
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect=_TALL)
    _edges(ax, "x", axes[0], low[0], high[0])
    _edges(ax, "y", axes[1], low[1], high[1])
    ax.set_title(wrapped(f"{archive.task}, {archive.method}", 60))
    figure.colorbar(ScalarMappable(Normalize(0, 1), colors), ax=ax, label="best reward (0 to 1)", shrink=0.8)
    return figure


def _flat(archive: Archived) -> dict[tuple[int, int], Kept]:
    """The best in each cell of the first two measures."""
    cells: dict[tuple[int, int], Kept] = {}
    filed = [kept for kept in archive.kept if kept.cell is not None]
    for kept in ranked(filed, lambda kept: (kept.evaluation.reward, kept.evaluation.distance_m)):
        assert kept.cell is not None
        cells.setdefault((*kept.cell, 0)[:2], kept)  # type: ignore[arg-type]
    return cells


def _edges(ax: Axes, which: str, measure: Measure | None, low: int, high: int) -> None:
    """Name an axis, and write the bounds of its bins."""
    if measure is None:
        ax.set_yticks([])
        return
    ticks = range(low, high + 1)
    width, unit = (measure.upper - measure.lower) / measure.bins, UNITS[measure.name]
    bounds = [f"{measure.lower + width * tick:.3g}" for tick in ticks]
    name = f"{measure.name}{f' ({unit})' if unit else ''}"
    ax.set(**{f"{which}ticks": ticks, f"{which}ticklabels": bounds, f"{which}label": name})
