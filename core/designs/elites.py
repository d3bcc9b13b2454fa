"""Write elites for a prompt. Covered by `tests/core/designs/test_composer.py`."""

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


def elites_text(
    elites: Sequence[Evaluation],
    representation: ToolRepresentation,
    task: Task,
    *,
    numbers: bool,
) -> str:
    """Write elites as JSON, each list of numbers and each innermost object on one line.

    With ``numbers`` each has its plan, and what was observed of its rollout.
    """
    entries = [_entry(elite, representation, task, numbers) for elite in elites]
    text = json.dumps(entries, indent=1, ensure_ascii=False)
    text = re.sub(r"\[\n([^][{}\"]*)\n *\]", lambda found: f"[{' '.join(found[1].split())}]", text)
    return re.sub(r"\{\n([^{}]*)\n *\}", lambda found: "{" + re.sub(r"\n *", " ", found[1].strip()) + "}", text)


def _entry(elite: Evaluation, representation: ToolRepresentation, task: Task, numbers: bool) -> dict[str, Any]:
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
    if not numbers:
        return data
    data |= {"action_plan": _figures(candidate.plan.dump()), "distance_m": _rounded(elite.distance_m)}
    if elite.shown is not None and elite.observation is not None:
        return data | elite_feedback(elite.shown, elite.observation) | {"warnings": list(elite.warnings)}
    return data | {
        "moved_m": {name: _rounded(moved) for name, moved in elite.moved_m.items()},
        "missed_m": _rounded(elite.ik_error_m),
        "missed_rad": _rounded(elite.ik_error_rad),
        "lag_rad": _rounded(elite.tracking_error_rad),
        "warnings": list(elite.warnings),
    }


def _figures(value: Any) -> Any:
    """Round the numbers of a JSON value."""
    if isinstance(value, dict):
        return {key: _figures(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_figures(item) for item in value]
    return _rounded(value) if isinstance(value, float) else value


def _rounded(number: float) -> float | None:
    return round(number, 4) + 0.0 if math.isfinite(number) else None  # JSON has no nan
