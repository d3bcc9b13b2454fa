"""No evolution: a fresh sampling each generation, with as many evaluations as a search that evolves."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

from core.design import Candidate, Evaluation
from core.hooks import hookimpl
from core.interfaces import Budget, Designer, EvolutionStrategy


@hookimpl
def evolution_strategies() -> Mapping[str, Callable[..., EvolutionStrategy]]:
    return {"sampling": Sampling}


class Sampling(EvolutionStrategy):
    """Never looks at what was earned."""

    def __init__(self, designer: Designer, budget: Budget) -> None:
        super().__init__(designer, budget)
        self._generation = 0

    def ask(self) -> Iterator[Candidate]:
        return self.designer.design(self._generation)

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        self._generation += 1
