"""Choose the candidates of which a prompt, a critic or a film strip tells most."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from itertools import zip_longest

from core.trial import Evaluation, best_first


def last_generation(tried: Iterable[Evaluation]) -> tuple[Evaluation, ...]:
    """Return the evaluations of the last generation among those that were tried, in the order of `Candidate.key`."""
    ordered = sorted(tried, key=lambda evaluation: evaluation.candidate.key)
    if not ordered:
        return ()
    last = ordered[-1].candidate.generation
    return tuple(e for e in ordered if e.candidate.generation == last)


REACHED = ("solved", "placed")
"""Outcomes of candidates that did what was wanted."""


def outcome_of(evaluation: Evaluation) -> str:
    """Name what became of a candidate: its class (`Observation.result`), ``rejected``, ``failed`` or ``invalid``."""
    if evaluation.status != "ok":
        return evaluation.status
    if evaluation.reason:
        return "invalid"
    if evaluation.observation is None:
        return "tried"
    return evaluation.observation.result


def most_telling(
    elites: Sequence[Evaluation], evaluations: Iterable[Evaluation]
) -> Iterator[Evaluation]:
    """Yield candidates from which most is learnt: the best elite, the most instructive failure, the next of each...

    The most instructive failure is the best candidate of the most frequent class of failure; of equally frequent
    classes, that of the class which got farther.
    """
    names = {elite.candidate.id for elite in elites}
    best: dict[str, Evaluation] = {}
    counts = Counter[str]()
    for evaluation in best_first(e for e in evaluations if e.candidate.id not in names):
        outcome = outcome_of(evaluation)
        if outcome not in REACHED:
            counts[outcome] += 1
            best.setdefault(outcome, evaluation)

    failures = [best[outcome] for outcome, _ in counts.most_common()]
    for pair in zip_longest(elites, failures):
        yield from filter(None, pair)
