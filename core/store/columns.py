"""Turn what a run hands to its store into the columns of rows (`core.store.rows` reads them)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from core.design import Candidate
from core.designs.reading import dump_design
from core.interfaces import Request, ToolRepresentation
from core.store.rows import Details
from core.support.inputs import adapter
from core.trial import Evaluation, Trial, TrialKey
from core.values.plans import ActionPlan, Waypoints

Columns = dict[str, Any]


def request_row(request: Request, digest: str) -> Columns:
    """Return the columns of a request, with a hash of what was composed."""
    brief = request.brief
    return {
        "id": request.id,
        "generation": brief.generation,
        "agent": brief.agent,
        "gripper": brief.gripper,
        "temperature": request.temperature,
        "elites": [elite.candidate.id for elite in brief.elites],
        "digest": digest,
        "purpose": request.purpose,
        "recalled": [(found.kind, found.source) for found in brief.recalled],
    }


def design_row(candidate: Candidate, representation: ToolRepresentation) -> Columns:
    """Return the columns of a design, without its action plans."""
    written = dump_design(candidate, representation) | {"action_sets": []}
    return {
        "generation": candidate.generation,
        "agent": candidate.agent,
        "design": candidate.design,
        "parents": candidate.parents,
        "written": written,
    }


def trial_row(content: str, trial: Trial) -> Columns:
    """Return the columns of a trial of a design's content."""
    columns = {
        "candidate": trial.candidate,
        "status": trial.status,
        "reward": float(trial.reward),
    }
    details = _dump_fields(trial, "where", "measured", "refusals", *columns)
    for name, figure in trial.measured.items():
        if not math.isnan(figure):
            details[name] = float(figure)

    return {"content": content, **trial.where._asdict(), **columns, "details": details}


def evaluation_row(
    evaluation: Evaluation, trial_numbers: Mapping[TrialKey, int]
) -> Columns:
    """Return the columns of an evaluation, in which trials are named by the numbers of their rows."""
    candidate = evaluation.candidate
    distance_m = float(evaluation.distance_m)

    def numbers(trials: Sequence[Trial]) -> tuple[int, ...]:
        keys = [(candidate.of(trial.task).content, trial.where) for trial in trials]
        return tuple(trial_numbers[key] for key in keys)

    trials = numbers(evaluation.trials)
    finals = numbers(evaluation.finals.in_order())
    return {
        "candidate": candidate.id,
        "generation": candidate.generation,
        "agent": candidate.agent,
        "design": candidate.design,
        "plan": candidate.action,
        "waypoints": dump_plan(candidate.plan),
        "status": evaluation.status,
        "reason": evaluation.reason,
        "reward": float(evaluation.reward),
        "distance_m": distance_m if math.isfinite(distance_m) else None,
        "content": candidate.content,
        "details": _dump_fields(Details(evaluation.score, trials, finals)),
    }


def dump_plan(plan: ActionPlan) -> list[Any] | Columns:
    """Return a plan as JSON: literal waypoints as a list, others with the name of their representation."""
    written = plan.dump()
    if isinstance(plan, Waypoints):
        return written
    return {"action": plan.action, "plan": written}


def _dump_fields(value: Details | Trial, *left_out: str) -> Columns:
    """Return the fields that are not as their defaults, neither nan nor empty."""
    fields: Columns = adapter(type(value)).dump_python(
        value, exclude={*left_out}, exclude_defaults=True, warnings=False
    )
    return {
        name: field for name, field in fields.items() if field == field and field != {}
    }
