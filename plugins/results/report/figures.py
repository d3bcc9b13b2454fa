"""The figures of a report: bars by task, and curves."""

from __future__ import annotations

from statistics import fmean
from typing import TYPE_CHECKING, Any

import numpy as np

from core.geometry import Array
from plugins.results.pages.figure import COLORS, INK, FigurePage, new_figure, wrapped
from plugins.results.pages.runs import FinishedRun
from plugins.results.report.results import Results
from plugins.results.report.statistics import interval

if TYPE_CHECKING:
    from matplotlib.figure import Figure

POINTS = 25  # of a curve, at which its interval is drawn


def figure_pages(results: Results) -> list[FigurePage]:
    """All figures that have something to show."""
    if not results.groups:
        return []
    tasks, methods = comparable(results)
    pages = [rewards(results), anytime(results, tasks, methods)]
    return [page for page in pages if page is not None]


def comparable(results: Results) -> tuple[list[str], list[str]]:
    """All tasks and the methods that were run on all of them; failing that, the tasks that all methods share."""
    everywhere = [
        method
        for method in results.methods
        if len(results.of(method)) == len(results.tasks)
    ]
    if everywhere:
        return results.tasks, everywhere
    shared = [
        t
        for t in results.tasks
        if {*results.methods} <= {g.method for g in results.groups if g.task == t}
    ]
    return shared, results.methods if shared else []


def _look(results: Results, method: str) -> dict[str, Any]:
    """The label and colour of a method."""
    number = results.methods.index(method)
    return {"label": wrapped(method, 48), "color": COLORS[number % len(COLORS)]}


def rewards(results: Results) -> FigurePage:
    """Grouped bars of the average, and every run as a dot."""
    tasks = results.tasks
    methods = results.methods

    def paint() -> Figure:
        figure = new_figure(max(6.4, 1.2 + 0.24 * len(tasks) * (len(methods) + 1)), 4.0)
        ax = figure.subplots()
        step = 0.8 / len(methods)
        for i, method in enumerate(methods):
            groups = results.of(method)
            places = [tasks.index(g.task) - 0.4 + step * (i + 0.5) for g in groups]
            means = [fmean(g.rewards) for g in groups]
            ax.bar(
                places,
                means,
                0.9 * step,
                edgecolor="white",
                lw=0.5,
                **_look(results, method),
            )
            for place, g in zip(places, groups, strict=True):
                ax.plot(
                    [place] * len(g.rewards),
                    g.rewards,
                    "o",
                    ms=3,
                    mfc="none",
                    mec=INK,
                    mew=0.6,
                    clip_on=False,
                )
        ax.set(
            ylim=(0, 1.02),
            yticks=np.linspace(0, 1, 6),
            ylabel="reward (0 to 1)",
            xlim=(-0.5, len(tasks) - 0.5),
        )
        ax.grid(axis="y")
        ax.set_xticks(
            range(len(tasks)),
            [wrapped(task, 30) for task in tasks],
            rotation=35,
            ha="right",
        )
        ax.tick_params(axis="x", length=0)
        figure.legend(loc="outside lower center", ncols=2)
        return figure

    return FigurePage("rewards", "Reward by task and method", paint)


def _course(run: FinishedRun) -> tuple[Array, Array]:
    """The number of rollouts, and the best reward so far, after each of a run's N candidates: each (N,)."""
    evaluations = run.store.evaluations()
    return np.cumsum([e.rollouts for e in evaluations]), np.maximum.accumulate(
        [e.reward for e in evaluations]
    )


def anytime(
    results: Results, tasks: list[str], methods: list[str]
) -> FigurePage | None:
    """The mean best reward so far against rollouts, over the tasks that the methods share, with its interval."""
    courses = {
        m: [[_course(run) for run in g.runs] for g in results.of(m, tasks)]
        for m in methods
    }
    ends = {
        m: max(spent[-1] for task in by_task for spent, _ in task)
        for m, by_task in courses.items()
    }
    if max(ends.values(), default=0.0) < 2:
        return None

    def paint() -> Figure:
        figure = new_figure(6.4, 4.0)
        ax = figure.subplots()
        for method, by_task in courses.items():
            look = _look(results, method)
            x = np.linspace(0, ends[method], POINTS)
            scores = [
                np.array(
                    [
                        np.append(0.0, best)[np.searchsorted(spent, x, side="right")]
                        for spent, best in task
                    ]
                )
                for task in by_task
            ]  # of each task (runs, POINTS)
            spans = [
                interval([task[:, i] for task in scores], "mean") for i in range(POINTS)
            ]
            known = [
                (place, *span)
                for place, span in zip(x, spans, strict=True)
                if span is not None
            ]
            if known:
                places, low, high = zip(*known, strict=True)
                ax.fill_between(
                    places, low, high, color=look["color"], alpha=0.18, lw=0
                )
            ax.plot(
                x,
                np.mean([task.mean(axis=0) for task in scores], axis=0),
                lw=1.8,
                **look,
            )
        ax.grid(axis="y", visible=True)
        ax.set(ylabel="mean best reward so far (0 to 1)", xlabel="rollouts")
        figure.legend(loc="outside lower center", ncols=2)
        return figure

    return FigurePage("anytime", "Reward by rollouts", paint)
