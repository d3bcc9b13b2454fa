"""Random restarts: breed the best so far, and at random begin anew."""

import numpy as np

from core.interfaces import EvolutionStrategy
from core.trial import best_first


class Restarts(EvolutionStrategy):
    """``chance``: the probability of a new start in each generation."""

    def __init__(self, designer, budget, chance: float = 0.3, seed: int = 0):
        super().__init__(designer, budget)
        self.chance = chance
        self._rng = np.random.default_rng(seed)
        self._generation = 0
        self._pool = []

    def ask(self):
        if self._rng.uniform() < self.chance:
            self._pool = []
        return self.designer.design(
            self._generation, best_first(self._pool)[: self.budget.k_top]
        )

    def tell(self, evaluations):
        self._generation += 1
        self._pool = [*self._pool, *evaluations]
