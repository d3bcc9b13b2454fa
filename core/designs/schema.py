"""Define the JSON schema of an answer."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from core.designs.curves import CURVE, curve_schema
from core.interfaces import Brief
from core.scene import FIXTURE

_TEXT = {"type": "string"}


def answer_schema(brief: Brief) -> dict[str, Any]:
    """Return the JSON schema of the answer to a brief: a scene analysis, and designs.

    A design is a tool with its action plans. Where the tool is given it has plans alone, and where the brief asks for
    no plans the tool alone. It names its parents where there are elites. An agent, who is asked alone, may answer with
    more designs and plans than one; how many a call may hold, its guide says.
    """
    design: dict[str, Any] = {}
    if brief.elites:
        ids = [elite.candidate.id for elite in brief.elites]
        design["parents"] = _list(_TEXT | {"enum": ids}, 1, min(2, len(ids)))

    if brief.curves and brief.n_action:
        design[CURVE] = curve_schema()

    design |= {"strategy_name": _TEXT, "strategy_description": _TEXT}
    if brief.representation.given(brief.task) is None:
        design |= {"tool_name": _TEXT, "tool_description": _TEXT}
    if brief.task.robot.gripper:
        design["gripper"] = {"type": "boolean", "enum": [brief.gripper]}
    tool = brief.representation.schema()
    design |= tool
    if brief.task.fixture and tool:
        pose = _list({"type": "number"}, 6, 6)
        fixture = object_schema({"pose": pose, **tool})
        design[FIXTURE] = {"anyOf": [{"type": "null"}, fixture]}

    if brief.n_action:
        plan = brief.actions.schema(gripper=brief.closes)
        design["action_description"] = _TEXT
        most = None if brief.alone else brief.n_action
        design["action_sets"] = _list(plan, brief.n_action, most)

    most = None if brief.alone else brief.n_tool
    designs = _list(object_schema(design), brief.n_tool, most)
    return object_schema({"scene_analysis": _TEXT, "strategies": designs})


def object_schema(
    properties: dict[str, Any], required: Sequence[str] | None = None
) -> dict[str, Any]:
    """Return the schema of an object that has these properties and no others; by default all of them are required."""
    return {
        "type": "object",
        "properties": properties,
        "required": list(properties if required is None else required),
        "additionalProperties": False,
    }


def _list(items: dict[str, Any], least: int, most: int | None) -> dict[str, Any]:
    """Return the schema of a list of ``least`` to ``most`` items; None: or more."""
    schema = {"type": "array", "items": items, "minItems": least}
    return schema if most is None else {**schema, "maxItems": most}
