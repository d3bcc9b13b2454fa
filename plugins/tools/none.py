"""The bare gripper, or the bare flange of an arm without one: there is no tool to design, only plans."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from core.design import Tool
from core.hooks import hookimpl
from core.interfaces import GivenTools, Task, ToolRepresentation


@hookimpl
def tool_representations() -> Mapping[str, Callable[..., ToolRepresentation]]:
    return {"none": BareGripper}


class BareGripper(GivenTools):
    """The arm with its own gripper, or with nothing."""

    def given(self, task: Task) -> Tool:
        title = task.robot.title
        if task.robot.gripper is None:
            return Tool(name="bare flange", description=f"the flange of {title}, which has no gripper")
        return Tool(gripper=True, name="bare gripper", description=f"the gripper of {title}, with its fingers")
