"""The figures of a report: bars by task, and curves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain
from statistics import fmean
from typing import TYPE_CHECKING, Any, Literal

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
ENTRY = 0.7  # inches of a legend's entry ...
LETTER = 0.075  # ... and of each letter


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


def _name_looks(figure: Figure, ax: Any) -> None:
    """Say below a figure what its colours and marks are: bars first, in as few rows as its width allows."""
    handles, names = ax.get_legend_handles_labels()
    looks = dict(zip(names, handles, strict=True))
    names = sorted(looks, key=lambda name: not hasattr(looks[name], "patches"))

    width = sum(ENTRY + LETTER * len(name) for name in names)
    rows = math.ceil(width / figure.get_figwidth())
    columns = math.ceil(len(names) / rows)
    handles = [looks[name] for name in names]
    figure.legend(handles, names, loc="outside lower center", ncols=columns)


def rewards(results: Results) -> FigurePage:
    """Bars of the average with the best, the deviation and every run; below, the distances where rewards tie."""
    places = _places(results)
    tied = tied_groups(results)

    def paint() -> Figure:
        shares = [3, 1] if tied else [1]
        width = max(6.4, 1.2 + 0.24 * max(places.values()))
        figure = new_figure(width, 2.6 + len(shares))
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

        first.tick_params(axis="x", length=0)
        _name_tasks(last, results, places)
        _name_looks(figure, first)

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
    tasks = results.tasks
    return {g: i + GAP * tasks.index(g.task) for i, g in enumerate(results.groups)}


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
    ax.plot([place, place], ends, color=INK, lw=1, label="standard deviation")

    dot: dict[str, Any] = {"mfc": "none", "mec": INK, "mew": 0.7, "clip_on": False}
    ax.plot([place] * len(g.rewards), g.rewards, "o", ms=3, label="run", **dot)
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


@dataclass(frozen=True)
class _Curve:
    """A method's course: places ``x`` (POINTS,), and for each task its runs' rewards there (runs, POINTS)."""

    x: Array
    scores: Sequence[Array]


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
    curves = {}
    for method in methods:
        groups = [g for g in results.groups_of(method) if g.task in tasks]
        courses = [list(map(_read_course, g.runs)) for g in groups]
        end = max(map(len, chain(*courses))) - 1
        x = np.unique(np.linspace(0, end, POINTS, dtype=int))
        scores = []
        for task in courses:
            # A run that ended early keeps its last.
            rows = [course[np.minimum(x, len(course) - 1)] for course in task]
            scores.append(np.array(rows))

        curves[method] = _Curve(x, scores)

    if max((curve.x[-1] for curve in curves.values()), default=0) < 2:
        return None

    return _draw_curves(results, curves, "rollouts", "anytime", step="post")


def by_generation(
    results: Results, tasks: list[str], methods: list[str]
) -> FigurePage | None:
    """Draw the mean best reward up to each generation, of methods that have several; see `anytime`."""
    curves = {}
    for method in methods:
        groups = [g for g in results.groups_of(method) if g.task in tasks]
        length = max(len(run.figures.generations) for g in groups for run in g.runs)
        scores = []
        for g in groups:
            scores.append(np.array([run.best_so_far(length) for run in g.runs]))

        if length > 1:
            curves[method] = _Curve(np.arange(length, dtype=np.float64), scores)

    if not curves:
        return None

    return _draw_curves(results, curves, "generation", "by_generation")


def _draw_curves(
    results: Results,
    curves: dict[str, _Curve],
    against: str,
    name: str,
    step: Literal["post"] | None = None,
) -> FigurePage:
    """Draw means over tasks, with their intervals where these are known.

    Args:
        results: of the report.
        curves: by method.
        against: what ``x`` counts.
        name: of the figure's file.
        step: the rewards stay until the next place; None: straight lines with a mark at each place.
    """
    style = {"drawstyle": "steps-post"} if step else {"marker": "o"}

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
                ax.fill_between(*zip(*rows, strict=True), step=step, **band)

            means = [task.mean(axis=0) for task in curve.scores]
            ax.plot(curve.x, np.mean(means, axis=0), lw=1.8, **style, **look)

        ax.set(ylabel="mean best reward so far (0 to 1)", xlabel=against)
        ax.locator_params(axis="x", integer=True)
        _name_looks(figure, ax)

        return figure

    return FigurePage(name, f"Reward by {against}", paint)
