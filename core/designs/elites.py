"""Write elites and critiques for a prompt, as JSON."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from typing import Any

from core.designs.feedback import combined_figures, elite_feedback
from core.designs.reading import dump_names
from core.interfaces import Brief, Task, ToolRepresentation, Waypoints
from core.support.text import clean
from core.trial import Evaluation
from core.values.observations import Sight

_LONGEST = 240  # characters of an elite's description
_NUMBERS = re.compile(r'(\[)\n([^][{}"]*)\n *(\])')
_INNERMOST = re.compile(r"(\{)\n([^{}]*)\n *(\})")


def elites_text(
    elites: Sequence[Evaluation],
    representation: ToolRepresentation,
    task: Task,
    *,
    numbers: bool,
    sight: Sight,
) -> str:
    """Write elites as JSON, each list of numbers and each innermost object on one line.

    With ``numbers`` each has its plan, and what was observed of its rollout; with ``sight`` without bodies' numbers.

    Raises:
        ValueError: an elite has no tool.
    """
    entries = []
    for elite in elites:
        entry = _describe_design(elite, representation)
        figures = combined_figures(elite, task, sight)
        if figures:
            entry["details"] = _round_numbers(figures)
        if numbers:
            entry |= _describe_rollout(elite, sight)
        entries.append(entry)

    text = json.dumps(entries, indent=1, ensure_ascii=False)
    for pattern in (_NUMBERS, _INNERMOST):
        text = pattern.sub(_join_lines, text)
    return text


def critiques_text(brief: Brief) -> str:
    """Write the critiques in a brief, of its elites and of what was tried, as JSON; empty: there are none."""
    if not brief.critiques:
        return ""
    known = {e.candidate.id: e for e in (*brief.tried, *brief.elites)}
    entries = []
    for name, critique in brief.critiques.items():
        entry: dict[str, Any] = {"id": name, "reward": round(known[name].reward, 4)}
        tool = known[name].candidate.tool
        if tool is not None and tool.name:
            entry["tool_name"] = tool.name
        entries.append({**entry, "critique": critique})
    return json.dumps(entries, indent=1, ensure_ascii=False)


def _describe_design(
    elite: Evaluation, representation: ToolRepresentation
) -> dict[str, Any]:
    candidate = elite.candidate
    entry: dict[str, Any] = {
        "id": candidate.id,
        "reward": round(elite.reward, 4),
    }
    entry |= dump_names(candidate)
    for name in ("strategy_description", "tool_description"):
        entry[name] = clean(entry[name], _LONGEST)
    if candidate.plan.action != Waypoints.action:
        entry["action"] = candidate.plan.action
    assert candidate.tool is not None
    return entry | representation.abridge(candidate.tool)


def _describe_rollout(elite: Evaluation, sight: Sight) -> dict[str, Any]:
    figures = {
        "action_plan": elite.candidate.plan.dump(),
        "distance_m": elite.distance_m,
    }
    described: dict[str, Any] = _round_numbers(figures)
    described |= elite_feedback(elite, sight)
    described["warnings"] = [sight.text(warning) for warning in elite.warnings]
    return described


def _round_numbers(value: Any) -> Any:
    """Round the numbers of a JSON value to four digits; nan, which JSON has not, becomes null."""
    return json.loads(
        json.dumps(value),
        parse_float=lambda text: round(float(text), 4) + 0.0,  # never -0
        parse_constant=lambda _: None,
    )


def _join_lines(found: re.Match[str]) -> str:
    """Write a list or object of several lines on one."""
    opening, inside, closing = found.groups()
    return opening + re.sub(r"\n *", " ", inside.strip()) + closing
