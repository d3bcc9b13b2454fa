"""Checks that every tool representation must pass. Each takes one and raises an AssertionError that says what is wrong.

A representation that gives tools (`ToolRepresentation.given`) is checked by what it gives; the others have to write and
read tools.
"""

from __future__ import annotations

from itertools import product
from typing import Any

from core.design import Tool
from core.designs.rules import check_tool, given_tool
from core.errors import UserError
from core.interfaces import ToolRepresentation
from core.plugins import TASK, installed
from plugins.conformance.sample_tools import fingers, rigid
from plugins.conformance.shared import (
    WILD,
    as_json,
    brief,
    expect_a,
    near,
    read_or_refused,
    ready,
    some_task,
)


def designs(representation: ToolRepresentation) -> bool:
    """True if a model writes its tools."""
    try:
        return representation.given(some_task()) is None
    except UserError:
        return False


def check_given_tools_keep_the_rules(representation: ToolRepresentation) -> None:
    """Sizes, masses and contacts as for designs, and at spawn clear of the arm and the scene."""
    count = 0
    for name in ready("task"):
        task = installed().create(TASK, name)
        try:
            representation.given(task)
        except UserError:  # there is none for this task
            continue

        try:
            count += given_tool(representation, task) is not None
        except UserError as error:
            raise AssertionError(str(error)) from error

    assert count or designs(representation), (
        "it gives no tool for any task, and writes none"
    )


def check_the_schema_is_of_json(representation: ToolRepresentation) -> None:
    fields = representation.schema()
    expect_a(dict, fields, "schema returned")
    as_json(fields, "the schema")
    assert fields or not designs(representation), (
        "the schema has no fields, so a model can't describe a tool"
    )


def check_the_instructions_name_every_field(representation: ToolRepresentation) -> None:
    if not designs(representation):
        return
    for gripper in (False, True):
        asked = brief(some_task(), representation, gripper=gripper)
        text = representation.instructions(asked)
        for name in representation.schema():
            assert name in text, (
                f"the instructions don't name {name!r}, which the schema asks for"
            )


def check_tools_survive_dump_and_parse(representation: ToolRepresentation) -> None:
    """Each box keeps its place to 0.1 mm, its size, its mass and its mount. Names may differ."""
    if not designs(representation):
        return
    for tool in (rigid(), fingers()):
        data = representation.dump(tool)
        as_json(data, "what dump returned")
        assert set(data) == set(representation.schema()), (
            f"dump returned {sorted(data)}; the schema has other fields"
        )
        as_json(representation.abridge(tool), "what abridge returned")

        back = representation.parse(data, gripper=tool.gripper)
        check_tool(back, installed().default_robot)
        for part, again in zip(tool.components, back.components, strict=True):
            mount, pose = tool.placed()[part.name]
            mount_again, pose_again = back.placed()[again.name]
            assert mount_again == mount, (
                f"a component on {mount} came back on {mount_again}"
            )
            near(
                "where a component is, m, and its axes",
                pose_again.matrix,
                pose.matrix,
                1e-4,
            )
            size = part.shape.bounds[1]
            near("the size of a component, m", again.shape.bounds[1], size, 1e-4)
            near("the mass of a component, kg", again.mass, part.mass, 1e-6)


def check_nonsense_is_refused_with_a_reason(representation: ToolRepresentation) -> None:
    if not designs(representation):
        return
    sound = representation.dump(rigid())
    documents: list[dict[str, Any]] = [{}]
    for name, value in product(representation.schema(), WILD):
        documents.append({**sound, name: value})
    read_or_refused(representation.parse, Tool, documents)
