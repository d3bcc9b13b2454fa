"""The reward of one rollout."""

from __future__ import annotations

from collections.abc import Sequence

from core.design import Candidate
from core.interfaces import Condition, Fitness, Score, Trial


class Nominal(Fitness):
    """The reward in the run's engine, in the scene as the task has it."""

    def __init__(self, condition: Condition) -> None:
        self._condition = condition

    def conditions(self) -> Sequence[Condition]:
        return [self._condition]

    def score(self, candidate: Candidate, trials: Sequence[Trial]) -> Score:
        return Score(trials[0].reward)
