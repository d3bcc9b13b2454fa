"""Show what changed over time in trials that are played once more: a plot and a table, of two side by side."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence

import numpy as np

from core.interfaces import Picture
from core.simulation.series import Series
from core.support.text import short_number

_ROWS = 13  # of the table
_PANEL_IN = 2.2  # height of a panel, inches
_WIDE_IN = 8.0
_COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
_STYLES = ("-", "--")  # of the first trial and the second


def write_table(series: Sequence[Series]) -> str:
    """Write series as a table, at instants that are evenly spread from the first to the last."""
    times = series[0].times
    chosen = np.unique(np.linspace(0, len(times) - 1, _ROWS).round().astype(int))
    head = ["s", *(f"{each.name} ({each.unit})" for each in series)]
    lines = [" | ".join(head)]
    for sample in chosen.tolist():
        cells = [short_number(float(times[sample]), 3)]
        cells += [short_number(float(each.values[sample]), 3) for each in series]
        lines.append(" | ".join(cells))
    return "\n".join(lines)


def draw_plot(trials: Mapping[str, Sequence[Series]]) -> Picture:
    """Draw the series of trials, by their names: a panel for each unit, the first trial in solid lines.

    Args:
        trials: one or two.
    """
    from matplotlib.figure import Figure

    units = list(dict.fromkeys(s.unit for series in trials.values() for s in series))
    names = list(dict.fromkeys(s.name for series in trials.values() for s in series))
    colors = {name: _COLORS[k % len(_COLORS)] for k, name in enumerate(names)}
    size = (_WIDE_IN, _PANEL_IN * len(units) + 0.6)
    figure = Figure(figsize=size, dpi=100, layout="constrained")
    panels = figure.subplots(len(units), 1, sharex=True, squeeze=False)[:, 0]

    for (trial, series), style in zip(trials.items(), _STYLES, strict=False):
        for each in series:
            label = each.name if len(trials) == 1 else f"{trial}: {each.name}"
            panel = panels[units.index(each.unit)]
            color = colors[each.name]
            panel.plot(each.times, each.values, style, color=color, label=label)

    for panel, unit in zip(panels, units, strict=True):
        panel.set_ylabel(unit)
        panel.grid(alpha=0.3)
        panel.legend(fontsize=7)
    panels[-1].set_xlabel("time of the motion (s)")

    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return Picture(buffer.getvalue(), "trace", f"over time: {', '.join(trials)}")
