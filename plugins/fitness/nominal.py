"""The reward of one rollout."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from pydantic import NonNegativeInt

from core.design import Candidate
from core.interfaces import Condition, Fitness, Score, Trial
from plugins.fitness.perturbation_range import PerturbationRange
from plugins.fitness.robustness import Perturbation


class Nominal(Fitness):
    """The reward in the run's engine, in the scene as the task has it.

    Of those that earn alike and hold in small changes of the scene the first by `core.trial.WHAT_DECIDES` wins.

    Args:
        condition: the task, its layout, its engine, and how plans are executed.
        changes: of the scene, with how many candidates that earn alike are tried; these decide between them.
    """

    finals_check = True

    def __init__(self, condition: Condition, changes: NonNegativeInt = 16) -> None:
        self._condition = condition
        self._changes = changes

    def conditions(self) -> Sequence[Condition]:
        return [self._condition]

    def score(self, candidate: Candidate, trials: Sequence[Trial]) -> Score:
        return Score(trials[0].reward)

    def finals(self) -> Iterator[list[Condition]]:
        """Yield the scene with one small change after the other."""
        for seed in range(self._changes):
            change = Perturbation(PerturbationRange(), seed)
            yield [replace(self._condition, change=change)]
