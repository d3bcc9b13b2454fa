"""The reward of one rollout."""

from __future__ import annotations

from collections.abc import Sequence

from core.design import Candidate, Evaluation
from core.interfaces import Fitness
from core.simulation.rollout import Evaluator


class Nominal(Fitness):
    """The reward in the run's engine, in the scene as the task has it."""

    def __init__(self, evaluator: Evaluator) -> None:
        self._evaluator = evaluator

    @property
    def batch(self) -> int:
        return self._evaluator.batch

    def prepare(self) -> None:
        self._evaluator.prepare()

    def __call__(self, candidates: Sequence[Candidate]) -> list[Evaluation]:
        return self._evaluator(candidates)
