"""The figures of a report. Colours are M. Okabe and K. Ito's, which the colour-blind can tell apart; beyond those,
hatching tells.
"""

from __future__ import annotations

import io
import math
import textwrap
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from core.report.drawing import draw, painted
from core.report.methods import Group
from core.report.results import Results
from core.report.statistics import Statistic, deviation, interquartile_mean, interval, mean, mean_of_tasks
from core.report.tables import course, number
from core.report.tools import Tools, Winner, size
from core.text import clean

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLORS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#F0E442")
HATCHES = ("", "///", "...", "xx")
INK = "#1b1f24"
FORMATS = ("png", "svg")
MAX_GENERATIONS = 5  # side by side in a row of tools

_PALE = 0.4
_STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "text.parse_math": False,  # names are text, dollars and all
    "text.color": INK,
    "axes.facecolor": "none",
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.titlesize": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "xtick.color": INK,
    "ytick.color": INK,
    "grid.color": INK,
    "grid.alpha": 0.15,
    "figure.titlesize": 12,
    "legend.frameon": False,
    "svg.fonttype": "path",  # looks the same where the font is missing
}


@dataclass(frozen=True, eq=False)
class Picture:
    """A figure: ``name`` is its file's, ``caption`` says what is seen and how it was made."""

    name: str
    title: str
    caption: str
    paint: Callable[[], Figure] = field(repr=False)

    def render(self, format_: str, dpi: int = 160, ground: str = "white", titled: bool = True) -> bytes:
        """The figure as a file of one of `FORMATS`, the same bytes each time; not ``titled`` where its title stands
        above it.
        """
        buffer = io.BytesIO()
        with _style(self.name):
            metadata = {"Software": None} if format_ == "png" else {"Date": None, "Creator": None}
            figure = self.paint()
            if not titled:
                figure.suptitle("").set_in_layout(False)
            figure.savefig(buffer, format=format_, dpi=dpi, facecolor=ground, metadata=metadata)
        return buffer.getvalue()


@contextmanager
def _style(salt: str) -> Iterator[None]:
    import matplotlib

    with matplotlib.rc_context(_STYLE | {"svg.hashsalt": salt}), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing")  # a name in a script that the font lacks
        yield


def pictures(results: Results, tools: Tools) -> list[Picture]:
    """All that there is something to show in."""
    made = [
        rewards(results),
        deviations(results),
        intervals(results),
        given(results, tools),
        generations(results),
        generations_by_task(results),
        gallery(results, tools),
        *(evolution(method, rows, i + 1) for i, (method, rows) in enumerate(tools.courses.items())),
    ]
    return [picture for picture in made if picture is not None]


# --- pieces -----------------------------------------------------------------------------------------------------


def _figure(width: float, height: float) -> Figure:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def _color(results: Results, method: str) -> str:
    return COLORS[results.methods.index(method) % len(COLORS)]


def _hatch(results: Results, method: str) -> str:
    return HATCHES[results.methods.index(method) // len(COLORS) % len(HATCHES)]


def _pale(color: str) -> tuple[str, float]:
    """See-through, so that it is pale on a white page and dim on a dark one."""
    return color, _PALE


def _wrapped(text: str, width: int, lines: int = 3) -> str:
    return "\n".join(textwrap.wrap(clean(text, 300), width, max_lines=lines, placeholder=" …") or [""])


def _reward_axis(ax: Axes) -> None:
    ax.set_ylim(0, 1.02)
    ax.set_yticks(np.linspace(0, 1, 6))
    ax.set_ylabel("reward (0 to 1)")
    ax.grid(axis="y")


def _task_axis(ax: Axes, tasks: Sequence[str], per_task: int) -> None:
    ax.set_xticks(range(len(tasks)))
    room = 0.24 * per_task * 12  # letters that fit under a group
    steep = max(len(task) for task in tasks) > max(room, 10)
    ax.set_xticklabels(
        [_wrapped(task, 30) for task in tasks], rotation=35 if steep else 0, ha="right" if steep else "center"
    )
    ax.tick_params(axis="x", length=0)
    ax.set_xlim(-0.5, len(tasks) - 0.5)


def _width(tasks: int, methods: int) -> float:
    return max(6.4, 1.2 + 0.24 * tasks * (methods + 1))


def _legend(figure: Figure, handles: Sequence[Any], width: float) -> None:
    longest = max(len(handle.get_label().partition("\n")[0]) for handle in handles)
    columns = max(1, min(len(handles), int((width - 0.4) / (0.5 + 0.078 * longest))))
    figure.legend(handles=handles, loc="outside lower center", ncols=columns)


def _bars(
    ax: Axes,
    results: Results,
    tasks: Sequence[str],
    methods: Sequence[str],
    value: Callable[[Group], float | None],
    pale: bool = False,
) -> None:
    """One bar per task and method, where there is a value; a dash where a method was not run."""
    step = 0.8 / len(methods)
    for i, method in enumerate(methods):
        for x, task in enumerate(tasks):
            at = x - 0.4 + step * (i + 0.5)
            found = results.get(task, method)
            height = None if found is None else value(found)
            if height is None or height < 0.005:
                said = "–" if height is None else "0"
                ax.annotate(said, (at, 0), (0, 1), textcoords="offset points", ha="center", va="bottom", fontsize=7)
                continue
            color = _color(results, method)
            ax.bar(
                at,
                height,
                0.9 * step,
                color=_pale(color) if pale else color,
                hatch=_hatch(results, method),
                edgecolor="white" if _hatch(results, method) else color,
                linewidth=0 if pale else 0.5,
            )


def _method_handles(results: Results, methods: Sequence[str]) -> list[Any]:
    from matplotlib.patches import Patch

    return [
        Patch(
            facecolor=_color(results, method),
            hatch=_hatch(results, method),
            edgecolor="white",
            label=_wrapped(method, 48),
        )
        for method in methods
    ]


def _runs(groups: Sequence[Group]) -> str:
    counts = sorted({len(g.runs) for g in groups})
    span = str(counts[0]) if len(counts) == 1 else f"{counts[0]} to {counts[-1]}"
    return f"{span} run{'s' if counts[-1] > 1 else ''}"


# --- figures ----------------------------------------------------------------------------------------------------


def rewards(results: Results) -> Picture | None:
    """Grouped bars: average and best."""
    if not results.groups:
        return None

    def paint() -> Figure:
        from matplotlib.patches import Patch

        width = _width(len(results.tasks), len(results.methods))
        figure = _figure(width, 4.0)
        ax = figure.subplots()
        _bars(ax, results, results.tasks, results.methods, lambda g: g.best.best.reward, pale=True)
        _bars(ax, results, results.tasks, results.methods, lambda g: mean(g.rewards))
        _reward_axis(ax)
        _task_axis(ax, results.tasks, len(results.methods))
        shades = [Patch(color="0.35", label="average over runs"), Patch(color=_pale("0.35"), label="best run")]
        _legend(figure, [*_method_handles(results, results.methods), *shades], width)
        figure.suptitle("Reward by task and method")
        return figure

    caption = (
        f"Full colour: the average over runs of each run's best reward; faint: the best run. "
        f"{_runs(results.groups)} per bar. A dash: the method was not run on the task; 0: below 0.005."
    )
    return Picture("rewards", "Reward by task and method", caption, paint)


def deviations(results: Results) -> Picture | None:
    """Bars of the average with whiskers, and every run as a dot."""
    if not results.groups:
        return None

    def paint() -> Figure:
        tasks, methods = results.tasks, results.methods
        width = _width(len(tasks), len(methods))
        figure = _figure(width, 4.0)
        ax = figure.subplots()
        _bars(ax, results, tasks, methods, lambda g: mean(g.rewards), pale=True)
        step = 0.8 / len(methods)
        for g in results.groups:
            at = tasks.index(g.task) - 0.4 + step * (methods.index(g.method) + 0.5)
            middle, spread = mean(g.rewards), deviation(g.rewards)
            if spread is not None:
                low, high = max(0.0, middle - spread), min(1.0, middle + spread)
                ax.errorbar(
                    at, middle, [[max(0.0, middle - low)], [max(0.0, high - middle)]], color=INK, capsize=2.5, lw=1
                )
            apart = np.linspace(-0.25, 0.25, len(g.rewards)) if len(g.rewards) > 1 else np.zeros(1)
            ax.plot(
                at + apart * step, g.rewards, "o", ms=3, mfc=_color(results, g.method), mec=INK, mew=0.4, clip_on=False
            )
        _reward_axis(ax)
        _task_axis(ax, tasks, len(methods))
        _legend(figure, _method_handles(results, methods), width)
        figure.suptitle("Average reward and its standard deviation")
        return figure

    caption = (
        "Bars: the average over runs of each run's best reward; whiskers: one sample standard deviation to each side, "
        f"clipped to [0, 1]; dots: the runs. {_runs(results.groups)} per bar."
    )
    return Picture("deviations", "Average reward and its standard deviation", caption, paint)


def intervals(results: Results) -> Picture | None:
    """Mean and interquartile mean with their intervals, of the methods that were run on the same tasks."""
    tasks, methods = _comparable(results)
    if not methods:
        return None

    def paint() -> Figure:
        figure = _figure(7.5, 1.4 + 0.45 * len(methods))
        axes = figure.subplots(1, 2, sharey=True, sharex=True)
        for ax, statistic in zip(axes, get_args(Statistic), strict=True):
            for y, method in enumerate(methods):
                scores = [g.rewards for g in results.of(method, tasks)]
                middle = (
                    mean_of_tasks(scores) if statistic == "mean" else interquartile_mean([x for s in scores for x in s])
                )
                span = interval(scores, statistic, results.how)
                if span is not None:
                    ax.barh(y, span[1] - span[0], 0.5, left=span[0], color=_pale(_color(results, method)))
                ax.plot([middle, middle], [y - 0.3, y + 0.3], color=_color(results, method), lw=2.5)
            ax.set_title(statistic)
            ax.set_xlabel("reward (0 to 1)")
            ax.use_sticky_edges = False
            ax.grid(axis="x")
        axes[0].set_yticks(range(len(methods)), [_wrapped(method, 36) for method in methods])
        axes[0].set_ylim(len(methods) - 0.5, -0.5)
        figure.suptitle(f"Over {len(tasks)} task{'s' if len(tasks) > 1 else ''}, all runs")
        return figure

    missing = [method for method in results.methods if method not in methods]
    caption = (
        f"Lines: the mean over tasks of each task's average, and the interquartile mean of all runs. Bands: "
        f"{100 * results.how.confidence:g} % stratified bootstrap intervals ({results.how.resamples} samples); none "
        f"where a task has one run only. Tasks: {', '.join(tasks)}."
        + (f" Not on all of these tasks, and so not here: {', '.join(missing)}." if missing else "")
    )
    return Picture("intervals", "Methods over all tasks, with intervals", caption, paint)


def _comparable(results: Results) -> tuple[list[str], list[str]]:
    """The tasks that any method has, and the methods that have them all; or what all methods share."""
    everywhere = [method for method in results.methods if len(results.of(method)) == len(results.tasks)]
    if everywhere:
        return results.tasks, everywhere
    shared = results.shared(*results.methods)
    return shared, results.methods if shared else []


def given(results: Results, tools: Tools) -> Picture | None:
    """Given tools against designed ones: rewards and distances."""
    tasks = [task for task in results.tasks if any(results.get(task, method) for method in tools.given)]
    methods = [method for method in results.methods if method not in tools.bare]
    methods = [method for method in methods if results.of(method, tasks)]
    if not tasks or not set(methods) - tools.given:
        return None

    def paint() -> Figure:
        width = 2 * _width(len(tasks), len(methods)) * 0.62
        figure = _figure(width, 3.8)
        left, right = figure.subplots(1, 2)
        _bars(left, results, tasks, methods, lambda g: g.best.best.reward, pale=True)
        _bars(left, results, tasks, methods, lambda g: mean(g.rewards))
        _reward_axis(left)
        _bars(right, results, tasks, methods, lambda g: g.best.best.distance_m)
        right.set_ylabel("distance of the best plan (m)")
        right.grid(axis="y")
        for ax, title in ((left, "reward: average, and faintly the best"), (right, "distance")):
            ax.set_title(title)
            _task_axis(ax, tasks, len(methods))
        _legend(figure, _method_handles(results, methods), width)
        figure.suptitle("Given tools and designed ones")
        return figure

    caption = (
        f"Given tools: {', '.join(sorted(tools.given))}. Distance: metres that the end-effector's origin travels in "
        "the best run's best plan."
    )
    return Picture("given_tools", "Given tools and designed ones", caption, paint)


def generations(results: Results) -> Picture | None:
    """The mean best reward by generation, over the tasks."""
    tasks, methods = _comparable(results)
    length = _longest(results, methods, tasks)
    if length < 2:
        return None

    def paint() -> Figure:
        from matplotlib.ticker import MaxNLocator

        figure = _figure(6.4, 4.0)
        ax = figure.subplots()
        for method in methods:
            groups, color = results.of(method, tasks), _color(results, method)
            own = max(len(run.best_so_far) for g in groups for run in g.runs)
            scores = [[[course(run, own)[i] for run in g.runs] for g in groups] for i in range(own)]
            line = [mean_of_tasks(of) for of in scores]
            spans = [interval(of, "mean", results.how) for of in scores]
            known = [(i, *span) for i, span in enumerate(spans) if span is not None]
            if known:
                x, low, high = zip(*known, strict=True)
                ax.fill_between(x, low, high, color=color, alpha=0.18, lw=0)
            style = _line(results, method)
            ax.plot(range(own), line, color=color, label=_wrapped(method, 48), **style)
            if own < length:  # nothing follows: its last, as far as the others go
                ax.plot([own - 1, length - 1], [line[-1]] * 2, ":", color=color, lw=1)
        ax.set_ylabel("mean best reward so far (0 to 1)")
        ax.set_xlabel("generation")
        ax.grid(axis="y")
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
        _legend(figure, ax.get_legend_handles_labels()[0], 6.4)
        figure.suptitle("Reward by generation")
        return figure

    caption = (
        f"The best reward up to and with each generation, averaged over runs and then over {len(tasks)} tasks; bands: "
        f"{100 * results.how.confidence:g} % stratified bootstrap intervals. A run that stopped early keeps its last; "
        "dotted: a method that has no more generations. The axis need not start at 0."
    )
    return Picture("generations", "Reward by generation", caption, paint)


def _longest(results: Results, methods: Sequence[str], tasks: Sequence[str]) -> int:
    groups = [g for method in methods for g in results.of(method, tasks)]
    return max((len(run.best_so_far) for g in groups for run in g.runs), default=0)


def _line(results: Results, method: str) -> dict[str, Any]:
    """Line and marker of a method, so that colour is not all that tells."""
    i = results.methods.index(method)
    return {"marker": "osD^vP*X"[i % 8], "ms": 4.5, "lw": 1.8, "ls": ("-", "--", "-.")[i // len(COLORS) % 3]}


def generations_by_task(results: Results) -> Picture | None:
    """The same, task by task, with each run."""
    longest = _longest(results, results.methods, results.tasks)
    if len(results.tasks) < 2 or longest < 2:
        return None

    def paint() -> Figure:
        from matplotlib.lines import Line2D
        from matplotlib.ticker import MaxNLocator

        columns = min(4, len(results.tasks))
        rows = math.ceil(len(results.tasks) / columns)
        width = max(6.4, 2.6 * columns)
        figure = _figure(width, 1.3 + 2.0 * rows)
        axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
        for ax, task in zip(axes, results.tasks, strict=False):
            for g in (g for g in results.groups if g.task == task):
                color = _color(results, g.method)
                for run in g.runs:
                    ax.plot(run.best_so_far, color=color, lw=0.6, alpha=0.45)
                length = max(len(run.best_so_far) for run in g.runs)
                middle = [mean([course(run, length)[i] for run in g.runs]) for i in range(length)]
                ax.plot(middle, color=color, **_line(results, g.method))
                if length < longest:
                    ax.plot([length - 1, longest - 1], [middle[-1]] * 2, ":", color=color, lw=1)
            ax.set_title(_wrapped(task, 26))
            ax.set_ylim(-0.02, 1.04)
            ax.grid(axis="y")
            ax.xaxis.set_major_locator(MaxNLocator(integer=True))
        for ax in axes[len(results.tasks) :]:
            ax.set_visible(False)
        for ax in axes[max(0, len(results.tasks) - columns) : len(results.tasks)]:
            ax.set_xlabel("generation")
            ax.tick_params(labelbottom=True)
        figure.supylabel("best reward so far (0 to 1)", fontsize=9)
        handles = [
            Line2D([], [], color=_color(results, method), label=_wrapped(method, 48), **_line(results, method))
            for method in results.methods
        ]
        _legend(figure, handles, width)
        figure.suptitle("Reward by generation, task by task")
        return figure

    caption = (
        "Thick: the average over runs of the best reward up to and with each generation; thin: each run; dotted: a "
        "method that has no more generations."
    )
    return Picture("generations_by_task", "Reward by generation, task by task", caption, paint)


def gallery(results: Results, tools: Tools) -> Picture | None:
    """The best tools side by side."""
    methods = [method for method in results.methods if any(of == method for _, of in tools.best)]
    if not methods:
        return None
    tasks = [task for task in results.tasks if any((task, method) in tools.best for method in methods)]
    if len(methods) == 1:
        cells: list[tuple[str, Winner | None]] = [(task, tools.best[task, methods[0]]) for task in tasks]
        columns = min(4, len(cells))
        grid = [cells[i : i + columns] for i in range(0, len(cells), columns)]
        heads: list[str] = []
    else:
        grid = [[(task, tools.best.get((task, method))) for method in methods] for task in tasks]
        columns, heads = len(methods), methods

    def paint() -> Figure:
        return _tools(grid, heads, "The best tool of each task" + (" and method" if heads else ""))

    caption = (
        "The tool of the best run's best candidate, as the arm holds it at home: forward is to the right and toward "
        "the reader, grey is the flange or the fingers. Each is drawn to its own scale; the size is its extent along "
        "x, y and z."
    )
    return Picture("gallery", "The best tools", caption, paint)


def evolution(method: str, rows: dict[str, list[Winner | None]], place: int) -> Picture:
    """The best tool of each generation: before, and after."""
    number_ = max(len(row) for row in rows.values())
    chosen = sorted({round(i) for i in np.linspace(0, number_ - 1, min(number_, MAX_GENERATIONS))})
    grid = [[(task, row[i] if i < len(row) else None) for i in chosen] for task, row in rows.items()]

    def paint() -> Figure:
        heads = [f"generation {i}" for i in chosen]
        return _tools(grid, heads, f"Tools over the generations: {_wrapped(method, 60)}")

    caption = (
        f"The best tool of each generation of the best run of each task with {method}: generation 0 is before "
        "evolution, the last one after it. Each is drawn to its own scale."
    )
    return Picture(f"evolution_{place}_{_slug(method)}", f"Before and after evolution: {method}", caption, paint)


def _slug(text: str) -> str:
    letters = "".join(c if c.isascii() and c.isalnum() else "_" for c in text)
    return "_".join(part for part in letters.split("_") if part)[:60] or "method"


def _tools(grid: Sequence[Sequence[tuple[str, Winner | None]]], heads: Sequence[str], title: str) -> Figure:
    columns = max(len(row) for row in grid)
    width = max(5.0, 2.3 * columns)
    figure = _figure(width, 0.7 + 2.15 * len(grid))
    axes = figure.subplots(len(grid), columns, squeeze=False)
    for ax in axes.ravel():
        ax.set(xticks=[], yticks=[])
        ax.spines[:].set_visible(False)
    for r, row in enumerate(grid):
        for c, (task, winner) in enumerate(row):
            ax = axes[r][c]
            if not heads:
                ax.set_title(_wrapped(task, 28), fontsize=9, fontweight="bold")
            elif r == 0:
                ax.set_title(_wrapped(heads[c], 26), fontsize=9, fontweight="bold")
            if heads and c == 0:
                ax.set_ylabel(_wrapped(task, 24), fontsize=9, fontweight="bold")
            if winner is None:
                ax.text(0.5, 0.5, "–", ha="center", va="center", transform=ax.transAxes)
                continue
            ax.set_facecolor("white")  # tools may be dark
            ax.imshow(draw(painted(winner.tool), 300, 225))
            ax.set_xlabel(f"{_wrapped(winner.name, 32, 2)}\n{told(winner)}", fontsize=7.5)
    figure.suptitle(title)
    return figure


def told(winner: Winner) -> str:
    """Reward and size in a line."""
    return f"reward {number(winner.reward, 3)}, {size(winner.tool)}"
