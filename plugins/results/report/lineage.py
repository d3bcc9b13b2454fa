"""Lineage: the best designs of each generation, what they derive from, and the model's words about them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from core.design import ranked
from core.store.reader import Key, StoredDesign, StoredEvaluation
from core.support.text import number
from plugins.results.pages.figure import COLORS, INK, FigurePage, new_figure
from plugins.results.pages.formats import Cell, Table, columns
from plugins.results.pages.runs import FinishedRun
from plugins.results.report.results import Results

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN = 5  # of a generation, where the budget does not say how many may become elites
MAX_GENERATIONS = 8  # the latest ones, in a figure


@dataclass(frozen=True)
class Shown:
    """A design with its best candidate; ``became``: the best candidates of later generations that derive from it."""

    best: StoredEvaluation
    design: StoredDesign
    became: tuple[str, ...] = ()


def elites(run: FinishedRun) -> list[Shown]:
    """The best designs of each generation, as many as may become elites, and those that any of them derives from; in
    the order of generation and rank.
    """
    designs, evaluations = run.store.designs(), run.store.evaluations()
    design_of = {e.candidate: e.design for e in evaluations}
    best: dict[Key, StoredEvaluation] = {}
    most = run.config.get("budget", {}).get("k_top") or SHOWN
    chosen: set[Key] = set()
    for index in range(len(run.figures.generations)):
        tried = [e for e in evaluations if e.design[0] == index and e.status == "ok"]
        own: dict[Key, StoredEvaluation] = {}
        for evaluation in ranked(tried, lambda e: (e.reward, e.distance_m), run.figures.tie):
            own.setdefault(evaluation.design, evaluation)
        best |= own
        chosen |= {*list(own)[:most]}
    parents = {key: {design_of[name] for name in designs[key].parents if name in design_of} for key in best}
    chosen |= {parent for key in chosen for parent in parents[key] if parent in best}
    shown = [key for key in best if key in chosen]
    became = {key: tuple(best[child].candidate for child in shown if key in parents[child]) for key in shown}
    return [Shown(best[key], designs[key], became[key]) for key in shown]


def lineage(results: Results) -> Table:
    """Which elite became which, and the model's words; of a single run."""
    rows: list[tuple[Cell, ...]] = []
    for each in elites(results.runs[0]) if len(results.runs) == 1 else ():
        names = ("tool_name", "tool_description", "strategy_name", "strategy_description")
        said = (str(each.design.written.get(name) or "").strip(" .") for name in names)
        figures = (each.best.design[0], each.best.candidate, each.best.reward)
        origin = ", ".join(each.design.parents) or "–", ", ".join(each.became) or "–"
        rows.append((*figures, *origin, ". ".join(dict.fromkeys(filter(None, said)))))
    head = columns("generation:0|candidate|reward:3|derives from|became|in the model's words")
    note = "The best designs of each generation, as many as may become elites."
    return Table("lineage", "Which design became which", head, tuple(rows), note)


def lineage_page(results: Results) -> FigurePage | None:
    """The graph of a single run's designs, if one derives from another."""
    shown = elites(results.runs[0]) if len(results.runs) == 1 else []
    if not any(each.became for each in shown):
        return None
    caption = (
        "The best designs of each generation, the best on top, by candidate and reward; rewards within evolution.tie "
        "of each other count as equal. Lines lead from a design to those that derive from it. At most the last "
        f"{MAX_GENERATIONS} generations are drawn."
    )
    return FigurePage("lineage", "Lineage", caption, partial(paint, shown))


def paint(shown: list[Shown]) -> Figure:
    """Draw the graph: a column per generation, the best on top."""
    last = max(each.best.design[0] for each in shown)
    columns_of: dict[int, list[Shown]] = {}
    for each in shown:
        if each.best.design[0] > last - MAX_GENERATIONS:
            columns_of.setdefault(each.best.design[0], []).append(each)
    places = {e.best.candidate: (g, -k) for g, column in columns_of.items() for k, e in enumerate(column)}
    rows = max(map(len, columns_of.values()))
    figure = new_figure(max(5.0, 2.0 * len(columns_of)), 0.9 + 0.4 * rows)
    ax = figure.subplots()
    for each in (each for column in columns_of.values() for each in column):
        x, y = places[each.best.candidate]
        for child in each.became:
            ax.plot((x + 0.33, places[child][0] - 0.33), (y, places[child][1]), color=INK, lw=0.8, alpha=0.6)
        label = f"{each.best.candidate}  {number(each.best.reward, 3)}"
        edge = COLORS[2] if each.became else "#8b949e"
        ax.text(x, y, label, ha="center", va="center", fontsize=8, bbox={"boxstyle": "round", "fc": "none", "ec": edge})
    ax.set(xlim=(min(columns_of) - 0.5, last + 0.5), ylim=(0.6 - rows, 0.6), yticks=[], xticks=list(columns_of))
    ax.set_xlabel("generation")
    ax.spines[:].set_visible(False)
    return figure
