"""Tables as values, and as CSV: there in full precision, elsewhere rounded."""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from core.support.cli import print_table
from core.support.text import clean, number

_FORMULA = re.compile(r"((?:^|;)\s*)(?=[=+@-]|[＝＋＠－])")


@dataclass(frozen=True)
class CellLink:
    """A cell that leads to a file."""

    text: str
    target: Path


Cell = str | int | float | None | CellLink | tuple[CellLink, ...]


@dataclass(frozen=True)
class Column:
    """A column's name, with the unit; with ``digits`` after the point it is a column of numbers."""

    name: str
    digits: int | None = None


@dataclass(frozen=True)
class Table:
    """A table of a report. Its title, and how its numbers are made, are in ``report.html.j2``.

    Attributes:
        name: of its file.
        columns: with the number of digits where they hold numbers.
        rows: a cell for each column.
    """

    name: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]

    @classmethod
    def of(cls, name: str, head: str, rows: Iterable[tuple[Cell, ...]]) -> Table:
        """Make a table with a short head.

        Args:
            name: of its file.
            head: names of columns, and digits where they hold numbers, such as ``task|runs:0|best reward:3``.
            rows: a cell for each column.
        """
        columns = []
        for word in head.split("|"):
            title, _, digits = word.partition(":")
            columns.append(Column(title, int(digits) if digits else None))

        return cls(name, tuple(columns), tuple(rows))

    @property
    def filled(self) -> Table:
        """The same without the columns that no row has anything in."""
        kept = [
            number
            for number in range(len(self.columns))
            if any(row[number] not in (None, "") for row in self.rows)
        ]
        rows = [tuple(row[number] for number in kept) for row in self.rows]
        columns = tuple(self.columns[number] for number in kept)
        return Table(self.name, columns, tuple(rows))


def printed(cell: Cell, column: Column) -> str:
    """A cell for people; nothing is rounded up to 1."""
    match cell:
        case None:
            return "–"
        case CellLink() | tuple():
            return ", ".join(clean(link.text, 300) for link in links(cell))
        case str():
            return clean(cell, 1000)
        case _ if column.digits is None:
            return str(cell)
        case _:
            return number(cell, column.digits)


def show_table(table: Table) -> None:
    """Print a table."""
    names = [column.name for column in table.columns]
    numbers = [column.name for column in table.columns if column.digits is not None]
    rows = [list(map(printed, row, table.columns)) for row in table.rows]
    print_table(names, rows, numbers)


def links(cell: Cell) -> tuple[CellLink, ...]:
    """The links of a cell that holds nothing else."""
    match cell:
        case CellLink():
            return (cell,)
        case tuple():
            return cell

    return ()


def to_csv(table: Table, folder: Path) -> str:
    """CSV in full precision; links are paths from ``folder``, where the table will lie."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([_no_formula(column.name) for column in table.columns])
    for row in table.rows:
        writer.writerow([_plain(cell, folder) for cell in row])

    return text.getvalue()


def _plain(cell: Cell, folder: Path) -> str | float | None:
    """A cell as CSV has it; None is written as nothing."""
    match cell:
        case str():
            return _no_formula(cell)
        case CellLink() | tuple():
            paths = [relative(link.target, folder) for link in links(cell)]
            return _no_formula(" ".join(paths))

    return cell


def relative(target: Path, folder: Path) -> str:
    """The way from ``folder`` to ``target``, with forward slashes."""
    return Path(os.path.relpath(target.resolve(), folder.resolve())).as_posix()


def _no_formula(text: str) -> str:
    """``text`` without control characters, and quoted where a spreadsheet would take it for a formula.

    In some languages a semicolon begins a new cell, and wide signs count as plain ones.
    """
    return _FORMULA.sub(r"\1'", clean(text, 10_000))
