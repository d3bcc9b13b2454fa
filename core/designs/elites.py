"""Write elites for a prompt, as JSON."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from typing import Any

from core.designs.feedback import combined_figures, elite_feedback
from core.designs.reading import dump_design
from core.interfaces import Task, ToolRepresentation
from core.support.text import clean
from core.trial import Evaluation
from core.values.observations import Sight

_LONGEST = 240  # characters of an elite's description


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
    """
    entries = [_entry(elite, representation, task, numbers, sight) for elite in elites]
    text = json.dumps(entries, indent=1, ensure_ascii=False)
    text = re.sub(
        r"\[\n([^][{}\"]*)\n *\]", lambda found: f"[{' '.join(found[1].split())}]", text
    )
    return re.sub(
        r"\{\n([^{}]*)\n *\}",
        lambda found: "{" + re.sub(r"\n *", " ", found[1].strip()) + "}",
        text,
    )


def _entry(
    elite: Evaluation,
    representation: ToolRepresentation,
    task: Task,
    numbers: bool,
    sight: Sight,
) -> dict[str, Any]:
    candidate = elite.candidate
    design = dump_design(elite.candidate, representation)
    assert candidate.tool is not None
    left_out = {
        "action_description",
        "action_sets",
        *representation.dump(candidate.tool),
    }
    data: dict[str, Any] = {"id": candidate.id, "reward": round(elite.reward, 4)}
    data |= {
        key: clean(value, _LONGEST) if key.endswith("description") else value
        for key, value in design.items()
        if key not in left_out
    }
    data |= representation.abridge(candidate.tool)
    if figures := combined_figures(elite, task, sight):
        data["details"] = _figures(figures)
    if not numbers:
        return data
    data |= {
        "action_plan": _figures(candidate.plan.dump()),
        "distance_m": _rounded(elite.distance_m),
    }
    warnings = [sight.text(warning) for warning in elite.warnings]
    shown = elite.shown
    if shown is None:
        return data | {"warnings": warnings}
    if shown.observation is not None:
        several = len(elite.tasks) > 1
        return (
            data
            | elite_feedback(shown, shown.observation, sight, several)
            | {"warnings": warnings}
        )
    errors = {
        "missed_m": shown.ik_error_m,
        "missed_rad": shown.ik_error_rad,
        "lag_rad": shown.tracking_error_rad,
    }
    moved = {"moved_m": shown.moved_m} if sight.numbers else {}
    data |= _figures({**moved, **errors})
    return data | {"warnings": warnings}


def _figures(value: Any) -> Any:
    """Round the numbers of a JSON value; nan, which JSON has not, becomes null."""
    return json.loads(
        json.dumps(value),
        parse_float=lambda text: _rounded(float(text)),
        parse_constant=lambda _: None,
    )


def _rounded(number: float) -> float | None:
    return round(number, 4) + 0.0 if math.isfinite(number) else None  # JSON has no nan
