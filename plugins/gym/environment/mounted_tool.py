"""Read the tool of an environment."""

from __future__ import annotations

from pathlib import Path

from core.design import DesignError, Tool
from core.designs.loading import load_tool
from core.designs.rules import check_tool
from core.designs.start import SpawnRules
from core.errors import UserError
from core.interfaces import Task, ToolRepresentation


def load_mounted_tool(
    designs: Path, strategy: int, representation: ToolRepresentation, task: Task
) -> Tool:
    """Read a tool, and check that it can be mounted.

    Args:
        designs: a designs file.
        strategy: the number of the tool in it, from 0.
        representation: reads it.
        task: in whose first layout it must start clear of everything.

    Raises:
        UserError: the file, or the tool, can't be used.
    """
    tool = load_tool(designs, strategy, representation, task)
    try:
        if tool.components:
            check_tool(tool, task.robot, representation.material)
        SpawnRules(task, 0).check(tool)
    except DesignError as error:
        raise UserError(
            f"{designs}: the tool of strategy {strategy} can't be mounted: {error}"
        ) from error

    return tool
