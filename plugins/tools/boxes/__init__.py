"""Tools as lists of boxes and round shapes."""

from core.hooks import Factories, hookimpl


@hookimpl
def tool_representations() -> Factories:
    return {"boxes": "plugins.tools.boxes.representation:BoxTools"}
