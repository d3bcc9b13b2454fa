"""The figures of a report: bars by task, intervals over all tasks, curves, and tools side by side."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, get_args

import numpy as np

from core.geometry import Array
from plugins.results.pages.drawing import draw, painted
from plugins.results.pages.figure import INK, FigurePage, new_figure, slug, wrapped
from plugins.results.pages.tools import Tools, Winner
from plugins.results.report.learning_curves import POINTS, read_courses
from plugins.results.report.methods import Group
from plugins.results.report.plots import (
    Look,
    band,
    bar_handles,
    bar_position,
    bar_width,
    bars,
    legend,
    line_handles,
    pale,
    reward_axis,
    task_axis,
)
from plugins.results.report.results import Results
from plugins.results.report.statistics import Statistic, deviation, interquartile_mean, interval, mean, mean_of_tasks

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MAX_GENERATIONS = 5  # side by side in a row of tools

Curve = tuple[Sequence[float] | Array, list[list[list[float]]]]  # places on the x axis, and at each the runs' by task


def figure_pages(results: Results, tools: Tools) -> list[FigurePage]:
    """All figures that have something to show."""
    if not results.groups:
        return []
    tasks, methods = _comparable(results)
    pages = [
        rewards(results),
        deviations(results),
        intervals(results, tasks, methods),
        given(results, tools),
        anytime(results, tasks, methods),
        generations(results, tasks, methods),
        generations_by_task(results),
        gallery(results, tools),
        *(evolution(method, rows, i + 1) for i, (method, rows) in enumerate(tools.courses.items())),
    ]
    return [page for page in pages if page is not None]


def _comparable(results: Results) -> tuple[list[str], list[str]]:
    """All tasks and the methods that were run on all of them; failing that, the tasks that all methods share."""
    everywhere = [method for method in results.methods if len(results.of(method)) == len(results.tasks)]
    if everywhere:
        return results.tasks, everywhere
    shared = results.shared(*results.methods)
    return shared, results.methods if shared else []


# --- bars -------------------------------------------------------------------------------------------------------


def _runs(groups: Sequence[Group]) -> str:
    counts = sorted({len(g.runs) for g in groups})
    return f"{' to '.join(map(str, dict.fromkeys([counts[0], counts[-1]])))} run{'s' if counts[-1] > 1 else ''} per bar"


def rewards(results: Results) -> FigurePage:
    """Grouped bars: average and best."""

    def paint() -> Figure:
        from matplotlib.patches import Patch

        tasks, methods = results.tasks, results.methods
        figure = new_figure(bar_width(tasks, methods), 4.0)
        _rewards(figure.subplots(), results, tasks, methods)
        shades = [Patch(color="0.35", label="average over runs"), Patch(color=pale("0.35"), label="best run")]
        legend(figure, [*bar_handles(results, methods), *shades])
        return figure

    caption = (
        f"Full colour: the average over runs of each run's best reward; faint: the best run. "
        f"{_runs(results.groups)}. A dash: the method was not run on the task; 0: below 0.005."
    )
    return FigurePage("rewards", "Reward by task and method", caption, paint)


def _rewards(ax: Axes, results: Results, tasks: Sequence[str], methods: Sequence[str]) -> None:
    bars(ax, results, tasks, methods, lambda g: g.best.best.reward, faint=True)
    bars(ax, results, tasks, methods, lambda g: mean(g.rewards))
    reward_axis(ax)
    task_axis(ax, tasks, len(methods))


def deviations(results: Results) -> FigurePage:
    """Bars of the average with whiskers, and every run as a dot."""

    def paint() -> Figure:
        tasks, methods = results.tasks, results.methods
        figure = new_figure(bar_width(tasks, methods), 4.0)
        ax = figure.subplots()
        bars(ax, results, tasks, methods, lambda g: mean(g.rewards), faint=True)
        for g in results.groups:
            place, step = bar_position(tasks, methods, g.task, g.method)
            middle, one = mean(g.rewards), deviation(g.rewards)
            if one is not None:
                whiskers = [[min(one, middle)], [min(one, max(0.0, 1.0 - middle))]]
                ax.errorbar(place, middle, whiskers, color=INK, capsize=2.5, lw=1)
            x = place + step * (np.linspace(-0.25, 0.25, len(g.rewards)) if len(g.rewards) > 1 else np.zeros(1))
            color = Look.of(results, g.method).color
            ax.plot(x, g.rewards, "o", ms=3, mfc=color, mec=INK, mew=0.4, clip_on=False)
        reward_axis(ax)
        task_axis(ax, tasks, len(methods))
        legend(figure, bar_handles(results, methods))
        return figure

    caption = (
        "Bars: the average over runs of each run's best reward; whiskers: one sample standard deviation to each side, "
        f"clipped to [0, 1]; dots: the runs. {_runs(results.groups)}."
    )
    return FigurePage("deviations", "Average reward and its standard deviation", caption, paint)


def given(results: Results, tools: Tools) -> FigurePage | None:
    """Given tools against designed ones: rewards and distances."""
    tasks = [task for task in results.tasks if any(results.get(task, method) for method in tools.given)]
    methods = [method for method in results.methods if method not in tools.bare and results.of(method, tasks)]
    if not tasks or not set(methods) - tools.given:
        return None

    def paint() -> Figure:
        figure = new_figure(1.24 * bar_width(tasks, methods), 3.8)
        left, right = figure.subplots(1, 2)
        _rewards(left, results, tasks, methods)
        left.set_title("reward: average, and faintly the best")
        bars(right, results, tasks, methods, lambda g: g.best.best.distance_m)
        task_axis(right, tasks, len(methods))
        right.set(title="distance", ylabel="distance of the best plan (m)")
        right.grid(axis="y")
        legend(figure, bar_handles(results, methods))
        return figure

    caption = (
        f"Given tools: {', '.join(sorted(tools.given))}. Distance: metres that the end-effector's origin travels in "
        "the best run's best plan."
    )
    return FigurePage("given_tools", "Given tools and designed ones", caption, paint)


def intervals(results: Results, tasks: list[str], methods: list[str]) -> FigurePage | None:
    """Mean and interquartile mean with their intervals, of the methods that were run on the same tasks."""
    if not methods:
        return None

    def paint() -> Figure:
        figure = new_figure(7.5, 1.4 + 0.45 * len(methods))
        axes = figure.subplots(1, 2, sharey=True, sharex=True)
        for ax, statistic in zip(axes, get_args(Statistic), strict=True):
            for y, method in enumerate(methods):
                scores, color = [g.rewards for g in results.of(method, tasks)], Look.of(results, method).color
                middle = mean_of_tasks(scores) if statistic == "mean" else interquartile_mean(np.concatenate(scores))
                span = interval(scores, statistic, results.how)
                if span is not None:
                    ax.barh(y, span[1] - span[0], 0.5, left=span[0], color=pale(color))
                ax.plot([middle, middle], [y - 0.3, y + 0.3], color=color, lw=2.5)
            ax.set(title=statistic, xlabel="reward (0 to 1)")
            ax.use_sticky_edges = False
            ax.grid(axis="x")
        axes[0].set_yticks(range(len(methods)), [wrapped(method, 36) for method in methods])
        axes[0].set_ylim(len(methods) - 0.5, -0.5)
        return figure

    missing = [method for method in results.methods if method not in methods]
    caption = (
        f"Lines: the mean over tasks of each task's average, and the interquartile mean of all runs. Bands: "
        f"{100 * results.how.confidence:g} % stratified bootstrap intervals ({results.how.resamples} samples); none "
        f"where a task has one run only. Tasks: {', '.join(tasks)}."
        + (f" Not run on all of these tasks, and left out: {', '.join(missing)}." if missing else "")
    )
    return FigurePage("intervals", "Methods over all tasks, with intervals", caption, paint)


# --- curves -----------------------------------------------------------------------------------------------------


def _curves(results: Results, name: str, what: str, caption: str, curves: dict[str, Curve], length: int) -> FigurePage:
    """The mean reward of each method along ``what``; of curves by generation (``length``) the last reward goes on."""

    def paint() -> Figure:
        figure = new_figure(6.4, 4.0)
        ax = figure.subplots()
        for method, (x, scores) in curves.items():
            middle = band(ax, results, method, x, scores)
            if length:
                _course(ax, results, method, middle, length)
            else:
                ax.plot(x, middle, **Look.of(results, method).line | {"marker": None})
        ax.grid(axis="y", visible=True)
        ax.set(ylabel="mean best reward so far (0 to 1)", xlabel=what)
        legend(figure, line_handles(results, list(curves)))
        return figure

    return FigurePage(name, f"Reward by {what}", caption, paint)


def anytime(results: Results, tasks: list[str], methods: list[str]) -> FigurePage | None:
    """The mean best reward so far against rollouts, over the tasks that the methods share."""
    courses = {method: [read_courses(g.runs) for g in results.of(method, tasks)] for method in methods}
    ends = {
        method: max((course.rollouts[-1] for task in by_task for course in task), default=0.0)
        for method, by_task in courses.items()
    }
    if max(ends.values(), default=0.0) < 2 or not all(task for by_task in courses.values() for task in by_task):
        return None
    curves: dict[str, Curve] = {}
    for method, by_task in courses.items():
        x = np.linspace(0, ends[method], POINTS)
        scores = [np.array([course.at(x) for course in task]) for task in by_task]
        curves[method] = x, [[task[:, i].tolist() for task in scores] for i in range(POINTS)]
    caption = (
        f"The best reward after each number of rollouts, averaged over runs and then over {len(tasks)} tasks; bands: "
        f"{100 * results.how.confidence:g} % stratified bootstrap intervals. A run that ended early keeps its last."
    )
    return _curves(results, "anytime", "rollouts", caption, curves, 0)


def generations(results: Results, tasks: list[str], methods: list[str]) -> FigurePage | None:
    """The mean best reward by generation, over the tasks."""
    curves: dict[str, Curve] = {}
    for method in methods:
        groups = results.of(method, tasks)
        x = range(_longest(groups))
        curves[method] = x, [[[run.course(len(x))[i] for run in g.runs] for g in groups] for i in x]
    length = max((len(x) for x, _ in curves.values()), default=0)
    if length < 2:
        return None
    caption = (
        f"The best reward up to and with each generation, averaged over runs and then over {len(tasks)} tasks; bands: "
        f"{100 * results.how.confidence:g} % stratified bootstrap intervals. A run that stopped early keeps its last; "
        "dotted: a method that has no more generations. The axis need not start at 0."
    )
    return _curves(results, "generations", "generation", caption, curves, length)


def _longest(groups: Iterable[Group]) -> int:
    """The most generations of any run."""
    return max((len(run.best_so_far) for g in groups for run in g.runs), default=0)


def _course(ax: Axes, results: Results, method: str, rewards: Sequence[float], length: int) -> None:
    """Draw rewards by generation, and their last dotted as far as the other methods go."""
    from matplotlib.ticker import MaxNLocator

    look = Look.of(results, method)
    ax.plot(rewards, **look.line)
    if len(rewards) < length:
        ax.plot([len(rewards) - 1, length - 1], [rewards[-1]] * 2, ":", color=look.color, lw=1)
    ax.grid(axis="y", visible=True)
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))


def generations_by_task(results: Results) -> FigurePage | None:
    """The best reward by generation of each run, a panel per task."""
    longest = _longest(results.groups)
    if len(results.tasks) < 2 or longest < 2:
        return None

    def paint() -> Figure:
        tasks = results.tasks
        columns = min(4, len(tasks))
        rows = math.ceil(len(tasks) / columns)
        figure = new_figure(max(6.4, 2.6 * columns), 1.3 + 2.0 * rows)
        axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
        for i, (ax, task) in enumerate(zip(axes, tasks, strict=False)):
            for g in (g for g in results.groups if g.task == task):
                for run in g.runs:
                    ax.plot(run.best_so_far, color=Look.of(results, g.method).color, lw=0.6, alpha=0.45)
                courses = [run.course(_longest([g])) for run in g.runs]
                _course(ax, results, g.method, np.mean(courses, axis=0).tolist(), longest)
            ax.set(title=wrapped(task, 26), ylim=(-0.02, 1.04))
            if i >= len(tasks) - columns:
                ax.set_xlabel("generation")
                ax.tick_params(labelbottom=True)
        for ax in axes[len(tasks) :]:
            ax.set_visible(False)
        figure.supylabel("best reward so far (0 to 1)", fontsize=9)
        legend(figure, line_handles(results, results.methods))
        return figure

    caption = (
        "Thick: the average over runs of the best reward up to and with each generation; thin: each run; dotted: a "
        "method that has no more generations."
    )
    return FigurePage("generations_by_task", "Reward by generation, task by task", caption, paint)


# --- tools ------------------------------------------------------------------------------------------------------


def gallery(results: Results, tools: Tools) -> FigurePage | None:
    """The best tools side by side: a row per task and a column per method, or all in rows of four of one method."""
    methods = [method for method in results.methods if any(designed_by == method for _, designed_by in tools.best)]
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
