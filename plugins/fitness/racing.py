"""Try candidates in several trials, the next one only where it is needed: what has no hope stops early."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, islice

import numpy as np

from core.design import Candidate, Evaluation
from core.errors import UsageError
from core.interfaces import Evaluate, Executor, Fitness, Raced
from core.simulation.robustness import mean, worst

Combine = Callable[[Sequence[float]], float]

_ROUNDING = 1e-9  # in comparisons of rewards
SPREAD = 0.2  # the deviation of a difference of two rewards, before trials show what it is


@dataclass(frozen=True)
class Stops:
    """When a candidate stops.

    Attributes:
        below: it stops when it can earn no more than this any more; it loses nothing that earns more. None: never.
        behind: it stops when it has earned less than the best one in the same trials, by so many standard errors of the
            mean difference. It may earn more in the others. None: never.

    Raises:
        UsageError: one is out of range.
    """

    below: float | None = None
    behind: float | None = None

    def __post_init__(self) -> None:
        if self.below is not None and not 0 <= self.below < 1:
            raise UsageError(f"fitness.stop_below must be null, or from 0 to below 1, got {self.below}")
        if self.behind is not None and not 0 < self.behind < math.inf:
            raise UsageError(f"fitness.stop_behind must be null, or above 0, got {self.behind}")

    def instructions(self) -> str:
        """Return the sentences of the prompt that say when a plan is given up; empty: never."""
        said = []
        if self.below is not None:
            said.append(f"as soon as it can't earn more than {self.below:g} any more")
        if self.behind is not None:
            said.append("as soon as it is clearly behind another one in the same trials")
        return f" A plan is given up {', or '.join(said)}; trials that it has not come to count 0." if said else ""

    def why(self, tried: Tried, combine: Combine, best: Sequence[float] = ()) -> str:
        """Say why a candidate stops after its trials so far; empty: it goes on.

        ``best`` is what the best one earned in the same trials. What was rejected each time goes on, since that costs
        little.
        """
        if self.behind is not None and best and any(e.status != "rejected" for e in tried.every):
            own = tried.rewards
            errors = lead(best, own)
            if errors > self.behind:
                means = f"it earned {mean(own):.3g} on average, and the best one {mean(best):.3g}"
                return f"{means}: {errors:.2g} standard errors more; fitness.stop_behind is {self.behind:g}"
        most = tried.least(combine, 1.0)
        if self.below is not None and most <= self.below + _ROUNDING:
            return f"it can't earn more than {most:.3g} any more, and fitness.stop_below is {self.below:g}"
        return ""


def lead(best: Sequence[float], own: Sequence[float]) -> float:
    """Compute by how many standard errors rewards are ahead of others in the same trials, on average.

    Rewards of the same trial are compared, since trials differ in how hard they are (as in the races of M. Birattari et
    al., "A racing algorithm for configuring metaheuristics", GECCO 2002). `SPREAD` counts as the deviation of one more
    difference, so that the first trial has an error too.
    """
    differences = np.subtract(best, own)
    deviations = differences - differences.mean()
    error = math.sqrt(SPREAD**2 + float(deviations @ deviations)) / len(differences)
    return float(differences.mean()) / error


@dataclass
class Tried:
    """What a candidate did in its trials so far.

    Attributes:
        candidate: the candidate.
        counts: how many trials there are in each engine.
        tried: the evaluations in each engine that it came to.
        seconds: the processor time that they took.
        stopped: why it was given up; empty: it was not.
    """

    candidate: Candidate
    counts: Mapping[str, int]
    tried: dict[str, list[Evaluation]] = field(default_factory=dict)
    seconds: float = 0.0
    stopped: str = ""

    @property
    def every(self) -> list[Evaluation]:
        """All its evaluations, engine by engine."""
        return [*chain.from_iterable(self.tried.values())]

    @property
    def rewards(self) -> list[float]:
        """Those of its trials."""
        return [float(evaluation.reward) for evaluation in self.every]

    def least(self, combine: Combine, missing: float) -> float:
        """Combine the rewards of each engine, and return the lowest; trials that are missing earn as given."""
        return min(
            combine([float(e.reward) for e in own] + [missing] * (count - len(own)))
            for own, count in ((self.tried.get(engine, []), count) for engine, count in self.counts.items())
        )

    def combined(self, combine: Combine, trial: str) -> Evaluation:
        """Combine its evaluations (`worst`): trials that it did not come to count 0."""
        made = worst(self.candidate, self.tried, combine, trial)
        tried, total = len(self.every), sum(self.counts.values())
        if tried == total:
            return made
        warnings = (*made.warnings, f"stopped after {tried} of {total} {trial}s: {self.stopped}")
        saved_s = (total - tried) * self.seconds / tried
        return replace(made, reward=self.least(combine, 0.0), warnings=warnings, planned=total, saved_s=saved_s)


@dataclass(frozen=True)
class _Timed:
    """Evaluate candidates, and measure the processor time of each, in seconds."""

    evaluate: Evaluate

    @property
    def batch(self) -> int:
        return self.evaluate.batch

    def prepare(self) -> None:
        self.evaluate.prepare()

    def __call__(self, candidates: Sequence[Candidate]) -> tuple[list[Evaluation], float]:
        began = time.process_time()
        made = self.evaluate(candidates)
        return made, (time.process_time() - began) / len(candidates)


@dataclass(eq=False)
class SeveralTrials(Fitness):
    """A fitness that tries each candidate several times, until it stops.

    Attributes:
        evaluators: one for each trial, by engine.
        combine: what becomes of an engine's rewards.
        stops: when a candidate stops.
        trial: what a trial is called.
    """

    evaluators: Mapping[str, Sequence[Evaluate]]
    combine: Combine
    stops: Stops
    trial: str

    @property
    def _in_order(self) -> list[tuple[str, Evaluate]]:
        return [(engine, evaluate) for engine, each in self.evaluators.items() for evaluate in each]

    def _begun(self, candidate: Candidate) -> Tried:
        return Tried(candidate, {engine: len(each) for engine, each in self.evaluators.items()})

    @property
    def batch(self) -> int:
        """The smallest batch among its engines."""
        return min(evaluate.batch for _, evaluate in self._in_order)

    def prepare(self) -> None:
        for _, evaluate in self._in_order:
            evaluate.prepare()

    def __call__(self, candidates: Sequence[Candidate]) -> list[Evaluation]:
        """Try each candidate until it stops; it competes with none, so `Stops.behind` does not count."""
        every = [self._begun(candidate) for candidate in candidates]
        for engine, evaluate in self._in_order:
            going = [tried for tried in every if not tried.stopped]
            if not going:
                break
            evaluations, seconds = _Timed(evaluate)([tried.candidate for tried in going])
            self._add(going, engine, evaluations, seconds)
            for tried in going:
                tried.stopped = self.stops.why(tried, self.combine)
        return self._combined(every)

    def _combined(self, every: Iterable[Tried]) -> list[Evaluation]:
        return [tried.combined(self.combine, self.trial) for tried in every]

    @staticmethod
    def _add(every: Sequence[Tried], engine: str, evaluations: Sequence[Evaluation], seconds: float) -> None:
        for tried, evaluation in zip(every, evaluations, strict=True):
            tried.tried.setdefault(engine, []).append(evaluation)
            tried.seconds += seconds

    def race(
        self, chunks: Iterable[list[Candidate]], executor: Executor, earlier: Callable[[], Iterable[Evaluation]]
    ) -> Iterator[Raced] | None:
        return None if self.stops.behind is None else self._race(chunks, executor, earlier)

    def _race(
        self, chunks: Iterable[list[Candidate]], executor: Executor, earlier: Callable[[], Iterable[Evaluation]]
    ) -> Iterator[Raced]:
        """Try all candidates in a first trial, those that do not stop in a second one, and so on."""
        trials: dict[tuple[int, ...], Tried] = {}
        order = self._in_order
        for number, (engine, evaluate) in enumerate(order, start=1):
            tried: list[list[Tried]] = []
            for chunk, result in executor.map(_Timed(evaluate), chunks):
                if isinstance(result, Exception):
                    yield chunk, result
                    continue
                own = [trials.setdefault(candidate.key, self._begun(candidate)) for candidate in chunk]
                self._add(own, engine, *result)
                tried.append(own)
            if number < len(order):
                going = list(chain.from_iterable(tried))
                rivals = [one.rewards for one in going]
                rivals += [rewards for e in earlier() if len(rewards := self._first(e, number)) == number]
                best = max(rivals, key=lambda rewards: (mean(rewards), rewards), default=())
                for one in going:
                    one.stopped = self.stops.why(one, self.combine, best)
            for own in tried:
                ended = [one for one in own if one.stopped or number == len(order)]
                if ended:
                    yield [one.candidate for one in ended], self._combined(ended)
            chunks = [left for own in tried if (left := [one.candidate for one in own if not one.stopped])]

    def _first(self, evaluation: Evaluation, number: int) -> list[float]:
        """Return the rewards of an evaluation's first ``number`` trials, or of as many as it has."""
        rewards = evaluation.by_engine
        return list(islice((reward for engine in self.evaluators for reward in rewards.get(engine, ())), number))
