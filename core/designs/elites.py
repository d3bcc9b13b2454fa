"""Write elites for a prompt, shortened where they would exceed its budget.

Covered by `tests/core/designs/test_composer.py`.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from typing import Any

from core.design import Evaluation
from core.designs.feedback import combined_figures, elite_feedback
from core.designs.reading import dump_design
from core.interfaces import Task, ToolRepresentation
from core.support.text import clean

_LONGEST = 240  # characters of a description
_NAMES = {"id", "reward", "strategy_name", "tool_name", "gripper"}  # of an elite that is too long


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
    ``tried``. The last is shortened first, to its id, reward and names.
    """
    entries = [_entry(elite, representation, task, tried if numbers else None) for elite in elites]
    text = _json(entries)
    shortened = len(text) > budget
    for entry, elite in zip(reversed(entries), reversed(elites), strict=True):
        if len(text) <= budget:
            break
        count = len(elite.candidate.tool.components) if elite.candidate.tool else 0
        for key in entry.keys() - _NAMES:
            del entry[key]
        entry["left_out"] = f"{count} components, too long to be shown"
        text = _json(entries)
    return text, shortened


def _entry(
    elite: Evaluation, representation: ToolRepresentation, task: Task, tried: Sequence[Evaluation] | None
) -> dict[str, Any]:
    candidate, design = elite.candidate, dump_design(elite.candidate, representation)
    assert candidate.tool is not None
    left_out = {"action_description", "action_sets", *representation.dump(candidate.tool)}
    data: dict[str, Any] = {"id": candidate.id, "reward": round(elite.reward, 4)}
    data |= {
        key: clean(value, _LONGEST) if key.endswith("description") else value
        for key, value in design.items()
        if key not in left_out
    }
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
