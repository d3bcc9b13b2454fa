"""Try candidates in several trials, in one or more engines."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from core.design import Candidate, Evaluation
from core.interfaces import Evaluate, Fitness
from plugins.fitness.robustness import worst


@dataclass(eq=False)
class SeveralTrials(Fitness):
    """The rewards of several trials, combined, in the engine where that is the lowest.

    Attributes:
        evaluators: one for each trial, by engine.
        combine: what becomes of an engine's rewards.
        trial: what a trial is called.
    """

    evaluators: Mapping[str, Sequence[Evaluate]]
    combine: Callable[[Sequence[float]], float]
    trial: str

    @property
    def batch(self) -> int:
        """The smallest batch among its engines."""
        return min(evaluate.batch for each in self.evaluators.values() for evaluate in each)

    def prepare(self) -> None:
        for each in self.evaluators.values():
            for evaluate in each:
                evaluate.prepare()

    def __call__(self, candidates: Sequence[Candidate]) -> list[Evaluation]:
        tried = {engine: [evaluate(candidates) for evaluate in each] for engine, each in self.evaluators.items()}
        return [
            worst(
                candidate,
                {engine: [evaluations[number] for evaluations in each] for engine, each in tried.items()},
                self.combine,
                self.trial,
            )
            for number, candidate in enumerate(candidates)
        ]
