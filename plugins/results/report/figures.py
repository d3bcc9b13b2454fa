"""The figures of a report: rewards and gains with their intervals, and curves."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import chain
from statistics import fmean
from typing import TYPE_CHECKING, Any

import numpy as np

from core.geometry import Array
from plugins.results.pages.figure import COLORS, INK, FigurePage, new_figure, wrapped
from plugins.results.pages.formats import Cell, Table
from plugins.results.pages.runs import FinishedRun
from plugins.results.report.methods import Group
from plugins.results.report.results import Results
from plugins.results.report.statistics import interval

if TYPE_CHECKING:
    from matplotlib.figure import Figure

POINTS = 25
"""Of a curve, at which its interval is drawn."""

GAP = 0.8  # between the rows of two tasks; those of one task are 1 apart
ROW = 0.22  # inches of a row


OF_TABLES = {
    "methods": ("Methods over their tasks", "mean", "mean, low", "mean, high"),
    "gains": ("Gains over the first method", "gain", "low", "high"),
}
"""Figures of a table: their title, and the columns with the mean, low and high."""


def figure_pages(results: Results, listed: Sequence[Table]) -> list[FigurePage]:
    """Make all figures that have something to show, some of them from tables that are listed."""
    if not results.groups:
        return []

    pages = [rewards(results)]
    tables = {table.name: table for table in listed}
    for name, (title, *columns) in OF_TABLES.items():
        if name in tables:
            pages.append(from_table(results, tables[name], title, columns))

    pages += [
        _draw_courses(results, "anytime", "rollouts", _read_course, 3),
        _draw_courses(results, "by_generation", "generation", _read_generations, 2),
    ]
    return [page for page in pages if page is not None]


def comparable(results: Results) -> tuple[list[str], list[str]]:
    """All tasks and the methods that were run on all of them; failing that, the tasks that all methods share."""
    tasks = results.tasks
    methods = results.methods
    everywhere = [m for m in methods if len(results.groups_of(m)) == len(tasks)]
    if everywhere:
        return tasks, everywhere

    shared = set(tasks)
    for method in methods:
        shared &= {g.task for g in results.groups_of(method)}

    if not shared:
        return [], []

    return [task for task in tasks if task in shared], methods


def _look(results: Results, method: str) -> dict[str, Any]:
    """The label and colour of a method."""
    number = results.methods.index(method)
    return {"label": wrapped(method, 48), "color": COLORS[number % len(COLORS)]}


def _name_looks(figure: Figure, ax: Any) -> None:
    """Say below a figure what its colours and marks are."""
    handles, names = ax.get_legend_handles_labels()
    looks = dict(zip(names, handles, strict=True))
    figure.legend([*looks.values()], [*looks], loc="outside lower center", ncols=2)


@dataclass(frozen=True)
class _Estimate:
    """A mean with its interval, as a row of a figure.

    Attributes:
        place: of its row, from the top.
        mean: of what the figure shows.
        span: low and high; None: unknown.
        runs: what it is the mean of, where each is shown.
        look: its label and colour.
    """

    place: float
    mean: float
    span: tuple[float, float] | None
    look: dict[str, Any]
    runs: Sequence[float] = ()

    @property
    def values(self) -> list[float]:
        """All that is drawn of it."""
        return [self.mean, *self.runs, *(self.span or ())]


def rewards(results: Results) -> FigurePage | None:
    """Draw each run's reward, and their average with its interval, by task and method; None: there is one run."""
    if len(results.runs) < 2:
        return None

    places = _places(results)

    def paint() -> Figure:
        rows = []
        for g, place in places.items():
            span = interval([g.rewards], "mean")
            look = _look(results, g.method)
            rows.append(_Estimate(place, fmean(g.rewards), span, look, g.rewards))

        middles = []
        for task in results.tasks:
            own = [place for g, place in places.items() if g.task == task]
            middles.append(fmean(own))

        figure, ax = _draw_estimates(rows)
        ax.set_yticks(middles, [wrapped(task, 30) for task in results.tasks])
        _limit_rewards(ax, rows)
        _name_looks(figure, ax)
        return figure

    return FigurePage("rewards", "Reward by task and method", paint)


def from_table(
    results: Results, listed: Table, title: str, columns: Sequence[str]
) -> FigurePage | None:
    """Draw a mean of each method, with its interval; None: there is nothing to compare.

    Args:
        results: of the report.
        listed: the table of methods, or that of their gains over the first one.
        title: above the figure.
        columns: of the table: the mean, low and high.
    """
    rows = _rows_of(results, listed, columns)
    over_first = listed.name == "gains"
    if len(rows) < (1 if over_first else 2):
        return None

    def paint() -> Figure:
        figure, ax = _draw_estimates(rows)
        ax.set_yticks([row.place for row in rows], [row.look["label"] for row in rows])
        if over_first:
            ax.axvline(0, color=INK, lw=1)
            against = wrapped(results.methods[0], 48)
            ax.set(xlabel=f"gain of reward over {against}")
        else:
            _limit_rewards(ax, rows)

        return figure

    return FigurePage(listed.name, title, paint)


def _rows_of(
    results: Results, listed: Table, columns: Sequence[str]
) -> list[_Estimate]:
    """Make a row of each of a table's; ``columns`` have the mean, low and high."""
    names = [column.name for column in listed.columns]
    rows = []
    for place, cells in enumerate(listed.rows):
        row = dict(zip(names, cells, strict=True))
        mean, *span = (_read_number(row[column]) for column in columns)
        if mean is None:
            continue

        low, high = span
        known = None if low is None or high is None else (low, high)
        rows.append(_Estimate(place, mean, known, _look(results, str(row["method"]))))

    return rows


def _read_number(cell: Cell) -> float | None:
    return float(cell) if isinstance(cell, int | float) else None


def _draw_estimates(rows: Sequence[_Estimate]) -> tuple[Figure, Any]:
    """Draw means as filled dots, their intervals as lines and what they are means of as small rings."""
    last = max(row.place for row in rows)
    figure = new_figure(6.4, 1.5 + ROW * (last + 1))
    ax: Any = figure.subplots()
    for row in rows:
        color = row.look["color"]
        level = [row.place] * len(row.runs)
        ax.plot(row.runs, level, "o", ms=4, mfc="none", mec=color, mew=0.8)
        if row.span is not None:
            ax.plot(row.span, [row.place] * 2, color=color, lw=2.5)
        ax.plot(row.mean, row.place, "o", ms=7, mec="white", **row.look)

    ax.set_ylim(last + 0.75, -0.75)
    ax.tick_params(axis="y", length=0)
    ax.grid(axis="y", visible=False)
    ax.grid(axis="x", visible=True)
    return figure, ax


def _limit_rewards(ax: Any, rows: Sequence[_Estimate]) -> None:
    """Let an axis of rewards begin at 0, or where all are high nearer to the least of them."""
    least = min(min(row.values) for row in rows)
    start = 0.0
    if least >= 0.5:
        step = 0.05 if least < 0.95 else 0.005
        start = max(0.0, math.floor(least / step - 0.5) * step)

    end = 1 + 0.02 * (1 - start)
    ax.set(xlim=(start, end), xlabel=f"reward (from {start:.3g} to 1)")


def _places(results: Results) -> dict[Group, float]:
    """Return in which row each group stands: those of a task together, and a gap between tasks."""
    tasks = results.tasks
    return {g: i + GAP * tasks.index(g.task) for i, g in enumerate(results.groups)}


def _read_course(run: FinishedRun) -> Array:
    """Return the best reward so far after each number of a run's rollouts, from 0 on."""
    evaluations = run.store.evaluations()
    spent = np.cumsum([evaluation.rollouts for evaluation in evaluations])
    rewards = [evaluation.reward for evaluation in evaluations]
    best = np.append(0.0, np.maximum.accumulate(rewards))
    rollouts = np.arange(spent[-1] + 1)
    found: Array = best[np.searchsorted(spent, rollouts, side="right")]

    return found


def _read_generations(run: FinishedRun) -> Array:
    """Return the best reward up to and with each generation of a run."""
    return np.array(run.best_so_far(len(run.figures.generations)))


@dataclass(frozen=True)
class _Curve:
    """A method's course: places ``x`` (POINTS,), and for each task its runs' rewards there (runs, POINTS)."""

    x: Array
    scores: Sequence[Array]


def _draw_courses(
    results: Results,
    name: str,
    against: str,
    read: Callable[[FinishedRun], Array],
    least: int,
) -> FigurePage | None:
    """Draw the mean best reward so far, with its interval, of the methods and tasks that are comparable.

    Args:
        results: of the report.
        name: of the figure's file.
        against: what the places of a course count.
        read: returns a run's best reward so far at each place.
        least: places that a method's course has at least.

    Returns:
        The figure; None where no course is so long.
    """
    tasks, methods = comparable(results)
    curves = {}
    for method in methods:
        groups = [g for g in results.groups_of(method) if g.task in tasks]
        courses = [list(map(read, g.runs)) for g in groups]
        length = max(map(len, chain(*courses)))
        if length < least:
            continue

        x = np.unique(np.linspace(0, length - 1, POINTS, dtype=int))
        scores = []
        for task in courses:
            # A run that ended early keeps its last.
            rows = [course[np.minimum(x, len(course) - 1)] for course in task]
            scores.append(np.array(rows))

        curves[method] = _Curve(x, scores)

    if not curves:
        return None

    return _draw_curves(results, curves, against, name)


def _draw_curves(
    results: Results,
    curves: dict[str, _Curve],
    against: str,
    name: str,
) -> FigurePage:
    """Draw means over tasks, with their intervals where these are known.

    Args:
        results: of the report.
        curves: by method.
        against: what ``x`` counts.
        name: of the figure's file.
    """

    def paint() -> Figure:
        figure = new_figure(6.4, 4.0)
        ax: Any = figure.subplots()
        for method, curve in curves.items():
            look = _look(results, method)
            rows = []
            for i, place in enumerate(curve.x):
                span = interval([task[:, i] for task in curve.scores], "mean")
                if span is not None:
                    rows.append((place, *span))

            if rows:
                band = {"color": look["color"], "alpha": 0.18, "lw": 0}
                ax.fill_between(*zip(*rows, strict=True), step="post", **band)

            means = [task.mean(axis=0) for task in curve.scores]
            mean = np.mean(means, axis=0)
            ax.plot(curve.x, mean, lw=1.8, drawstyle="steps-post", **look)

        ax.set(ylabel="mean best reward so far (0 to 1)", xlabel=against)
        ax.locator_params(axis="x", integer=True)
        _name_looks(figure, ax)

        return figure

    return FigurePage(name, f"Reward by {against}", paint)
