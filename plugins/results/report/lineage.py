"""Lineage of a single run: the best designs of each generation, what they derive from, and the model's words."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from core.design import ranked
from core.store.reader import Key, StoredEvaluation
from core.support.text import number
from plugins.results.pages.figure import INK, FigurePage, new_figure
from plugins.results.pages.formats import Table
from plugins.results.pages.runs import FinishedRun
from plugins.results.report.results import Results

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Elites = list[tuple[StoredEvaluation, set[str]]]  # with the best candidates of the designs that they derive from
SHOWN = 5  # of a generation, where the budget does not say how many may become elites
MAX_GENERATIONS = 8  # the latest ones, in a figure


def elites(run: FinishedRun) -> Elites:
    """The best designs of each generation, as many as may become elites, and those that any of them derives from."""
    designs, evaluations = run.store.designs(), run.store.evaluations()
    design_of = {e.candidate: e.design for e in evaluations}
    best: dict[Key, StoredEvaluation] = {}
    chosen: set[Key] = set()
    for index in range(len(run.figures.generations)):
        tried = [e for e in evaluations if e.design[0] == index and e.status == "ok"]
        own: dict[Key, StoredEvaluation] = {}
        for evaluation in ranked(tried, lambda e: (e.reward, e.distance_m), run.figures.tie):
            own.setdefault(evaluation.design, evaluation)
        best |= own
        chosen |= {*list(own)[: run.config.get("budget", {}).get("k_top") or SHOWN]}
    parents = {key: {design_of.get(name) for name in designs[key].parents} & best.keys() for key in best}
    chosen |= {parent for key in chosen for parent in parents[key] if parent is not None}
    return [(best[key], {best[parent].candidate for parent in parents[key] if parent}) for key in best if key in chosen]


def lineage(results: Results) -> Table:
    """What the elites derive from, and the model's words."""
    rows = []
    for run in results.runs if len(results.runs) == 1 else ():
        designs = run.store.designs()
        for e, parents in elites(run):
            names = ("tool_name", "tool_description", "strategy_name", "strategy_description")
            said = (str(designs[e.design].written.get(name) or "").strip(" .") for name in names)
            words = ". ".join(dict.fromkeys(filter(None, said)))
            rows.append((e.design[0], e.candidate, e.reward, ", ".join(sorted(parents)) or "–", words))
    return Table.of("lineage", "generation:0|candidate|reward:3|derives from|in the model's words", rows)


def lineage_page(results: Results) -> FigurePage | None:
    """The graph of a single run's designs, if one derives from another."""
    shown = elites(results.runs[0]) if len(results.runs) == 1 else []
    return FigurePage("lineage", "Lineage", partial(_paint, shown)) if any(of for _, of in shown) else None


def _paint(shown: Elites) -> Figure:
    last = shown[-1][0].design[0]
    latest = [pair for pair in shown if pair[0].design[0] > last - MAX_GENERATIONS]
    rows = [0] * (last + 1)
    figure = new_figure(max(5.0, 2.0 * min(last + 1, MAX_GENERATIONS)), 3.0)
    ax, places = figure.subplots(), dict[str, tuple[int, int]]()
    for e, parents in latest:
        x = e.design[0]
        places[e.candidate] = x, -rows[x]
        ax.text(x, -rows[x], f"{e.candidate}  {number(e.reward, 3)}", ha="center", va="center", fontsize=8)
        for px, py in (places[parent] for parent in parents & places.keys()):
            ax.plot((px + 0.33, x - 0.33), (py, -rows[x]), color=INK, lw=0.8, alpha=0.6)
        rows[x] += 1
    ax.set(xlim=(latest[0][0].design[0] - 0.5, last + 0.5), ylim=(0.6 - max(rows), 0.6), yticks=[], xlabel="generation")
    ax.set_xticks(sorted({e.design[0] for e, _ in latest}))
    ax.spines[:].set_visible(False)
    return figure
