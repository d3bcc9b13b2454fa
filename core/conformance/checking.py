"""What the checks of every kind share."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from core.design import Component, Tool
from core.errors import UserError
from core.geometry import Box, Pose
from core.interfaces import Brief, Message, Request, Task, Text, ToolRepresentation
from core.plugins import installed


def expect(condition: object, message: str) -> None:
    """Like assert, also where asserts are switched off.

    Raises:
        AssertionError: with the message.
    """
    if not condition:
        raise AssertionError(message)


def rigid() -> Tool:
    """An L of two boxes under the flange."""
    down = Component("down", "panda_virtual", Pose.xyz_rpy((0.0, 0.0, -0.1)), Box((0.02, 0.02, 0.2)))
    ahead = Component("ahead", "down", Pose.xyz_rpy((0.05, 0.0, -0.1), (0.0, 0.0, 0.2)), Box((0.1, 0.02, 0.02)))
    return Tool((down, ahead), name="L")


def fingers() -> Tool:
    """A box on each finger."""
    left, right = (
        Component(f"tip_{side}", f"panda_{side}finger", Pose.xyz_rpy((0.0, y, 0.06)), Box((0.01, 0.01, 0.05)))
        for side, y in (("left", 0.008), ("right", -0.008))
    )
    return Tool((left, right), gripper=True, name="tips")


class Given(ToolRepresentation):
    """Writes tools as nothing but a number: the checks' own, so that no plugin is needed to ask a model."""

    def instructions(self, brief: Brief) -> str:
        return "`length`: of the stick, metres."

    def schema(self) -> dict[str, Any]:
        return {"length": {"type": "number"}}

    def parse(self, data: Any, *, gripper: bool) -> Tool:
        return fingers() if gripper else rigid()

    def dump(self, tool: Tool) -> dict[str, Any]:
        return {"length": 0.2}


def brief(task: Task, representation: ToolRepresentation, *, agent: int = 0, gripper: bool = False) -> Brief:
    """Of a first generation: two tools with two plans each."""
    given = representation.given(task)
    n_tool = 2 if given is None else 1
    return Brief(task, 0, representation, gripper if given is None else given.gripper, n_tool, 2, 0, agent, agent)


def request(of: Brief) -> Request:
    """What a model is asked, in few words."""
    fields = ", ".join([*of.representation.schema(), "gripper", "action_sets"])
    text = f"{of.task.description} Answer with JSON: strategies, a list of {of.n_tool} objects with {fields}."
    return Request(f"g{of.generation}-a{of.agent}", of, (Message("user", (Text(text),)),), {"type": "object"}, 1.0)


def some_task() -> Task:
    """The first that is installed.

    Raises:
        UserError: there is none.
    """
    for name in installed().names("task"):
        made: Task = installed().create("task", name)
        return made
    raise UserError("no task is installed; a check needs one")


def as_json(value: object, what: str) -> str:
    """As JSON has it.

    Raises:
        AssertionError: it can't be told in JSON.
    """
    try:
        return json.dumps(value, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise AssertionError(f"{what} can't be written as JSON: {error}") from error


Check = Callable[[Any], None]
