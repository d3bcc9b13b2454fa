"""What any strategy must satisfy: each check takes a factory, ``make(designer, budget)``, since a search has a memory,
and raises an AssertionError that says what is wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from core.conformance.checking import expect, rigid
from core.design import Candidate, Evaluation
from core.errors import LimitReached
from core.interfaces import Budget, Designer, EvolutionStrategy

Make = Callable[[Designer, Budget], EvolutionStrategy]
BUDGET = Budget(n_agent=2, n_tool=1, n_action=3, n_iteration=2, k_top=2, reward_save=0.2)


class Dealer:
    """A designer whose candidates cost nothing; notes what it was asked for."""

    def __init__(self, limit: int | None = None) -> None:
        self.asked: list[tuple[int, int]] = []  # generation, number of elites
        self.limit = limit

    def design(self, generation: int, elites: Sequence[Evaluation] = ()) -> Iterator[Candidate]:
        self.asked.append((generation, len(elites)))
        rng = np.random.default_rng([generation, len(elites)])
        for agent in range(BUDGET.n_agent):
            if self.limit is not None and agent >= self.limit:
                raise LimitReached("no more may be spent")
            for action in range(BUDGET.n_action):
                plan = np.array([[*rng.uniform(0.3, 0.5, 3), 0.0, 0.0, 0.0]])
                yield Candidate(rigid(), plan, generation, agent, 0, action)


def run(strategy: EvolutionStrategy, generations: int, earns: Callable[[Candidate], float]) -> list[list[Candidate]]:
    """Ask and tell, as the loop does."""
    came = []
    for _ in range(generations):
        candidates = list(strategy.ask())
        for candidate in candidates:
            expect(isinstance(candidate, Candidate), f"ask gave a {type(candidate).__name__}, not a Candidate")
        came.append(candidates)
        ordered = sorted(candidates, key=lambda candidate: candidate.key)
        strategy.tell([Evaluation(candidate, "ok", reward=earns(candidate), distance_m=1.0) for candidate in ordered])
    return came


def by_place(candidate: Candidate) -> float:
    return float(candidate.plan[0, 0])


def check_each_generation_has_candidates(make: Make) -> None:
    came = run(make(Dealer(), BUDGET), 3, by_place)
    for number, candidates in enumerate(came):
        expect(candidates, f"generation {number} has no candidates")
    ids = [candidate.id for candidates in came for candidate in candidates]
    twice = sorted({one for one in ids if ids.count(one) > 1})
    expect(not twice, f"candidates of one run share the ids {', '.join(twice)}; number generations")


def check_nothing_earned_is_no_end(make: Make) -> None:
    came = run(make(Dealer(), BUDGET), 3, lambda _: 0.0)
    expect(all(came), "after generations that earned nothing, none came")


def check_generations_may_be_empty_or_broken(make: Make) -> None:
    strategy = make(Dealer(), BUDGET)
    strategy.tell([])
    candidates = list(strategy.ask())
    expect(candidates, "after an empty generation, none came")
    strategy.tell([Evaluation(candidate, "failed", reason="it broke") for candidate in candidates])
    expect(list(strategy.ask()), "after a generation that broke, none came")


def check_the_same_again(make: Make) -> None:
    """The same evaluations give the same candidates: a run can be repeated, and goes on where it was."""
    one, other = (run(make(Dealer(), BUDGET), 3, by_place) for _ in range(2))
    same = [[c.content for c in generation] for generation in one] == [[c.content for c in g] for g in other]
    expect(same, "two searches that were told the same asked for different candidates; draw from a seed that is set")


def check_a_limit_is_passed_on(make: Make) -> None:
    """What came before it is not lost."""
    came, told = [], False
    try:
        for candidate in make(Dealer(limit=1), BUDGET).ask():
            came.append(candidate)
    except LimitReached:
        told = True
    expect(told, "the designer's LimitReached is to be passed on, and was swallowed")
    expect(came, "candidates that came before the limit was reached are lost")


CHECKS = (
    check_each_generation_has_candidates,
    check_nothing_earned_is_no_end,
    check_generations_may_be_empty_or_broken,
    check_the_same_again,
    check_a_limit_is_passed_on,
)
