"""The figures of a report: bars by task, and curves."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import fmean
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from core.geometry import Array
from plugins.results.pages.figure import COLORS, INK, FigurePage, new_figure, wrapped
from plugins.results.pages.runs import FinishedRun
from plugins.results.report.results import Results
from plugins.results.report.statistics import interval

if TYPE_CHECKING:
    from matplotlib.figure import Figure

POINTS = 25
"""Of a curve, at which its interval is drawn."""


class Course(NamedTuple):
    """The number of rollouts, and the best reward so far, after each of a run's N candidates: each (N,)."""

    spent: Array
    best: Array

    def rewards(self, rollouts: Array) -> Array:
        """Return the best reward after each of some numbers of rollouts."""
        from_none = np.append(0.0, self.best)
        found: Array = from_none[np.searchsorted(self.spent, rollouts, side="right")]
        return found


def figure_pages(results: Results) -> list[FigurePage]:
    """All figures that have something to show."""
    if not results.groups:
        return []
    tasks, methods = comparable(results)
    pages = [rewards(results), anytime(results, tasks, methods)]
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


def rewards(results: Results) -> FigurePage:
    """Grouped bars of the average, and every run as a dot."""
    tasks = results.tasks
    methods = results.methods
    step = 0.8 / len(methods)

    def paint() -> Figure:
        figure = new_figure(max(6.4, 1.2 + 0.24 * len(tasks) * (len(methods) + 1)), 4.0)
        ax = figure.subplots()
        for i, method in enumerate(methods):
            groups = results.groups_of(method)
            places = [tasks.index(g.task) - 0.4 + step * (i + 0.5) for g in groups]
            means = [fmean(g.rewards) for g in groups]
            look = _look(results, method)
            ax.bar(places, means, 0.9 * step, edgecolor="white", lw=0.5, **look)
            dot: dict[str, Any] = {
                "ms": 3,
                "mfc": "none",
                "mec": INK,
                "mew": 0.6,
                "clip_on": False,
            }
            for place, g in zip(places, groups, strict=True):
                ax.plot([place] * len(g.rewards), g.rewards, "o", **dot)

        ax.set(
            ylim=(0, 1.02),
            yticks=np.linspace(0, 1, 6),
            ylabel="reward (0 to 1)",
            xlim=(-0.5, len(tasks) - 0.5),
        )
        ax.grid(axis="y")
        names = [wrapped(task, 30) for task in tasks]
        ax.set_xticks(range(len(tasks)), names, rotation=35, ha="right")
        ax.tick_params(axis="x", length=0)
        figure.legend(loc="outside lower center", ncols=2)

        return figure

    return FigurePage("rewards", "Reward by task and method", paint)


def _read_course(run: FinishedRun) -> Course:
    evaluations = run.store.evaluations()
    spent = np.cumsum([evaluation.rollouts for evaluation in evaluations])
    rewards = [evaluation.reward for evaluation in evaluations]
    return Course(spent, np.maximum.accumulate(rewards))


def anytime(
    results: Results, tasks: list[str], methods: list[str]
) -> FigurePage | None:
    """Draw the mean best reward so far against rollouts, with its interval.

    Args:
        results: of the report.
        tasks: over which the mean is taken.
        methods: each of which has a curve, and was run on all of these tasks.

    Returns:
        The figure; None where no run had two rollouts.
    """
    courses = {}
    ends = {}
    for method in methods:
        groups = [g for g in results.groups_of(method) if g.task in tasks]
        courses[method] = [list(map(_read_course, g.runs)) for g in groups]
        ends[method] = max(
            max(course.spent[-1] for course in task) for task in courses[method]
        )

    if max(ends.values(), default=0.0) < 2:
        return None

    def paint() -> Figure:
        figure = new_figure(6.4, 4.0)
        ax = figure.subplots()
        for method, by_task in courses.items():
            x = np.linspace(0, ends[method], POINTS)
            scores = []  # of each task (runs, POINTS)
            for task in by_task:
                scores.append(np.array([course.rewards(x) for course in task]))
            look = _look(results, method)
            _shade_interval(ax, x, scores, look["color"])
            means = [task.mean(axis=0) for task in scores]
            ax.plot(x, np.mean(means, axis=0), lw=1.8, **look)

        ax.grid(axis="y", visible=True)
        ax.set(ylabel="mean best reward so far (0 to 1)", xlabel="rollouts")
        figure.legend(loc="outside lower center", ncols=2)

        return figure

    return FigurePage("anytime", "Reward by rollouts", paint)


def _shade_interval(ax: Any, x: Array, scores: Sequence[Array], color: str) -> None:
    """Draw the interval of the mean where it is known.

    Args:
        ax: the axes.
        x: places (POINTS,), rollouts.
        scores: of each task its runs' (runs, POINTS).
        color: of the method.
    """
    rows = []
    for i, place in enumerate(x):
        span = interval([task[:, i] for task in scores], "mean")
        if span is not None:
            rows.append((place, *span))

    if rows:
        ax.fill_between(*zip(*rows, strict=True), color=color, alpha=0.18, lw=0)
