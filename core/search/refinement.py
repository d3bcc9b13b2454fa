"""Refine the numbers of good candidates by an evolution strategy, without asking a model."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path

import numpy as np

from core.design import Candidate
from core.errors import UsageError
from core.geometry import Array
from core.interfaces import (
    Budget,
    Designer,
    EvolutionStrategy,
    Numbers,
    ToolRepresentation,
)
from core.search.variation import Variation
from core.trial import Evaluation, best_first, best_tools

POPULATION = 12  # candidates that a start is given at a time
STARTS = (
    4,
    2,
    1,
)  # candidates that are refined side by side, and go on: the best half of them each time
UNTIL = (
    60,
    120,
)  # rollouts after which that is so; it does not depend on their number, which may be raised later
MORE = 0.3  # the chance of another move in the same candidate
TRIES = 20  # draws for a candidate that keeps the rules


class Refinement(EvolutionStrategy):
    """After the generations of another strategy, refine its best candidates.

    The best candidates of different tools start side by side, each with a search of its own: a (1 + 12) evolution
    strategy (H.-G. Beyer and H.-P. Schwefel, "Evolution strategies: a comprehensive introduction", Natural Computing 1,
    2002). Each of twelve variants of the best so far makes a random move, or a few (`Numbers.moved`), some of them
    toward other candidates that differ in numbers alone. After 60 rollouts the better half of the searches goes on, and
    after 120 the best one.

    Args:
        strategy: gives the first generations.
        designer: see `core.interfaces.EvolutionStrategy`.
        variation: varies the candidates.
        rollouts: the number of candidates that are tried here.

    Raises:
        UsageError: ``rollouts`` is no whole number above 0.
    """

    def __init__(
        self,
        strategy: EvolutionStrategy,
        designer: Designer,
        variation: Variation,
        rollouts: int,
    ) -> None:
        if type(rollouts) is not int or rollouts < 1:
            raise UsageError(
                f"evolution.refine must be a whole number from 0 on; got {rollouts!r}"
            )
        super().__init__(designer, strategy.budget, strategy.tie)
        self._strategy = strategy
        self._varies = variation
        self._rollouts = rollouts
        self._earlier: list[Evaluation] = []
        self._searches: list[_Search] | None = (
            None  # until the other strategy has come to its end
        )
        self._spent, self._generation = 0, 0

    def write_archive(
        self,
        ranking: Sequence[Evaluation],
        representation: ToolRepresentation,
        folder: Path,
    ) -> None:
        """Pass on what the other strategy hands over."""
        self._strategy.write_archive(ranking, representation, folder)

    def has_generation(self, generation: int, budget: Budget) -> bool:
        """Report whether the other strategy goes on, or rollouts are left."""
        if self._searches is None:
            return self._strategy.has_generation(generation, budget)
        return bool(self._searches) and self._spent < self._rollouts

    def ask(self) -> Iterator[Candidate]:
        """Yield the other strategy's candidates, and later the varied ones."""
        if self._searches is None:
            return self._strategy.ask()
        asked = (
            candidate
            for search in self._searches
            for candidate in search.ask(self._generation)
        )
        return islice(asked, self._rollouts - self._spent)

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        """Pass the evaluations on to where their candidates came from."""
        self._generation += 1
        if self._searches is None:
            self._earlier += evaluations
            self._strategy.tell(evaluations)
            if not self._strategy.has_generation(self._generation, self.budget):
                self._searches = self._started()
            return
        self._spent += len(evaluations)
        for search in self._searches:
            search.tell([e for e in evaluations if e.candidate.agent == search.number])
        count = STARTS[sum(self._spent >= least for least in UNTIL)]
        self._searches = sorted(
            self._searches, key=lambda search: search.best, reverse=True
        )[:count]

    def _started(self) -> list[_Search]:
        best = [
            e for e in best_tools(best_first(self._earlier, self.tie)) if e.reward > 0
        ]
        found = [(e, self._varies.parameters(e.candidate)) for e in best]
        varied = [(e, numbers) for e, numbers in found if len(numbers) > 1][: STARTS[0]]
        earned = [e.candidate for e in self._earlier if e.reward > 0]
        return [
            _Search(number, self._varies, *start, earned)
            for number, start in enumerate(varied)
        ]


class _Search:
    """The search that begins at one evaluation; ``number`` stands in its candidates' ids as that of an agent."""

    def __init__(
        self,
        number: int,
        variation: Variation,
        start: Evaluation,
        numbers: Numbers,
        earned: Sequence[Candidate],
    ) -> None:
        self.number, self.best = number, start.reward
        self._variation = variation
        self._start = start.candidate
        self._numbers = numbers
        self._values, self._asked = numbers.values, dict[str, Array]()
        others = [
            variation.toward(start.candidate, other)
            for other in earned
            if other.id != start.candidate.id
        ]
        self._others = np.array([values for values in others if values is not None])
        self._rng = np.random.default_rng(int(start.candidate.content[:8], 16))

    def ask(self, generation: int) -> Iterator[Candidate]:
        """Yield a population; what breaks a rule is drawn again."""
        for strategy in range(POPULATION):
            for _ in range(TRIES):
                values = self._moved()
                candidate = self._variation.vary(
                    self._start, values, (generation, self.number, strategy, 0)
                )
                if candidate.problem is None:
                    break
            self._asked[candidate.id] = values
            yield candidate

    def _moved(self) -> Array:
        values = self._values
        while True:
            values = self._numbers.moved(values, self._others, self._rng)
            if self._rng.random() >= MORE:
                return values

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        """Take the rewards of a population, and go on from the best that is not worse."""
        best = max(evaluations, key=lambda evaluation: evaluation.reward, default=None)
        if best is not None and best.reward >= self.best:
            self.best, self._values = best.reward, self._asked[best.candidate.id]
        self._asked.clear()
