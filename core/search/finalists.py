"""Choose the winner among candidates that earn alike by trials in more layouts, and try it where no search looked.

Successive halving (K. Jamieson and A. Talwalkar, "Non-stochastic best arm identification and hyperparameter
optimization", AISTATS 2016): all finalists are tried a little, and the better half of them goes on, until one is left
or the fitness has no more conditions.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice

import numpy as np
import pluggy

from core.design import Candidate
from core.events import Result
from core.interfaces import Fitness
from core.search.trials import Trials
from core.trial import Condition, Evaluation, Trial
from core.values.efforts import Effort

MOST = 12  # finalists
FIRST = 2  # trials in each engine of the first round; each later round doubles what a finalist has had

Rewards = dict[str, tuple[float, ...]]


def try_unseen(
    best: Evaluation, fitness: Fitness, trials: Trials
) -> tuple[Rewards, Effort | None]:
    """Return the best candidate's rewards in the unseen conditions of the fitness, by engine, and its effort there."""
    conditions = fitness.unseen()
    if not conditions:
        return {}, None
    tried = _try_all(trials, conditions, [best.candidate])[best.candidate.id]
    return fitness.rewards(tried), replace(best, trials=tried).effort


def finalists(result: Result, most: int = MOST) -> list[Evaluation]:
    """Return those within the tie of the highest reward that were tried, the best first, of equal designs one."""
    highest = max((e.reward for e in result.ranking), default=0.0)
    tried = (e for e in reversed(result.ranking) if e.reward >= highest - result.tie)
    alike = {e.candidate.content: e for e in tried}
    return [*reversed(alike.values())][:most] if highest > 0 else []


def choose(
    result: Result, fitness: Fitness, trials: Trials, events: pluggy.PluginManager
) -> tuple[Evaluation, dict[str, Rewards]]:
    """Return the winner of a run in which something was tried, and what finalists earned, by their ids and engine.

    What counts is the mean in the engine where it is the lowest. Means within the run's tie are equal; then the order
    of the ranking decides, that is the distance. Without `Fitness.finals`, or with one finalist, the winner is the
    first of the ranking and nothing is tried. Listeners hear of each finalist after each round.

    Raises:
        UserError: the machine is at fault for a trial that failed.
    """
    left = finalists(result) or result.ranking[:1]
    more = fitness.finals()
    finals: dict[str, tuple[Trial, ...]] = {e.candidate.id: () for e in left}
    rounds = 0
    while len(left) > 1:
        conditions = _next_round(more, FIRST * 2 ** max(rounds - 1, 0))
        if not conditions:
            break
        rounds += 1
        tried = _try_all(trials, conditions, [e.candidate for e in left])
        for finalist in left:
            name = finalist.candidate.id
            finals[name] = (*finals[name], *tried[name])
            events.hook.finalist_tried(
                evaluation=replace(finalist, finals=finals[name])
            )
        earned = [fitness.rewards(finals[e.candidate.id]) for e in left]
        left = _better_half(left, earned, result.tie)
    winner = replace(left[0], finals=finals[left[0].candidate.id])
    return winner, {name: fitness.rewards(own) for name, own in finals.items() if own}


def _next_round(more: Iterator[Sequence[Condition]], count: int) -> list[Condition]:
    """Take the conditions of the next round: ``count`` in each engine and task."""
    return [condition for alike in islice(more, count) for condition in alike]


def _try_all(
    trials: Trials, conditions: Sequence[Condition], candidates: Sequence[Candidate]
) -> dict[str, tuple[Trial, ...]]:
    return {
        candidate.id: own for candidate, own in trials.try_in(conditions, candidates)
    }


def _better_half(
    ranked: Sequence[Evaluation], rewards: Sequence[Rewards], tie: float
) -> list[Evaluation]:
    """Return the better half of finalists, rounded up, the best first; ``ranked`` is the order of those alike."""
    means = [min(float(np.mean(own)) for own in each.values()) for each in rewards]
    left, order = list(range(len(ranked))), []
    while left:
        highest = max(means[n] for n in left)
        first = next(n for n in left if means[n] >= highest - tie)
        order.append(first)
        left.remove(first)
    return [ranked[n] for n in order[: -(-len(order) // 2)]]
