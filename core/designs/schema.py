"""Define the JSON schema of an answer."""

from __future__ import annotations

from typing import Any

from core.interfaces import Brief


def answer_schema(brief: Brief) -> dict[str, Any]:
    """JSON schema of the answer to ``brief``: a scene analysis and strategies, each a tool with its action plans."""
    given = brief.representation.given(brief.task) is not None
    plan = brief.actions.schema(gripper=brief.gripper)
    strategy: dict[str, Any] = {
        "strategy_name": {"type": "string"},
        "strategy_description": {"type": "string"},
        **(
            {}
            if given
            else {
                "tool_name": {"type": "string"},
                "tool_description": {"type": "string"},
            }
        ),
        **(
            {"gripper": {"type": "boolean", "enum": [brief.gripper]}}
            if brief.task.robot.gripper
            else {}
        ),
        **brief.representation.schema(),
        "action_description": {"type": "string"},
        "action_sets": _list(plan, brief.n_action, brief.n_action),
    }
    if brief.elites:
        ids = [elite.candidate.id for elite in brief.elites]
        strategy = {
            "parents": _list({"type": "string", "enum": ids}, 1, min(2, len(ids))),
            **strategy,
        }
    strategies = _list(_object(strategy), brief.n_tool, brief.n_tool)
    if not brief.n_action:
        strategy = {
            key: of for key, of in strategy.items() if not key.startswith("action_")
        }
    return _object({"scene_analysis": {"type": "string"}, "strategies": strategies})


def _object(properties: dict[str, Any]) -> dict[str, Any]:
    return {
        "type": "object",
        "properties": properties,
        "required": list(properties),
        "additionalProperties": False,
    }


def _list(items: dict[str, Any], least: int, most: int | None = None) -> dict[str, Any]:
    limits = (
        {"minItems": least} if most is None else {"minItems": least, "maxItems": most}
    )
    return {"type": "array", "items": items, **limits}
