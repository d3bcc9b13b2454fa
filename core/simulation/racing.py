"""Try candidates in several trials, the next one only where it is needed: what has no hope stops early."""

from __future__ import annotations

import math
import time
from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, islice

import numpy as np

from core.design import Candidate, Evaluation
from core.errors import UsageError
from core.interfaces import Evaluate, Executor, Fitness
from core.simulation.robustness import mean, worst
from core.simulation.rollout import Evaluator

Combine = Callable[[Sequence[float]], float]

_ROUNDING = 1e-9  # in comparisons of rewards
SPREAD = 0.2  # the deviation of a difference of two rewards, before trials show what it is
LEAST_M = 0.02  # of a clearance: joints lag by up to half of it


def foreseeing(evaluator: Evaluator, clearance: float | None) -> Evaluator:
    """Set the clearance from which on an evaluator simulates nothing; None: it simulates all.

    Raises:
        UsageError: it is too small.
    """
    if clearance is not None and not clearance >= LEAST_M:
        raise UsageError(f"fitness.clearance must be null, or at least {LEAST_M:g} m, got {clearance}")
    return evaluator if clearance is None else replace(evaluator, clearance=clearance)


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
            own = [float(e.reward) for e in tried.every]
            errors = lead(best, own)
            if errors > self.behind:
                means = f"it earned {mean(own):.3g} on average, and the best one {mean(best):.3g}"
                return f"{means}: {errors:.2g} standard errors more; fitness.stop_behind is {self.behind:g}"
        most = min(combine(_filled(tried.tried.get(engine, ()), count, 1.0)) for engine, count in tried.counts.items())
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


def _filled(tried: Sequence[Evaluation], count: int, reward: float) -> list[float]:
    """The rewards of an engine's trials, with the same ``reward`` for those that are missing."""
    return [float(e.reward) for e in tried] + [reward] * (count - len(tried))


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
        return [evaluation for of in self.tried.values() for evaluation in of]

    def add(self, engine: str, evaluation: Evaluation, seconds: float) -> None:
        """Add a trial."""
        self.tried.setdefault(engine, []).append(evaluation)
        self.seconds += seconds

    def combined(self, combine: Combine = mean, trial: str = "change") -> Evaluation:
        """Combine its evaluations (`worst`): trials that it did not come to count 0."""
        found = worst(self.candidate, self.tried, combine, trial)
        tried, total = len(self.every), sum(self.counts.values())
        if tried == total:
            return found
        said = f"stopped after {tried} of {total} {trial}s: {self.stopped}"
        certain = [combine(_filled(self.tried.get(engine, ()), count, 0.0)) for engine, count in self.counts.items()]
        saved_s = found.saved_s + (total - tried) * self.seconds / tried
        warnings = (*found.warnings, said)
        return replace(found, reward=min(certain), warnings=warnings, planned=total, saved_s=saved_s)


def try_in_turn(
    candidates: Sequence[Candidate],
    evaluators: Mapping[str, Sequence[Evaluate]],
    combine: Combine,
    stops: Stops,
) -> list[Tried]:
    """Try each candidate with one evaluator of each engine after the other, until it stops.

    It competes with none, so `Stops.behind` does not count.
    """
    counts = {engine: len(of) for engine, of in evaluators.items()}
    found = [Tried(candidate, counts) for candidate in candidates]
    for number, (engine, evaluate) in enumerate(_in_order(evaluators), start=1):
        going = [trials for trials in found if not trials.stopped]
        if not going:
            break
        evaluations, seconds = _Timed(evaluate)([trials.candidate for trials in going])
        for trials, evaluation in zip(going, evaluations, strict=True):
            trials.add(engine, evaluation, seconds)
            if number < sum(counts.values()):
                trials.stopped = stops.why(trials, combine)
    return found


def race(
    chunks: Iterable[list[Candidate]],
    executor: Executor,
    evaluators: Mapping[str, Sequence[Evaluate]],
    combine: Combine,
    stops: Stops,
    earlier: Callable[[], Iterable[Evaluation]],
    combined: Callable[[Sequence[Tried]], list[Evaluation]],
) -> Iterator[tuple[list[Candidate], list[Evaluation] | Exception]]:
    """Try all candidates in a first trial, those that do not stop in a second one, and so on.

    Yields candidates with their evaluations, or with what went wrong, as `Executor.map` does.

    Candidates compete with each other and with those of ``earlier``, which is called after all of ``chunks`` were
    read. ``combined`` makes evaluations of their trials.
    """
    counts = {engine: len(of) for engine, of in evaluators.items()}
    trials: dict[tuple[int, ...], Tried] = {}
    last = sum(counts.values())
    for number, (engine, evaluate) in enumerate(_in_order(evaluators), start=1):
        tried: list[list[Tried]] = []
        for chunk, result in executor.map(_Timed(evaluate), chunks):
            if isinstance(result, Exception):
                yield chunk, result
                continue
            evaluations, seconds = result
            own = [trials.setdefault(candidate.key, Tried(candidate, counts)) for candidate in chunk]
            for of, evaluation in zip(own, evaluations, strict=True):
                of.add(engine, evaluation, seconds)
            tried.append(own)
        if number < last:
            going = list(chain.from_iterable(tried))
            rivals = [[float(e.reward) for e in of.every] for of in going]
            rivals += [rewards for e in earlier() if len(rewards := _first(e, counts, number)) == number]
            best = max(rivals, key=lambda rewards: (mean(rewards), rewards), default=())
            for of in going:
                of.stopped = stops.why(of, combine, best)
        for own in tried:
            ended = [of for of in own if of.stopped or number == last]
            if ended:
                yield [of.candidate for of in ended], combined(ended)
        chunks = [left for own in tried if (left := [of.candidate for of in own if not of.stopped])]


def _in_order(evaluators: Mapping[str, Sequence[Evaluate]]) -> list[tuple[str, Evaluate]]:
    return [(engine, evaluate) for engine, of in evaluators.items() for evaluate in of]


def _first(evaluation: Evaluation, engines: Iterable[str], number: int) -> list[float]:
    """Return the rewards of an evaluation's first ``number`` trials, or of as many as it has."""
    rewards = evaluation.by_engine
    return list(islice((reward for engine in engines for reward in rewards.get(engine, ())), number))


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
        found = self.evaluate(candidates)
        return found, (time.process_time() - began) / len(candidates)


class SeveralTrials(Fitness):
    """A fitness that tries each candidate several times, until it stops.

    Args:
        evaluators: one for each trial, by engine.
        combine: what becomes of an engine's rewards.
        stops: when a candidate stops.
    """

    def __init__(self, evaluators: Mapping[str, Sequence[Evaluate]], combine: Combine, stops: Stops) -> None:
        self._evaluators, self._combine, self._stops = evaluators, combine, stops

    @abstractmethod
    def combined(self, every: Sequence[Tried]) -> list[Evaluation]:
        """Make one evaluation of each candidate's trials, in order."""

    @property
    def batch(self) -> int:
        """The smallest batch among its engines."""
        return min(evaluate.batch for _, evaluate in _in_order(self._evaluators))

    def prepare(self) -> None:
        for _, evaluate in _in_order(self._evaluators):
            evaluate.prepare()

    def __call__(self, candidates: Sequence[Candidate]) -> list[Evaluation]:
        return self.combined(try_in_turn(candidates, self._evaluators, self._combine, self._stops))

    @property
    def races(self) -> bool:
        """Whether the candidates of a generation compete while they are tried."""
        return self._stops.behind is not None

    def race(
        self, chunks: Iterable[list[Candidate]], executor: Executor, earlier: Callable[[], Iterable[Evaluation]]
    ) -> Iterator[tuple[list[Candidate], list[Evaluation] | Exception]]:
        """Try all candidates of a generation in rounds; those that are behind stop (see `race`)."""
        return race(chunks, executor, self._evaluators, self._combine, self._stops, earlier, self.combined)
