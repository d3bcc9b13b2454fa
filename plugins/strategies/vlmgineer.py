"""``evolution=vlmgineer``, the paper's search: sample once, then let the model mutate and cross the best."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal

from core.design import Candidate
from core.interfaces import Budget, Designer, EvolutionStrategy
from core.trial import TIE, Evaluation, best_first, best_tools


def select(
    evaluations: Sequence[Evaluation], budget: Budget, tie: float = TIE
) -> list[Evaluation]:
    """Choose the elites: of the ``k_top`` best candidates those that earned enough, the best of each tool.

    The best ``k_least`` tools are elites whatever they earned. Of several tasks the best of each is one, too, if it
    earned enough there.
    """
    best = best_first(evaluations, tie)
    save = budget.reward_save
    least = best_tools(best)[: min(budget.k_least, budget.k_top)]
    elites = [*least, *(e for e in best[: budget.k_top] if e.reward > save)]
    return best_tools(
        [
            *elites,
            *(
                e
                for task, e in _best_by_task(best).items()
                if e.figures.get(task, 0.0) > save
            ),
        ]
    )


def _best_by_task(evaluations: Sequence[Evaluation]) -> dict[str, Evaluation]:
    tasks = dict.fromkeys(
        task for evaluation in evaluations for task in evaluation.tasks
    )
    if len(tasks) < 2:
        return {}
    return {
        task: max(evaluations, key=lambda e: e.figures.get(task, 0.0)) for task in tasks
    }


class VLMgineer(EvolutionStrategy):
    """Ask for a fresh population as long as there are no elites, else for the elites' offspring.

    Args:
        designer: asks the model for candidates.
        budget: ``k_top``, ``reward_save`` and ``k_least`` are read here.
        elites_from: choose elites from the last generation and the ``best`` candidate so far, from the last
            ``generation`` alone (as the paper does), or from the whole ``run``.
    """

    def __init__(
        self,
        designer: Designer,
        budget: Budget,
        elites_from: Literal["best", "generation", "run"] = "best",
    ) -> None:
        super().__init__(designer, budget)
        self._elites_from = elites_from
        self._generation = 0
        self._pool: list[Evaluation] = []

    def ask(self) -> Iterator[Candidate]:
        elites = select(self._pool, self.budget, self.tie)
        return self.designer.design(self._generation, elites)

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        self._generation += 1
        best = best_first(self._pool, self.tie)
        kept = {
            "best": [*best[:1], *_best_by_task(best).values()],
            "generation": [],
            "run": self._pool,
        }[self._elites_from]
        self._pool = [*kept, *evaluations]
