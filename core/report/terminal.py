"""Tables for the terminal: few columns, nothing cut off."""

from __future__ import annotations

from typing import TYPE_CHECKING

from core.report.results import Results
from core.report.statistics import deviation, mean
from core.report.tables import Column, Table, printed

if TYPE_CHECKING:
    import rich.table


def short_rewards(results: Results) -> Table:
    """Best, average and spread, by task and method."""
    columns = (
        *(Column("task"), Column("method"), Column("runs", 0), Column("best", 3), Column("average", 3)),
        *(Column("s.d.", 3), Column("distance m", 2)),
    )
    rows = [
        (
            *(g.task, g.method, len(g.runs), g.best.best.reward, mean(g.rewards), deviation(g.rewards)),
            g.best.best.distance_m,
        )
        for g in results.groups
    ]
    return Table("rewards", "Rewards", columns, tuple(rows))


def short_left_out(results: Results) -> Table:
    """Runs that are not counted."""
    columns = (Column("not counted"), Column("reason"), Column("folder"))
    rows = [(run.status, run.reason, str(run.folder)) for run in results.left_out]
    return Table("left_out", "", columns, tuple(rows))


def rich_table(table: Table) -> rich.table.Table:
    """A table for a rich console; texts are printed as they are, markup and all, without control characters."""
    import rich.table
    import rich.text

    made = rich.table.Table(box=None, header_style="bold")
    for column in table.columns:
        made.add_column(column.name, justify="left" if column.digits is None else "right", overflow="fold")
    for row in table.rows:
        cells = (printed(cell, column) for cell, column in zip(row, table.columns, strict=True))
        made.add_row(*(rich.text.Text(cell) for cell in cells))
    return made
