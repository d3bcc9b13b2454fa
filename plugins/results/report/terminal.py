"""Results as lines for the terminal. Covered by `tests/plugins/results/report/test_command.py`."""

from __future__ import annotations

import sys
from typing import TextIO

from core.support.cli import print_table, say
from core.support.text import number
from plugins.results.pages.formats import printed
from plugins.results.pages.runs import short
from plugins.results.report.leaderboard import entry_tables
from plugins.results.report.results import Results
from plugins.results.report.statistics import deviation, mean


def show(results: Results, file: TextIO | None = None) -> None:
    """Print best, average and standard deviation by task and method, and a line for each run that is not counted."""
    file = sys.stdout if file is None else file
    numbers = ("runs", "best", "average", "s.d.", "distance m")
    rows = [
        (
            *(g.task, g.method, str(len(g.runs)), number(g.best.best.reward, 3), number(mean(g.rewards), 3)),
            *(number(deviation(g.rewards), 3), number(g.best.best.distance_m, 2)),
        )
        for g in results.groups
    ]
    if rows:
        print_table(("task", "method", *numbers), rows, numbers, file)
    for table in entry_tables(results.entries, results.how)[:1]:
        cells = [[printed(*pair) for pair in zip(row, table.columns, strict=True)] for row in table.rows]
        digits = [column.name for column in table.columns if column.digits is not None]
        print_table([column.name for column in table.columns], cells, digits, file)
    for run in results.left_out:
        say(f"not counted, {run.status}: {short(str(run.folder))}: {run.reason}", file=file)
