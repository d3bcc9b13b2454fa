"""``evolution=sampling``: no evolution, with as many evaluations as a search that evolves."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from core.design import Candidate
from core.interfaces import EvolutionStrategy
from core.trial import Evaluation


class Sampling(EvolutionStrategy):
    """Ask for a fresh population in each generation, and ignore what the last one earned."""

    learns = False
    _generation = 0

    def ask(self) -> Iterator[Candidate]:
        return self.designer.design(self._generation)

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        self._generation += 1
