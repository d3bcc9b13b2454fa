"""Load the tool of a designs file, without its plans."""

from __future__ import annotations

from pathlib import Path

from core.design import DesignError, Tool
from core.designs.reading import list_strategies, load_designs
from core.designs.tools import read_fields, read_gripper, read_tool
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
    strategies = list_strategies(load_designs(path))
    if number not in range(len(strategies)):
        raise UserError(
            f"{path} has {len(strategies)} strategies; there is no strategy={number}"
        )

    given = representation.given(task)
    try:
        fields = read_fields(strategies[number], representation)
        gripper = read_gripper(fields, given, task)
        return given or read_tool(fields, representation, gripper, task)
    except DesignError as error:
        raise UserError(
            f"{path}: the tool of strategy {number} can't be read: {error}"
        ) from error
