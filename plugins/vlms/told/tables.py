"""Write tables in Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Write a Markdown table; no text of a cell ends its cell or row."""
    lines = [_write_row(columns), _write_row(["---"] * len(columns))]
    lines += [_write_row(row) for row in rows]
    return "\n".join(lines)


def _write_row(row: Sequence[str]) -> str:
    cells = [" ".join(cell.split()).replace("|", r"\|") for cell in row]
    return f"| {' | '.join(cells)} |"
