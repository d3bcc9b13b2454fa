"""What any tool representation must satisfy: each check takes one and raises an AssertionError that says what is wrong.

Representations that give tools (`ToolRepresentation.given`) are held to what they give; the others have to write and
read tools.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from core.conformance.checking import as_json, brief, expect, fingers, rigid, some_task
from core.design import Component, DesignError, Tool
from core.designs.rules import check_tool
from core.errors import UserError
from core.geometry import Pose
from core.interfaces import Task, ToolRepresentation
from core.plugins import installed


def gives(representation: ToolRepresentation) -> Iterator[tuple[Task, Tool]]:
    """The tasks for which there is a tool, and it."""
    for name in installed().names("task"):
        task = installed().create("task", name)
        try:
            tool = representation.given(task)
        except UserError:  # for this task there is none
            continue
        if tool is not None:
            yield task, tool


def designs(representation: ToolRepresentation) -> bool:
    """Whether a model writes its tools."""
    try:
        return representation.given(some_task()) is None
    except UserError:
        return False


def check_what_it_gives_are_tools(representation: ToolRepresentation) -> None:
    given = list(gives(representation))
    expect(given or designs(representation), "it gives no tool for any task, and writes none")
    for task, tool in given:
        expect(isinstance(tool, Tool), f"given gave a {type(tool).__name__} for {task.name}, not a Tool")
        if tool.components:
            check_tool(tool)


def check_the_schema_is_of_json(representation: ToolRepresentation) -> None:
    fields = representation.schema()
    expect(isinstance(fields, dict), f"schema gave a {type(fields).__name__}, not the properties of an object")
    as_json(fields, "the schema")
    if designs(representation):
        expect(fields, "the schema has no fields, so that a model can't say what the tool is")
    for name, field in fields.items():
        expect(isinstance(field, dict) and field, f"the schema of {name!r} is {field!r}, not an object")


def check_a_model_is_told_how_to_write_it(representation: ToolRepresentation) -> None:
    if not designs(representation):
        return
    for gripper in (False, True):
        text = representation.instructions(brief(some_task(), representation, gripper=gripper))
        for name in representation.schema():
            expect(name in text, f"the instructions don't speak of {name!r}, which the schema asks for")


def check_tools_come_back_as_they_were(representation: ToolRepresentation) -> None:
    """Boxes where they were to within 0.1 mm, in shape and weight, on the same mount; names may be others."""
    if not designs(representation):
        return
    for tool in (rigid(), fingers()):
        data = representation.dump(tool)
        as_json(data, "what dump gave")
        expect(set(data) == set(representation.schema()), f"dump gave {sorted(data)}, the schema has other fields")
        back = representation.parse(data, gripper=tool.gripper)
        expect(isinstance(back, Tool), f"parse gave a {type(back).__name__}, not a Tool")
        expect(back.gripper == tool.gripper, f"a tool with gripper={tool.gripper} came back as one without it")
        check_tool(back)
        expect(len(back.components) == len(tool.components), f"{len(back.components)} boxes came back")
        for (a, one), (b, other) in zip(placed(tool), placed(back), strict=True):
            expect(one[0] == other[0], f"a box on {one[0]} came back on {other[0]}")
            shift = np.abs(one[1].matrix - other[1].matrix).max()
            expect(shift < 1e-4, f"a box came back moved or turned by {shift:.2g}")
            expect(np.allclose(a.shape.size, b.shape.size, atol=1e-4), f"{a.shape.size} came back as {b.shape.size}")
            expect(abs(a.mass - b.mass) < 1e-6, f"a box of {a.mass} kg came back with {b.mass} kg")
        again = representation.parse(representation.dump(back), gripper=tool.gripper)
        expect(again.content == back.content, "what was read once and is written and read again is another tool")


def placed(tool: Tool) -> Iterator[tuple[Component, tuple[str, Pose]]]:
    places = tool.placed()
    return ((component, places[component.name]) for component in tool.components)


def check_nonsense_is_refused_with_a_reason(representation: ToolRepresentation) -> None:
    """By a DesignError whatever a model writes; nothing else, and no tool."""
    if not designs(representation):
        return
    fields = representation.schema()
    sound = representation.dump(rigid())
    wild: tuple[object, ...] = (None, True, 1, -1e400, "", "x" * 1000, "<a>", [], [[]], [None], {}, {"a": {}}, [1] * 50)
    for data in ({}, *({**sound, name: value} for name in fields for value in wild)):
        try:
            read = representation.parse(data, gripper=False)
        except DesignError as error:
            expect(str(error).strip(), f"{data!r} was refused without a reason")
        except Exception as error:
            raise AssertionError(f"parse raised {type(error).__name__} on {data!r}, not a DesignError") from error
        else:
            expect(isinstance(read, Tool), f"parse gave a {type(read).__name__} for {data!r}")


CHECKS = (
    check_what_it_gives_are_tools,
    check_the_schema_is_of_json,
    check_a_model_is_told_how_to_write_it,
    check_tools_come_back_as_they_were,
    check_nonsense_is_refused_with_a_reason,
)
