"""Write elites for a prompt, shortened where they would exceed its budget.

Covered by `tests/core/designs/test_composer.py`.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from typing import Any

from core.design import Component, Evaluation, Tool, ToolJoint
from core.designs.feedback import combined_figures, elite_feedback
from core.designs.layout import describe_shape
from core.designs.reading import dump_design
from core.geometry import Box
from core.interfaces import Task, ToolRepresentation
from core.support.text import clean, short_numbers

_LONGEST = 240  # characters of a description


def elites_text(
    elites: Sequence[Evaluation],
    representation: ToolRepresentation,
    task: Task,
    *,
    numbers: bool,
    budget: int,
    tried: Sequence[Evaluation] = (),
) -> tuple[str, bool]:
    """Write elites as JSON; report whether some had to be shortened to keep within ``budget`` characters.

    With ``numbers`` each has its plan, what was observed of its rollout, and the rewards of its other plans among
    ``tried``. The last is shortened first: at first to a list of its components, then to its id, reward and names,
    which are shown in any case.
    """
    entries = [_entry(elite, representation, task, tried if numbers else None) for elite in elites]
    text = _json(entries)
    shortened = len(text) > budget
    for shorten in (_listed, _named):
        for k in reversed(range(len(entries))):
            if len(text) <= budget:
                break
            entries[k] = shorten(entries[k], elites[k], representation)
            text = _json(entries)
    return text, shortened


def _entry(
    elite: Evaluation, representation: ToolRepresentation, task: Task, tried: Sequence[Evaluation] | None
) -> dict[str, Any]:
    candidate, design = elite.candidate, dump_design(elite.candidate, representation)
    assert candidate.tool is not None
    left_out = {"action_description", "action_sets", *representation.dump(candidate.tool)}
    data: dict[str, Any] = {"id": candidate.id, "reward": round(elite.reward, 4)}
    data |= {key: _cut(key, value) for key, value in design.items() if key not in left_out}
    data |= representation.abridge(candidate.tool)
    if figures := combined_figures(elite, task):
        data["details"] = _figures(figures)
    if tried is None:
        return data
    data |= {"action_plan": _figures(candidate.plan.dump()), "distance_m": _rounded(elite.distance_m)}
    if elite.observation is not None:
        return data | elite_feedback(elite, tried) | {"warnings": list(elite.warnings)}
    return data | {
        "moved_m": {name: _rounded(moved) for name, moved in elite.moved_m.items()},
        "missed_m": _rounded(elite.ik_error_m),
        "missed_rad": _rounded(elite.ik_error_rad),
        "lag_rad": _rounded(elite.tracking_error_rad),
        "warnings": list(elite.warnings),
    }


def _listed(entry: dict[str, Any], elite: Evaluation, representation: ToolRepresentation) -> dict[str, Any]:
    """An entry with a line per component in place of the representation's text."""
    tool = elite.candidate.tool
    assert tool is not None
    written = representation.abridge(tool)
    short = {key: value for key, value in entry.items() if key not in written}
    return short | ({"components": component_lines(tool)} if written else {})


def _named(entry: dict[str, Any], elite: Evaluation, representation: ToolRepresentation) -> dict[str, Any]:
    count = len(elite.candidate.tool.components) if elite.candidate.tool else 0
    kept = ("id", "reward", "strategy_name", "tool_name", "gripper")
    return {key: entry[key] for key in kept if key in entry} | {"left_out": f"{count} components, too long to be shown"}


def component_lines(tool: Tool) -> list[str]:
    """Write a line for each component: name, parent, size, place in the parent's frame (no rpy: not turned), mass."""
    return [_line(component) for component in tool.components]


def _line(component: Component) -> str:
    pose = component.pose
    xyz, rpy, shape = short_numbers(pose.position, 4), short_numbers(pose.rpy, 4), component.shape
    size = short_numbers(shape.size, 4) if isinstance(shape, Box) else describe_shape(shape.drawn)
    turn = f" rpy {rpy}" if rpy != "0 0 0" else ""
    moves = f", {_moves(component.joint)}" if component.joint else ""
    return f"{component.name} on {component.parent}: {size} at {xyz}{turn}, {component.mass:.3g} kg{moves}"


def _moves(joint: ToolJoint) -> str:
    """Write a joint in the component's frame."""
    at = f" at {short_numbers(joint.origin, 4)}" if joint.kind == "hinge" else ""
    spring = f", spring {joint.stiffness:.3g} relaxed at {joint.rest:g}" if joint.stiffness else ""
    resists = f", damping {joint.damping:.3g}, friction {joint.friction:.3g}"
    return f"{joint.kind} along {short_numbers(joint.axis, 4)}{at}, {joint.lower:g} to {joint.upper:g}{resists}{spring}"


def _cut(key: str, value: Any) -> Any:
    return clean(value, _LONGEST) if key.endswith("description") else value


def _json(value: object) -> str:
    """Indented JSON, with each list of numbers on one line."""
    text = json.dumps(value, indent=1, ensure_ascii=False)
    return re.sub(r"\[\n([^][{}\"]*)\n *\]", lambda found: f"[{' '.join(found[1].split())}]", text)


def _figures(value: Any) -> Any:
    """Round the numbers of a JSON value."""
    if isinstance(value, dict):
        return {key: _figures(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_figures(item) for item in value]
    return _rounded(value) if isinstance(value, float) else value


def _rounded(number: float) -> float | None:
    return round(number, 4) + 0.0 if math.isfinite(number) else None  # JSON has no nan
