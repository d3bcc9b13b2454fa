"""The figures of a report: bars by task, and curves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import chain
from statistics import fmean
from typing import TYPE_CHECKING, Any

import numpy as np

from core.geometry import Array
from plugins.results.pages.figure import COLORS, INK, FigurePage, new_figure, wrapped
from plugins.results.pages.runs import FinishedRun
from plugins.results.report.methods import Group
from plugins.results.report.results import Results
from plugins.results.report.statistics import deviation, interval

if TYPE_CHECKING:
    from matplotlib.figure import Figure

POINTS = 25
"""Of a curve, at which its interval is drawn."""

WIDTH = 0.9  # of a bar; those of a task stand 1 apart
GAP = 0.8  # more, between two tasks
FOOT = 0.015  # of a bar, below 0


def figure_pages(results: Results) -> list[FigurePage]:
    """All figures that have something to show."""
    if not results.groups:
        return []
    tasks, methods = comparable(results)
    pages = [
        rewards(results),
        on_some_tasks(results),
        anytime(results, tasks, methods),
        by_generation(results, tasks, methods),
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


def rewards(results: Results) -> FigurePage:
    """Bars of the average with the best, the deviation and every run; below, the distances where rewards tie."""
    places = _places(results)
    tied = tied_groups(results)

    def paint() -> Figure:
        shares = [3, 1] if tied else [1]
        width = max(6.4, 1.2 + 0.24 * max(places.values()))
        figure = new_figure(width, 3.0 + len(shares))
        rows = figure.subplots(
            len(shares), sharex=True, squeeze=False, height_ratios=shares
        )
        first = rows[0, 0]
        last = rows[-1, 0]
        for g, place in places.items():
            _draw_rewards(first, place, g, _look(results, g.method))
        first.set(ylim=(0, 1.02), yticks=np.linspace(0, 1, 6), ylabel="reward (0 to 1)")

        for g in tied:
            color = _look(results, g.method)["color"]
            last.bar(places[g], g.best.best.distance_m or 0.0, WIDTH, color=color)
            last.set(ylabel="distance (m)")

        _name_tasks(last, results, places)
        labels = dict(zip(*first.get_legend_handles_labels()[::-1], strict=True))
        figure.legend(labels.values(), labels.keys(), loc="outside lower center")

        return figure

    return FigurePage("rewards", "Reward by task and method", paint)


def on_some_tasks(results: Results) -> FigurePage | None:
    """The same bars for the tasks of the method that was run on the fewest; None: all were run on all."""
    fewest = min(
        reversed(results.methods), key=lambda name: len(results.groups_of(name))
    )
    tasks = [g.task for g in results.groups_of(fewest)]
    if len(tasks) == len(results.tasks):
        return None
    there = tuple(run for run in results.runs if run.task in tasks)
    title = f"The tasks of {fewest}"
    return replace(
        rewards(replace(results, runs=there)), name="on_some_tasks", title=title
    )


def _places(results: Results) -> dict[Group, float]:
    """Return where each group's bar stands: those of a task side by side, and a gap between tasks."""
    gaps = [GAP * results.tasks.index(g.task) for g in results.groups]
    return {g: i + gaps[i] for i, g in enumerate(results.groups)}


def tied_groups(results: Results) -> list[Group]:
    """Return the groups whose best rewards are their task's highest, within what counts as equal, where several are."""
    tied = []
    for task in results.tasks:
        groups = [g for g in results.groups if g.task == task]
        least = max(g.best.best.reward - g.best.figures.tie for g in groups)
        first = [g for g in groups if g.best.best.reward >= least]
        if len(first) > 1:
            tied += first

    return tied


def _draw_rewards(ax: Any, place: float, g: Group, look: dict[str, Any]) -> None:
    """Draw the bar of a group; a foot of its colour tells the method at a reward of 0 too."""
    mean = fmean(g.rewards)
    ax.bar(place, mean, WIDTH, **look)
    ax.bar(place, -FOOT, WIDTH, color=look["color"], clip_on=False)

    spread = deviation(g.rewards) or 0.0
    ends = np.clip([mean - spread, mean + spread], 0, 1)
    ax.plot([place, place], ends, color=INK, lw=1)

    dot: dict[str, Any] = {"mfc": "none", "mec": INK, "mew": 0.7, "clip_on": False}
    ax.plot([place] * len(g.rewards), g.rewards, "o", ms=3, **dot)
    dot["mfc"] = "white"
    ax.plot(place, g.best.best.reward, "D", ms=4.5, label="best run", **dot)


def _name_tasks(ax: Any, results: Results, places: dict[Group, float]) -> None:
    """Write each task below the middle of its bars."""
    middles = []
    for task in results.tasks:
        middles.append(fmean(place for g, place in places.items() if g.task == task))
    names = [wrapped(task, 30) for task in results.tasks]
    ax.set_xticks(middles, names, rotation=35, ha="right", rotation_mode="anchor")
    ax.tick_params(axis="x", length=0)
    ax.set_xlim(-0.75, max(places.values()) + 0.75)


def _read_course(run: FinishedRun) -> Array:
    """Return the best reward so far after each number of a run's rollouts, from 0 on."""
    evaluations = run.store.evaluations()
    spent = np.cumsum([evaluation.rollouts for evaluation in evaluations])
    rewards = [evaluation.reward for evaluation in evaluations]
    best = np.append(0.0, np.maximum.accumulate(rewards))
    rollouts = np.arange(spent[-1] + 1)
    found: Array = best[np.searchsorted(spent, rollouts, side="right")]

    return found


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
    for method in methods:
        groups = [g for g in results.groups_of(method) if g.task in tasks]
        courses[method] = [list(map(_read_course, g.runs)) for g in groups]

    ends = {m: max(map(len, chain(*by_task))) - 1 for m, by_task in courses.items()}
    if max(ends.values(), default=0) < 2:
        return None

    def paint() -> Figure:
        figure = new_figure(6.4, 4.0)
        ax = figure.subplots()
        for method, by_task in courses.items():
            x = np.unique(np.linspace(0, ends[method], POINTS, dtype=int))
            scores = []  # of each task (runs, POINTS)
            for task in by_task:
                # A run that ended early keeps its last.
                rows = [course[np.minimum(x, len(course) - 1)] for course in task]
                scores.append(np.array(rows))

            look = _look(results, method)
            _shade_interval(ax, x, scores, look["color"])
            means = [task.mean(axis=0) for task in scores]
            ax.step(x, np.mean(means, axis=0), where="post", lw=1.8, **look)

        ax.set(ylabel="mean best reward so far (0 to 1)", xlabel="rollouts")
        figure.legend(loc="outside lower center")

        return figure

    return FigurePage("anytime", "Reward by rollouts", paint)


def by_generation(
    results: Results, tasks: list[str], methods: list[str]
) -> FigurePage | None:
    """Draw the mean best reward up to each generation; arguments and return are those of `anytime`."""
    curves = {}
    for method in methods:
        groups = [g for g in results.groups_of(method) if g.task in tasks]
        length = max(len(run.figures.generations) for g in groups for run in g.runs)
        means = []
        for g in groups:
            means.append(np.mean([run.best_so_far(length) for run in g.runs], axis=0))
        curves[method] = np.mean(means, axis=0)

    longest = max(map(len, curves.values()), default=0)
    if longest < 2:
        return None

    def paint() -> Figure:
        figure = new_figure(6.4, 4.0)
        ax = figure.subplots()
        for method, curve in curves.items():
            ax.plot(range(len(curve)), curve, marker="o", **_look(results, method))

        ax.set(ylabel="mean best reward so far (0 to 1)", xlabel="generation")
        ax.set_xticks(range(longest))
        figure.legend(loc="outside lower center")

        return figure

    return FigurePage("by_generation", "Reward by generation", paint)


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
        band = {"color": color, "alpha": 0.18, "lw": 0}
        ax.fill_between(*zip(*rows, strict=True), step="post", **band)
