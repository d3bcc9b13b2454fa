"""Make evaluations without playing anything, for checks and tests."""

from __future__ import annotations

import math
from typing import Any

from core.design import Candidate
from core.trial import Evaluation, Score, Status, Trial, Where


def tried_once(
    candidate: Candidate,
    status: Status = "ok",
    reward: float = 0.0,
    distance_m: float = float("nan"),
    **fields: Any,
) -> Evaluation:
    """Make the evaluation of a candidate with a single trial, where it does not matter in which condition it was.

    ``fields`` are further fields of the `Trial`.
    """
    where = fields.pop("where", Where("", "", 0))
    if not math.isnan(distance_m):
        fields["measured"] = {"distance_m": distance_m}

    trial = Trial(where, candidate.id, status, float(reward), **fields)
    return Evaluation(candidate, (trial,), Score(trial.reward))
