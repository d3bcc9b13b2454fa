"""``evolution=islands``: populations that evolve apart, and send each other their best now and then."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Annotated, cast

from pydantic import Field, PositiveInt

from core.design import Candidate
from core.errors import UsageError
from core.hooks import Harmless
from core.interfaces import Budget, Designer, EvolutionStrategy
from core.search.assignment import AsksTeams, Team
from core.trial import Evaluation, best_first, best_tools

STYLES = [
    "",
    "Prefer tools of few and simple components, and short motions.",
    "Prefer tools that work by another principle than the obvious one.",
]


class Islands(EvolutionStrategy):
    """Deal the agents to islands; on each, show them the island's own elites.

    Args:
        designer: asks the model for candidates; a `core.search.assignment.AsksTeams`.
        budget: ``k_top`` elites of each island are shown, which it admits.
        islands: their number, at most ``n_agent``.
        migrate: after every so many generations the best of each island goes to the next one too.
        patience: an island whose best has not improved by ``tie`` for so many generations starts from nothing.
        warmth: is added to the temperature on the last island, and taken from it on the first; evenly in between.
        styles: texts that are added to the prompts, one for each island in turn.

    Raises:
        UsageError: there are more islands than agents.
    """

    def __init__(
        self,
        designer: Designer,
        budget: Budget,
        islands: PositiveInt = 2,
        migrate: PositiveInt = 2,
        patience: PositiveInt = 3,
        warmth: float = 0.25,
        styles: Harmless[Annotated[list[str], Field(min_length=1)]] = STYLES,
    ) -> None:
        super().__init__(designer, budget)
        if islands > budget.n_agent:
            raise UsageError(
                f"evolution.islands is {islands}, but budget.n_agent is {budget.n_agent}; each needs one"
            )

        self._migrate = migrate
        self._patience = patience
        steps = max(islands - 1, 1)
        self._warmth = [
            warmth * (2 * k / steps - 1) if islands > 1 else 0.0 for k in range(islands)
        ]
        self._styles = [styles[k % len(styles)] for k in range(islands)]
        self._pools: list[list[Evaluation]] = [[] for _ in range(islands)]
        self._best = [0.0] * islands
        self._idle = [0] * islands  # generations without an improvement
        self._generation = 0

    def ask(self) -> Iterator[Candidate]:
        count = len(self._pools)
        teams = [
            Team(
                range(k, self.budget.n_agent, count),
                self._elites(k),
                self._warmth[k],
                self._styles[k],
            )
            for k in range(count)
        ]
        return cast(AsksTeams, self.designer).design_in(self._generation, teams)

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        """File what each island earned; restart those that idle, and then let the best of the others travel."""
        self._generation += 1
        count = len(self._pools)
        for evaluation in evaluations:
            self._pools[evaluation.candidate.agent % count].append(evaluation)

        travel = self._generation % self._migrate == 0
        best = [
            best_first(pool, self.tie)[:1] if travel else [] for pool in self._pools
        ]
        restarted = [self._restart(k) for k in range(count)]

        for k in range(count):
            if not restarted[k] and count > 1:
                self._pools[k] += best[k - 1]

    def _elites(self, k: int) -> list[Evaluation]:
        tools = best_tools(best_first(self._pools[k], self.tie))[: self.budget.k_top]
        admits = self.budget.admits
        return [e for place, e in enumerate(tools) if admits(place, e.reward)]

    def _restart(self, k: int) -> bool:
        """Empty an island that has not improved for too long; report whether it was."""
        highest = max(
            (e.reward for e in self._pools[k] if e.status == "ok"), default=0.0
        )
        improved = highest > self._best[k] + self.tie
        self._best[k] = max(highest, self._best[k])
        self._idle[k] = 0 if improved else self._idle[k] + 1
        if self._idle[k] < self._patience:
            return False

        self._pools[k] = []
        self._best[k] = 0.0
        self._idle[k] = 0

        return True
