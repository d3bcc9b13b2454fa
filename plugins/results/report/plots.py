"""Style, axes, bars and legends of a report's figures. Covered by `tests/plugins/results/report/test_figures.py`.

Colours are M. Okabe and K. Ito's, which the colour-blind can distinguish; hatches and line styles follow when they run
out.
"""

from __future__ import annotations

import io
import textwrap
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from core.geometry import Array
from core.support.text import clean
from plugins.results.report.methods import Group
from plugins.results.report.results import Results
from plugins.results.report.statistics import interval, mean_of_tasks

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLORS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#F0E442")
HATCHES = ("", "///", "...", "xx")
INK = "#1b1f24"
FORMATS = ("png", "svg")

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
    """A figure: ``name`` is its file's, ``caption`` says what it shows and how it was made."""

    name: str
    title: str
    caption: str
    paint: Callable[[], Figure] = field(repr=False)

    def render(self, format_: str, ground: str = "white", titled: bool = True) -> bytes:
        """The figure as a file of one of `FORMATS`, or PDF, the same bytes each time; untitled unless ``titled``."""
        import matplotlib

        buffer = io.BytesIO()
        undated = {"png": {"Software": None}, "pdf": {"CreationDate": None}}
        metadata = undated.get(format_, {"Date": None, "Creator": None})
        with matplotlib.rc_context(_STYLE | {"svg.hashsalt": self.name}), warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Glyph .* missing")  # a name in a script that the font lacks
            figure = self.paint()
            if titled:
                figure.suptitle(wrapped(self.title, 80))
            figure.savefig(buffer, format=format_, dpi=160, facecolor=ground, metadata=metadata)
        return buffer.getvalue()


def new_figure(width: float, height: float) -> Figure:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def wrapped(text: str, width: int, lines: int = 3) -> str:
    return "\n".join(textwrap.wrap(clean(text, 300), width, max_lines=lines, placeholder=" …") or [""])


def pale(color: str) -> tuple[str, float]:
    """A transparent colour, which is pale on a white page and dim on a dark one."""
    return color, _PALE


def color_of(results: Results, method: str) -> str:
    return COLORS[results.methods.index(method) % len(COLORS)]


def line_style(results: Results, method: str) -> dict[str, Any]:
    """Colour, marker and line style of a method."""
    i = results.methods.index(method)
    dashes = ("-", "--", "-.")[i // len(COLORS) % 3]
    return {"color": color_of(results, method), "marker": "osD^vP*X"[i % 8], "ms": 4.5, "lw": 1.8, "ls": dashes}


def line_handles(results: Results, methods: Sequence[str]) -> list[Any]:
    from matplotlib.lines import Line2D

    return [Line2D([], [], label=wrapped(method, 48), **line_style(results, method)) for method in methods]


def band(
    ax: Axes, results: Results, method: str, x: Sequence[float] | Array, rewards: Sequence[Sequence[Sequence[float]]]
) -> list[float]:
    """Draw the interval of the mean reward where it is known, and return the means.

    ``rewards`` holds for each place on the x axis the rewards of each task's runs.
    """
    spans = [interval(of, "mean", results.how) for of in rewards]
    known = [(at, *span) for at, span in zip(x, spans, strict=True) if span is not None]
    if known:
        at, low, high = zip(*known, strict=True)
        ax.fill_between(at, low, high, color=color_of(results, method), alpha=0.18, lw=0)
    return [mean_of_tasks(of) for of in rewards]


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
        color, hatch = color_of(results, method), _hatch(results, method)
        for task in tasks:
            at, step = bar_position(tasks, methods, task, method)
            group = results.get(task, method)
            height = None if group is None else value(group)
            if height is None or height < 0.005:
                mark = "–" if height is None else "0"
                ax.annotate(mark, (at, 0), (0, 1), textcoords="offset points", ha="center", va="bottom", fontsize=7)
                continue
            fill = pale(color) if faint else color
            edge, line = "white" if hatch else color, 0 if faint else 0.5
            ax.bar(at, height, 0.9 * step, color=fill, hatch=hatch, edgecolor=edge, linewidth=line)


def _hatch(results: Results, method: str) -> str:
    return HATCHES[results.methods.index(method) // len(COLORS) % len(HATCHES)]


def reward_axis(ax: Axes) -> None:
    ax.set_ylim(0, 1.02)
    ax.set_yticks(np.linspace(0, 1, 6))
    ax.set_ylabel("reward (0 to 1)")
    ax.grid(axis="y")


def task_axis(ax: Axes, tasks: Sequence[str], per_task: int) -> None:
    """Name the tasks below their groups of ``per_task`` bars, aslant where there is little room."""
    letters = 0.24 * per_task * 12  # that fit under a group
    aslant = max(len(task) for task in tasks) > max(letters, 10)
    ax.set_xticks(range(len(tasks)), [wrapped(task, 30) for task in tasks])
    ax.tick_params(axis="x", length=0, rotation=35 if aslant else 0)
    for label in ax.get_xticklabels():
        label.set_horizontalalignment("right" if aslant else "center")
    ax.set_xlim(-0.5, len(tasks) - 0.5)


def method_handles(results: Results, methods: Sequence[str]) -> list[Any]:
    """Entries of a legend of bars."""
    from matplotlib.patches import Patch

    looks = ((wrapped(m, 48), color_of(results, m), _hatch(results, m)) for m in methods)
    return [Patch(facecolor=color, hatch=hatch, edgecolor="white", label=label) for label, color, hatch in looks]


def legend(figure: Figure, handles: Sequence[Any]) -> None:
    """A legend below the axes, in as many columns as fit."""
    longest = max(len(handle.get_label().partition("\n")[0]) for handle in handles)
    columns = int((figure.get_figwidth() - 0.4) / (0.5 + 0.078 * longest))
    figure.legend(handles=handles, loc="outside lower center", ncols=max(1, min(len(handles), columns)))
