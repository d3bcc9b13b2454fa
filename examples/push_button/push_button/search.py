"""Random restarts: breed the best so far, and at random begin anew."""

from collections.abc import Iterator, Sequence

import numpy as np

from core.design import Candidate
from core.interfaces import Budget, Designer, EvolutionStrategy
from core.trial import Evaluation, best_first


class Restarts(EvolutionStrategy):
    """The elites are the best of all generations since the last new start.

    Args:
        chance: the probability of a new start in each generation.
        seed: of the choice.
    """

    def __init__(
        self, designer: Designer, budget: Budget, chance: float = 0.3, seed: int = 0
    ) -> None:
        super().__init__(designer, budget)
        self.chance = chance
        self._random = np.random.default_rng(seed)
        self._generation = 0
        self._pool: list[Evaluation] = []

    def ask(self) -> Iterator[Candidate]:
        if self._random.uniform() < self.chance:
            self._pool = []
        elites = best_first(self._pool)[: self.budget.k_top]
        return self.designer.design(self._generation, elites)

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        self._generation += 1
        self._pool = [*self._pool, *evaluations]
