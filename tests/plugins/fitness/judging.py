"""Try candidates as a fitness asks for it, in this process."""

from __future__ import annotations

from core.design import Candidate
from core.interfaces import Evaluation, Fitness
from core.search.trials import Trials
from tests.support.executors import Inline


def judged(
    fitness: Fitness, *candidates: Candidate, executor: Inline | None = None
) -> list[Evaluation]:
    """Evaluate candidates, and return their evaluations in the same order; ``executor`` keeps what was tried."""
    found = {
        e.candidate.key: e
        for e in Trials(executor or Inline()).evaluate(candidates, fitness)
    }
    return [found[candidate.key] for candidate in candidates]
