"""Choose the winner among candidates that earn alike by trials in more layouts, and try it where no search looked.

Successive halving (K. Jamieson and A. Talwalkar, "Non-stochastic best arm identification and hyperparameter
optimization", AISTATS 2016): all finalists are tried a little, and the better half of them goes on, until one is left
or the layouts that the run may try are spent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import islice

import numpy as np
import pluggy

from core.design import Candidate
from core.events import Result
from core.interfaces import Fitness
from core.search.trials import Trials
from core.trial import Condition, Evaluation, Rewards, Trial
from core.values.efforts import Effort

MOST = 12  # finalists
FIRST = (
    2  # layouts of the first round; each later round doubles what a finalist has had
)


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
    ranking = result.ranking
    highest = max((evaluation.reward for evaluation in ranking), default=0.0)
    if highest <= 0:
        return []
    alike: dict[str, Evaluation] = {}
    for evaluation in ranking:
        if evaluation.reward >= highest - result.tie:
            alike.setdefault(evaluation.candidate.content, evaluation)
    return list(alike.values())[:most]


def choose(
    result: Result,
    fitness: Fitness,
    trials: Trials,
    events: pluggy.PluginManager,
    most: int,
) -> tuple[Evaluation, dict[str, Rewards]]:
    """Return the winner of a run in which something was tried, and what finalists earned, by their ids and engine.

    What counts is the mean in the engine where it is the lowest, of at most ``most`` layouts in each. Means within the
    run's tie are equal; then the order of the ranking decides, that is the distance. Without `Fitness.finals`, or with
    one finalist, the winner is the first of the ranking and nothing is tried. Listeners hear of each finalist after
    each round.

    Raises:
        UserError: the machine is at fault for a trial that failed.
    """
    left = finalists(result) or result.ranking[:1]
    layouts = islice(fitness.finals(), most)
    finals: dict[str, tuple[Trial, ...]] = {e.candidate.id: () for e in left}
    had = 0  # layouts, so far
    while len(left) > 1:
        drawn = list(islice(layouts, had or FIRST))
        if not drawn:
            break
        had += len(drawn)
        conditions = [condition for alike in drawn for condition in alike]
        tried = _try_all(trials, conditions, [e.candidate for e in left])
        for finalist in left:
            name = finalist.candidate.id
            finals[name] += tried[name]
            events.hook.finalist_tried(
                evaluation=replace(finalist, finals=finals[name])
            )

        earned = [fitness.rewards(finals[e.candidate.id]) for e in left]
        left = _keep_better_half(left, earned, result.tie)

    winner = replace(left[0], finals=finals[left[0].candidate.id])
    earned_by = {}
    for name, known in finals.items():
        if known:
            earned_by[name] = fitness.rewards(known)
    return winner, earned_by


def _try_all(
    trials: Trials, conditions: Sequence[Condition], candidates: Sequence[Candidate]
) -> dict[str, tuple[Trial, ...]]:
    tried = trials.try_in(conditions, candidates)
    return {candidate.id: found for candidate, found in tried}


def _keep_better_half(
    ranked: Sequence[Evaluation], rewards: Sequence[Rewards], tie: float
) -> list[Evaluation]:
    """Return the better half of finalists, rounded up, the best first; ``ranked`` is the order of those alike."""
    means = [
        min(float(np.mean(earned)) for earned in by_engine.values())
        for by_engine in rewards
    ]
    left = list(range(len(ranked)))
    better: list[Evaluation] = []
    while len(better) < (len(ranked) + 1) // 2:
        highest = max(means[number] for number in left)
        first = next(number for number in left if means[number] >= highest - tie)
        better.append(ranked[first])
        left.remove(first)

    return better
