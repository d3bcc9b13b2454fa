"""Checks that every strategy must pass. Each takes a factory, ``make(designer, budget)``: a search has a memory."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from itertools import chain

import numpy as np

from core.design import Candidate
from core.errors import LimitReached
from core.interfaces import Budget, Designer, EvolutionStrategy, Seen, Waypoints
from core.plugins import ACTION, installed
from core.search.assignment import Assignment, Team
from core.trial import Evaluation
from plugins.conformance.evaluations import tried_once
from plugins.conformance.sample_tools import LengthOnly, rigid
from plugins.conformance.shared import expect_a, some_task

Make = Callable[[Designer, Budget], EvolutionStrategy]
BUDGET = Budget(
    n_agent=2, n_tool=1, n_action=3, n_iteration=2, k_top=2, reward_save=0.2
)


class FreeDesigner:
    """A designer whose candidates cost nothing. With ``limit`` only so many agents answer."""

    def __init__(self, limit: int = BUDGET.n_agent) -> None:
        self.limit = limit
        self.limit_reached = False
        actions = installed().create(ACTION, "waypoints")
        self.assignment = Assignment(some_task(), LengthOnly(), actions, BUDGET, seed=0)

    def design(
        self, generation: int, elites: Sequence[Evaluation] = ()
    ) -> Iterator[Candidate]:
        rng = np.random.default_rng([generation, len(elites)])
        for agent in range(BUDGET.n_agent):
            if agent >= self.limit:
                self.limit_reached = True
                raise LimitReached("no more may be spent")

            for action in range(BUDGET.n_action):
                plan = np.array([[*rng.uniform(0.3, 0.5, 3), 0.0, 0.0, 0.0]])
                yield Candidate(rigid(), Waypoints(plan), generation, agent, 0, action)

    def design_in(self, generation: int, teams: Sequence[Team]) -> Iterator[Candidate]:
        elites = {id(elite): elite for team in teams for elite in team.elites}
        return self.design(generation, list(elites.values()))


def _first_x(candidate: Candidate) -> float:
    return float(candidate.plan.resolve(Seen({})).poses[0, 0])


def _search(
    make: Make, earns: Callable[[Candidate], float] = _first_x
) -> list[list[Candidate]]:
    """Ask and tell for three generations, as the loop does, and return their candidates."""
    strategy = make(FreeDesigner(), BUDGET)
    generations = []
    for _ in range(3):
        candidates = list(strategy.ask())
        evaluations = []
        for candidate in sorted(candidates, key=lambda candidate: candidate.key):
            expect_a(Candidate, candidate, "ask returned")
            evaluations.append(tried_once(candidate, "ok", earns(candidate), 1.0))

        generations.append(candidates)
        strategy.tell(evaluations)

    return generations


def check_each_generation_has_candidates(make: Make) -> None:
    generations = _search(make)
    for number, candidates in enumerate(generations):
        assert candidates, f"generation {number} has no candidates"

    counts = Counter(candidate.id for candidate in chain(*generations))
    shared = ", ".join(sorted(name for name, count in counts.items() if count > 1))
    assert not shared, (
        f"candidates of one run share the ids {shared}; number generations"
    )


def check_a_search_goes_on_when_nothing_is_earned(make: Make) -> None:
    assert all(_search(make, lambda _: 0.0)), (
        "after generations that earned nothing there are no candidates"
    )


def check_generations_may_be_empty_or_broken(make: Make) -> None:
    strategy = make(FreeDesigner(), BUDGET)
    strategy.tell([])
    candidates = list(strategy.ask())
    assert candidates, "after an empty generation there are no candidates"
    broken = [tried_once(found, "failed", reason="it broke") for found in candidates]
    strategy.tell(broken)
    candidates = list(strategy.ask())
    assert candidates, "after a generation that failed there are no candidates"


def check_the_same_again(make: Make) -> None:
    """The same evaluations give the same candidates, so that a run can be repeated and resumed."""
    first, again = (chain(*_search(make)) for _ in range(2))
    assert [c.content for c in first] == [c.content for c in again], (
        "the same evaluations gave different candidates; draw from a seed that is a setting"
    )


def check_a_limit_is_passed_on(make: Make) -> None:
    """The designer's LimitReached is raised after the candidates before it; who asks no designer meets none."""
    designer = FreeDesigner(limit=1)
    candidates = []
    try:
        for candidate in make(designer, BUDGET).ask():
            candidates.append(candidate)
    except LimitReached:
        assert candidates, "candidates before the limit are lost"
        return

    assert not designer.limit_reached, (
        "the designer's LimitReached is swallowed; pass it on"
    )
