"""Bars, bands, axes and legends of a report's figures. Covered by `tests/plugins/results/report/test_figures.py`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from core.geometry import Array
from plugins.results.pages.figure import COLORS, wrapped
from plugins.results.report.methods import Group
from plugins.results.report.results import Results
from plugins.results.report.statistics import interval, mean_of_tasks

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PALE = 0.4


@dataclass(frozen=True)
class Look:
    """How a method is drawn; where colours run out, hatches and dashes follow."""

    label: str
    color: str
    hatch: str
    line: dict[str, Any]

    @classmethod
    def of(cls, results: Results, method: str) -> Look:
        i = results.methods.index(method)
        again, color = divmod(i, len(COLORS))
        line = {"color": COLORS[color], "marker": "osD^vP*X"[i % 8], "ms": 4.5, "lw": 1.8}
        hatch = ("", "///", "...", "xx")[again % 4]
        return cls(wrapped(method, 48), COLORS[color], hatch, line | {"ls": ("-", "--", "-.")[again % 3]})


def pale(color: str) -> tuple[str, float]:
    """A transparent colour, which is pale on a white page and dim on a dark one."""
    return color, _PALE


def line_handles(results: Results, methods: Sequence[str]) -> list[Any]:
    """Entries of a legend of lines."""
    from matplotlib.lines import Line2D

    return [Line2D([], [], label=look.label, **look.line) for look in (Look.of(results, m) for m in methods)]


def bar_handles(results: Results, methods: Sequence[str]) -> list[Any]:
    """Entries of a legend of bars."""
    from matplotlib.patches import Patch

    looks = [Look.of(results, method) for method in methods]
    return [Patch(facecolor=look.color, hatch=look.hatch, edgecolor="white", label=look.label) for look in looks]


def band(
    ax: Axes, results: Results, method: str, x: Sequence[float] | Array, rewards: Sequence[Sequence[Sequence[float]]]
) -> list[float]:
    """Draw the interval of the mean reward where it is known, and return the means.

    ``rewards`` holds for each place on the x axis the rewards of each task's runs.
    """
    spans = [interval(scores, "mean", results.how) for scores in rewards]
    known = [(place, *span) for place, span in zip(x, spans, strict=True) if span is not None]
    if known:
        places, low, high = zip(*known, strict=True)
        ax.fill_between(places, low, high, color=Look.of(results, method).color, alpha=0.18, lw=0)
    return [mean_of_tasks(scores) for scores in rewards]


def bar_width(tasks: Sequence[str], methods: Sequence[str]) -> float:
    """The width of a figure with a bar per task and method, in inches."""
    return max(6.4, 1.2 + 0.24 * len(tasks) * (len(methods) + 1))


def bar_position(tasks: Sequence[str], methods: Sequence[str], task: str, method: str) -> tuple[float, float]:
    """The middle of a bar along the axis, and the room that it has."""
    step = 0.8 / len(methods)
    return tasks.index(task) - 0.4 + step * (methods.index(method) + 0.5), step


def bars(
    ax: Axes,
    results: Results,
    tasks: Sequence[str],
    methods: Sequence[str],
    value: Callable[[Group], float | None],
    faint: bool = False,
) -> None:
    """Draw one bar per task and method that has a value, and a dash where a method was not run."""
    for method in methods:
        look = Look.of(results, method)
        for task in tasks:
            middle, step = bar_position(tasks, methods, task, method)
            group = results.get(task, method)
            height = None if group is None else value(group)
            if height is None or height < 0.005:
                mark = "–" if height is None else "0"
                ax.annotate(mark, (middle, 0), (0, 1), textcoords="offset points", ha="center", va="bottom", fontsize=7)
                continue
            fill = pale(look.color) if faint else look.color
            edge, line = "white" if look.hatch else look.color, 0 if faint else 0.5
            ax.bar(middle, height, 0.9 * step, color=fill, hatch=look.hatch, edgecolor=edge, linewidth=line)


def reward_axis(ax: Axes) -> None:
    ax.set(ylim=(0, 1.02), yticks=np.linspace(0, 1, 6), ylabel="reward (0 to 1)")
    ax.grid(axis="y")


def task_axis(ax: Axes, tasks: Sequence[str], per_task: int) -> None:
    """Name the tasks below their groups of ``per_task`` bars, aslant where there is little room."""
    letters = 0.24 * per_task * 12  # that fit under a group
    aslant = max(len(task) for task in tasks) > max(letters, 10)
    turn: dict[str, Any] = {"rotation": 35, "ha": "right"} if aslant else {"rotation": 0, "ha": "center"}
    ax.set_xticks(range(len(tasks)), [wrapped(task, 30) for task in tasks], **turn)
    ax.tick_params(axis="x", length=0)
    ax.set_xlim(-0.5, len(tasks) - 0.5)


def legend(figure: Figure, handles: Sequence[Any]) -> None:
    """A legend below the axes, in as many columns as fit."""
    longest = max(len(handle.get_label().partition("\n")[0]) for handle in handles)
    columns = int((figure.get_figwidth() - 0.4) / (0.5 + 0.078 * longest))
    figure.legend(handles=handles, loc="outside lower center", ncols=max(1, min(len(handles), columns)))
