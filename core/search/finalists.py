"""Choose the winner among candidates that earn alike by trials in more layouts, and try it where no search looked.

Successive halving (K. Jamieson and A. Talwalkar, "Non-stochastic best arm identification and hyperparameter
optimization", AISTATS 2016): all finalists are tried a little, and the better half of them goes on, until one is left
or the fitness has no more trials.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from types import MappingProxyType

import numpy as np
import pluggy

from core.design import Candidate, Evaluation, Trial
from core.errors import UserError, fault
from core.events import Result
from core.interfaces import Evaluate, Executor, Fitness
from core.values.efforts import Effort

MOST = 12  # finalists
FIRST = 2  # trials in each engine of the first round; each later round doubles what a finalist has had

Rewards = dict[str, tuple[float, ...]]
Job = tuple[int, str, int]  # the candidate's number, the engine, and the trial's number


@dataclass(frozen=True)
class _Trials:
    """A picklable function of jobs: each is a trial of a candidate."""

    trials: Mapping[str, Sequence[Evaluate]]
    candidates: Sequence[Candidate]

    def __call__(self, jobs: Sequence[Job]) -> list[Evaluation]:
        return [self.trials[engine][trial]([self.candidates[number]])[0] for number, engine, trial in jobs]


def try_all(
    candidates: Sequence[Candidate],
    trials: Mapping[str, Sequence[Evaluate]],
    executor: Executor,
    known: Mapping[Job, float] = MappingProxyType({}),
    tell: Callable[[Job, float, Sequence[Trial]], None] = lambda job, reward, trials: None,
) -> list[dict[str, tuple[float, ...]]]:
    """Return the rewards of each candidate in all trials, by engine. A trial that fails counts 0.

    Those that are ``known`` are not tried; ``tell`` is called after each that was, with its reward and
    what else is known of it.

    Raises:
        UserError: the machine is at fault for a trial that failed.
    """
    counts = {engine: range(len(each)) for engine, each in trials.items()}
    jobs = [[(n, engine, k)] for n in range(len(candidates)) for engine, each in counts.items() for k in each]
    earned = dict(known)
    for (job,), result in executor.map(_Trials(trials, candidates), [each for each in jobs if each[0] not in known]):
        if isinstance(result, Exception) and (machine := fault(result)) is not None:
            raise UserError(f"the best candidates can't be tried in more layouts: {machine}")
        earned[job] = 0.0 if isinstance(result, Exception) else float(result[0].reward)
        tell(job, earned[job], () if isinstance(result, Exception) else result[0].trials)
    return [
        {engine: tuple(earned[n, engine, k] for k in each) for engine, each in counts.items()}
        for n in range(len(candidates))
    ]


def try_unseen(
    best: Evaluation, fitness: Fitness, executor: Executor
) -> tuple[dict[str, tuple[float, ...]], Effort | None]:
    """Return the best candidate's rewards in the unseen trials of the fitness, by engine, and its effort there."""
    trials: dict[Job, Sequence[Trial]] = {}

    def tell(job: Job, reward: float, own: Sequence[Trial]) -> None:
        trials[job] = own

    (rewards,) = try_all([best.candidate], fitness.unseen(), executor, tell=tell)
    in_order = chain.from_iterable(trials[job] for job in sorted(trials))  # so that sums don't depend on the workers
    return rewards, replace(best, trials=tuple(in_order)).effort


def finalists(result: Result, most: int = MOST) -> list[Evaluation]:
    """Return those within the tie of the highest reward that were tried, the best first, of equal designs one."""
    highest = max((e.reward for e in result.ranking), default=0.0)
    tried = (e for e in reversed(result.ranking) if e.reward >= highest - result.tie)
    alike = {e.candidate.content: e for e in tried}
    return [*reversed(alike.values())][:most] if highest > 0 else []


def choose(
    result: Result, fitness: Fitness, executor: Executor, events: pluggy.PluginManager
) -> tuple[Evaluation, dict[str, Rewards]]:
    """Return the winner of a run in which something was tried, and what finalists earned, by their ids and engine.

    What counts is the mean in the engine where it is the lowest. Means within the run's tie are equal; then the order
    of the ranking decides, that is the distance. Without `Fitness.final`, or with one finalist, the winner is the
    first of the ranking and nothing is tried. What a finalist has in `Evaluation.final` is not tried again, and
    listeners hear of each trial that was.

    Raises:
        UserError: the machine is at fault for a trial that failed.
    """
    trials, left = fitness.final(), finalists(result) or result.ranking[:1]
    count = min(map(len, trials.values()), default=0)
    earned: dict[str, Rewards] = {e.candidate.id: dict.fromkeys(trials, ()) for e in left}
    tried = {e.candidate.id: e for e in left}
    done, until = 0, FIRST
    while done < count and len(left) > 1:
        part = {engine: list(each)[done : min(until, count)] for engine, each in trials.items()}
        names, begun = [e.candidate.id for e in left], done
        known = {
            (n, engine, number - done): reward
            for n, name in enumerate(names)
            for engine, number, reward in tried[name].final
            if engine in part and 0 <= number - done < len(part[engine])
        }

        def tell(
            job: Job, reward: float, trials: Sequence[Trial], names: Sequence[str] = names, begun: int = begun
        ) -> None:
            n, engine, number = job
            now = tried[names[n]]
            tried[names[n]] = replace(now, final=(*now.final, (engine, begun + number, reward)))
            events.hook.finalist_tried(evaluation=tried[names[n]])

        rounds = try_all([e.candidate for e in left], part, executor, known, tell)
        for finalist, rewards in zip(left, rounds, strict=True):
            own = earned[finalist.candidate.id]
            own.update({engine: own[engine] + rewards[engine] for engine in own})
        left = _better_half(left, [earned[e.candidate.id] for e in left], result.tie)
        done, until = min(until, count), 2 * until
    return left[0], {name: own for name, own in earned.items() if any(own.values())}


def _better_half(ranked: Sequence[Evaluation], rewards: Sequence[Rewards], tie: float) -> list[Evaluation]:
    """Return the better half of finalists, rounded up, the best first; ``ranked`` is the order of those alike."""
    means = [min(float(np.mean(own)) for own in each.values()) for each in rewards]
    left, order = list(range(len(ranked))), []
    while left:
        highest = max(means[n] for n in left)
        first = next(n for n in left if means[n] >= highest - tie)
        order.append(first)
        left.remove(first)
    return [ranked[n] for n in order[: -(-len(order) // 2)]]
