"""Checks that every strategy must pass. Each takes a factory, ``make(designer, budget)``: a search has a memory."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain

import numpy as np

from core.design import Candidate
from core.errors import LimitReached
from core.geometry import Array
from core.interfaces import (
    Budget,
    Designer,
    EvolutionStrategy,
    Seen,
    Waypoints,
)
from core.plugins import ACTION, installed
from core.search.assignment import Assignment, Team
from core.trial import Evaluation
from plugins.conformance.evaluations import tried_once
from plugins.conformance.shared import LengthOnly, expect, expect_a, rigid, some_task

Make = Callable[[Designer, Budget], EvolutionStrategy]
BUDGET = Budget(
    n_agent=2, n_tool=1, n_action=3, n_iteration=2, k_top=2, reward_save=0.2
)


class FreeDesigner:
    """A designer whose candidates cost nothing. With ``limit`` only so many agents answer."""

    def __init__(self, limit: int | None = None) -> None:
        self.limit = limit
        self.limit_reached = False
        self.assignment = Assignment(
            some_task(),
            LengthOnly(),
            installed().create(ACTION, "waypoints"),
            BUDGET,
            seed=0,
        )

    def design(
        self, generation: int, elites: Sequence[Evaluation] = ()
    ) -> Iterator[Candidate]:
        rng = np.random.default_rng([generation, len(elites)])
        for agent in range(BUDGET.n_agent):
            if self.limit is not None and agent >= self.limit:
                self.limit_reached = True
                raise LimitReached("no more may be spent")

            for action in range(BUDGET.n_action):
                plan = np.array([[*rng.uniform(0.3, 0.5, 3), 0.0, 0.0, 0.0]])
                yield Candidate(rigid(), Waypoints(plan), generation, agent, 0, action)

    def design_in(self, generation: int, teams: Sequence[Team]) -> Iterator[Candidate]:
        elites: dict[int, Evaluation] = {}
        for team in teams:
            elites |= {id(elite): elite for elite in team.elites}

        return self.design(generation, list(elites.values()))


def _plan(candidate: Candidate) -> Array:
    first: Array = candidate.plan.resolve(Seen({})).poses[0]
    return first


def search(
    make: Make, earns: Callable[[Candidate], float] = lambda c: float(_plan(c)[0])
) -> list[list[Candidate]]:
    """Ask and tell for three generations, as the loop does, and return their candidates."""
    strategy = make(FreeDesigner(), BUDGET)
    generations = []
    for _ in range(3):
        candidates = list(strategy.ask())
        for candidate in candidates:
            expect_a(Candidate, candidate, "ask returned")

        generations.append(candidates)
        ordered = sorted(candidates, key=lambda candidate: candidate.key)
        strategy.tell(
            [
                tried_once(candidate, "ok", earns(candidate), 1.0)
                for candidate in ordered
            ]
        )

    return generations


def check_each_generation_has_candidates(make: Make) -> None:
    generations = search(make)
    for number, candidates in enumerate(generations):
        expect(candidates, f"generation {number} has no candidates")

    counts = Counter(candidate.id for candidate in chain(*generations))
    shared = ", ".join(sorted(name for name, count in counts.items() if count > 1))
    expect(
        not shared,
        f"candidates of one run share the ids {shared}; number generations",
    )


def check_a_search_goes_on_when_nothing_is_earned(make: Make) -> None:
    expect(
        all(search(make, lambda _: 0.0)),
        "after generations that earned nothing there are no candidates",
    )


def check_generations_may_be_empty_or_broken(make: Make) -> None:
    strategy = make(FreeDesigner(), BUDGET)
    strategy.tell([])
    candidates = list(strategy.ask())
    expect(candidates, "after an empty generation there are no candidates")
    strategy.tell(
        [tried_once(candidate, "failed", reason="it broke") for candidate in candidates]
    )
    expect(
        list(strategy.ask()), "after a generation that failed there are no candidates"
    )


def _contents(generations: Iterable[Sequence[Candidate]]) -> list[list[str]]:
    """What the candidates of each generation consist of."""
    contents = []
    for candidates in generations:
        contents.append([candidate.content for candidate in candidates])

    return contents


def check_the_same_again(make: Make) -> None:
    """The same evaluations give the same candidates, so that a run can be repeated and resumed."""
    first = _contents(search(make))
    second = _contents(search(make))
    expect(
        first == second,
        "the same evaluations gave different candidates; draw from a seed that is a setting",
    )


def check_a_limit_is_passed_on(make: Make) -> None:
    """The designer's LimitReached is raised after the candidates before it; who asks no designer meets none."""
    designer = FreeDesigner(limit=1)
    candidates = []
    try:
        for candidate in make(designer, BUDGET).ask():
            candidates.append(candidate)
    except LimitReached:
        expect(candidates, "candidates before the limit are lost")
        return

    expect(
        not designer.limit_reached,
        "the designer's LimitReached is swallowed; pass it on",
    )
