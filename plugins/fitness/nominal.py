"""The reward of one rollout."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import count

from core.design import Candidate
from core.interfaces import Condition, Fitness, Score, Trial
from plugins.fitness.robustness import Perturbation, PerturbationRange


class Nominal(Fitness):
    """The reward in the run's engine, in the scene as the task has it.

    Args:
        condition: the task, its layout, its engine, and how plans are executed.
        changes: candidates that earn alike are tried with small changes of the scene, too, which decide between them.
    """

    def __init__(self, condition: Condition, changes: bool = False) -> None:
        self._condition = condition
        self._changes = changes

    def conditions(self) -> Sequence[Condition]:
        return [self._condition]

    def score(self, candidate: Candidate, trials: Sequence[Trial]) -> Score:
        return Score(trials[0].reward)

    def finals(self) -> Iterator[list[Condition]]:
        """Yield the scene with one small change after the other, if these are asked for."""
        if not self._changes:
            return

        for seed in count():
            change = Perturbation(PerturbationRange(), seed)
            yield [replace(self._condition, change=change)]
