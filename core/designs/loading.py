"""Load the tool of a designs file, without its plans."""

from __future__ import annotations

from pathlib import Path

from core.design import Tool
from core.designs.reading import load_designs, read_designs
from core.errors import UserError
from core.interfaces import Task, ToolRepresentation


def load_tool(
    path: Path, number: int, representation: ToolRepresentation, task: Task
) -> Tool:
    """Read the tool of a strategy in a designs file, whatever rules it breaks.

    Args:
        path: of the file.
        number: of the strategy, from 0.
        representation: reads the tool; if it gives one itself, that is returned.
        task: what the tool is for.

    Raises:
        UserError: there is no such strategy, or its tool can't be read.
    """
    candidates = read_designs(load_designs(path), representation, task)
    by_strategy = {candidate.strategy: candidate for candidate in candidates}
    if number not in by_strategy:
        raise UserError(
            f"{path} has {len(by_strategy)} strategies; there is no strategy={number}"
        )

    candidate = by_strategy[number]
    if candidate.tool is None:
        raise UserError(
            f"{path}: the tool of strategy {number} can't be read: {candidate.problem}"
        )

    return candidate.tool
