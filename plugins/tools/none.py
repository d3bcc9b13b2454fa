"""The bare gripper: there is no tool to design, only plans."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from core.design import Tool
from core.hooks import hookimpl
from core.interfaces import GivenTools, Task, ToolRepresentation


@hookimpl
def tool_representations() -> Mapping[str, Callable[..., ToolRepresentation]]:
    return {"none": BareGripper}


class BareGripper(GivenTools):
    """The arm with its own hand and two fingers."""

    def given(self, task: Task) -> Tool:
        return Tool(gripper=True, name="bare gripper", description="the Panda's own hand with its two fingers")
