"""Write tables in Markdown, and phrases by the macros of this package's templates."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from core.support.templates import macros


def table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Write a Markdown table; no text of a cell ends its cell or row.

    Args:
        columns: the texts of the head.
        rows: of as many cells as there are columns.
    """
    lines = [_write_row(columns), _write_row(["---"] * len(columns))]
    lines += [_write_row(row) for row in rows]
    return "\n".join(lines)


def _write_row(row: Sequence[str]) -> str:
    cells = [" ".join(cell.split()).replace("|", r"\|") for cell in row]
    return f"| {' | '.join(cells)} |"


def phrase(template: str, macro: str, *values: object) -> str:
    """Fill in a macro of a template.

    Args:
        template: ``templates/TEMPLATE.md.j2``.
        macro: its name.
        values: of its parameters.
    """
    return str(getattr(macros("plugins.vlms.context", template), macro)(*values))
