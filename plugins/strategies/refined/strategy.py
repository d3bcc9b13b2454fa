"""Refine the numbers of good candidates by an evolution strategy, without asking a model."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Annotated, Any, cast

import numpy as np
from pydantic import PositiveInt

from core.config.compose import read_parts
from core.design import Candidate
from core.geometry import Array
from core.hooks import PartsOf
from core.interfaces import (
    Budget,
    Designer,
    EvolutionStrategy,
    ToolRepresentation,
)
from core.plugins import EVOLUTION
from core.search.assignment import AsksTeams
from core.trial import BY_REWARD, Evaluation, best_first, best_tools, rank
from plugins.strategies.refined.moves import move
from plugins.strategies.refined.variation import Variation

POPULATION = 12  # candidates that a start is given at a time
STARTS = (4, 2, 1)  # searches side by side; the best half goes on each time
UNTIL = (60, 120)  # rollouts after which that is so, however many there are
MORE = 0.3  # the chance of another move in the same candidate
TRIES = 20  # draws for a candidate that keeps the rules


class Refined(EvolutionStrategy):
    """After the generations of another strategy, refine its best candidates.

    The best candidates of different tools start side by side, each with a search of its own: a (1 + 12) evolution
    strategy (H.-G. Beyer and H.-P. Schwefel, "Evolution strategies: a comprehensive introduction", Natural Computing 1,
    2002). Each of twelve variants of the best so far makes a random move, or a few (`moves.move`), some of them
    toward other candidates that differ in numbers alone. After 60 rollouts the better half of the searches goes on, and
    after 120 the best one.

    Args:
        designer: asks the model for candidates; a `core.search.assignment.AsksTeams`.
        budget: see `core.interfaces.EvolutionStrategy`.
        of: the strategy that gives the first generations: a name, or a mapping of a ``name`` and settings.
        rollouts: the number of candidates that are tried in the refinement, at no cost in model calls.

    Raises:
        UserError: the other strategy can't be used.
    """

    refines = True

    def __init__(
        self,
        designer: Designer,
        budget: Budget,
        of: Annotated[str | dict[str, Any], PartsOf("evolution")] = "vlmgineer",
        rollouts: PositiveInt = 240,
    ) -> None:
        super().__init__(designer, budget)
        (named,) = read_parts(EVOLUTION, [of]).values()
        self._strategy = named.create(designer=designer, budget=budget)
        self.learns = self._strategy.learns
        self._variation = Variation(cast(AsksTeams, designer).assignment)
        self._rollouts = rollouts
        self._earlier: list[Evaluation] = []
        self._searches: list[NumberSearch] | None = None  # until the other has ended
        self._spent = 0
        self._generation = 0

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
            self._strategy.tie = self.tie
            return self._strategy.ask()

        return islice(self._vary(self._searches), self._rollouts - self._spent)

    def _vary(self, searches: Sequence[NumberSearch]) -> Iterator[Candidate]:
        for search in searches:
            yield from search.ask(self._generation)

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        """Pass the evaluations on to where their candidates came from."""
        self._generation += 1
        if self._searches is None:
            self._earlier += evaluations
            self._strategy.tell(evaluations)
            if not self._strategy.has_generation(self._generation, self.budget):
                self._searches = self._start()

            return

        self._spent += len(evaluations)
        for search in self._searches:
            search.tell([e for e in evaluations if e.candidate.agent == search.number])

        left = STARTS[sum(self._spent >= least for least in UNTIL)]
        order = best_first((search.best for search in self._searches), tie=0.0)
        ranks = {
            evaluation.candidate.id: place for place, evaluation in enumerate(order)
        }
        self._searches.sort(key=lambda search: ranks[search.best.candidate.id])
        del self._searches[left:]

    def _start(self) -> list[NumberSearch]:
        """Begin a search at the best candidate of each of the best tools that have numbers to vary."""
        earned = [e.candidate for e in self._earlier if e.reward > 0]
        searches: list[NumberSearch] = []
        for best in best_tools(best_first(self._earlier, self.tie)):
            if best.reward <= 0:
                continue
            if len(self._variation.parameters(best.candidate)) > 1:
                number = len(searches)
                searches.append(NumberSearch(number, self._variation, best, earned))
            if len(searches) == STARTS[0]:
                break

        return searches


class NumberSearch:
    """The search that begins at one evaluation; ``number`` stands in its candidates' ids as that of an agent.

    Args:
        number: its own.
        variation: varies the candidate.
        start: where it begins.
        earned: candidates toward which it may move.
    """

    def __init__(
        self,
        number: int,
        variation: Variation,
        start: Evaluation,
        earned: Sequence[Candidate],
    ) -> None:
        self.number = number
        self.best = start
        self._variation = variation
        self._start = start.candidate
        self._numbers = variation.parameters(start.candidate)
        self._values = self._numbers.values
        self._asked: dict[str, Array] = {}
        self._yielded = {start.candidate.content}
        others = [
            variation.toward(start.candidate, other)
            for other in earned
            if other.id != start.candidate.id
        ]
        self._others = np.array([values for values in others if values is not None])
        self._rng = np.random.default_rng(int(start.candidate.content[:8], 16))

    def ask(self, generation: int) -> Iterator[Candidate]:
        """Yield a population; what breaks a rule, or was yielded before, is drawn again."""
        for strategy in range(POPULATION):
            key = (generation, self.number, strategy, 0)
            for _ in range(TRIES):
                values = self._move()
                candidate = self._variation.vary(self._start, values, key)
                is_new = candidate.content not in self._yielded
                if candidate.problem is None and is_new:
                    break

            self._yielded.add(candidate.content)
            self._asked[candidate.id] = values
            yield candidate

    def _move(self) -> Array:
        """Return the values after a random move, or a few."""
        values = self._values
        while True:
            values = move(self._numbers, values, self._others, self._rng)
            if self._rng.random() >= MORE:
                return values

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        """Take what a population earned, and go on from the best so far; what is not worse is taken, too."""
        found = best_first(evaluations, tie=0.0)[:1]
        best = rank([*found, self.best], BY_REWARD)[0]
        if best is not self.best:
            self.best = best
            self._values = self._asked[best.candidate.id]

        self._asked.clear()
