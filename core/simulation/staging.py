"""Try candidates in several trials, the next one only where it is needed: what has no hope stops early."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from core.design import SAVED, STOPPED, Candidate, Evaluation
from core.errors import UsageError
from core.interfaces import Evaluate
from core.simulation.robustness import mean, worst
from core.simulation.rollout import Evaluator

Combine = Callable[[Sequence[float]], float]

_ROUNDING = 1e-9  # in comparisons of rewards
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
        first: it stops when it earned no more than this in its first trial. It may earn more in others. None: never.

    Raises:
        UsageError: one is no reward below 1.
    """

    below: float | None = None
    first: float | None = None

    def __post_init__(self) -> None:
        for name, reward in (("below", self.below), ("first", self.first)):
            if reward is not None and not 0 <= reward < 1:
                raise UsageError(f"fitness.stop_{name} must be null, or from 0 to below 1, got {reward}")

    def instructions(self) -> str:
        """Return the sentences of the prompt that say when a plan is given up; empty: never."""
        said = {
            "as soon as it can't earn more than {:g} any more": self.below,
            "after the first trial, if that earned no more than {:g}": self.first,
        }
        when = ", or ".join(text.format(reward) for text, reward in said.items() if reward is not None)
        return when and f" A plan is given up {when}; trials that it has not come to count 0."

    def why(self, tried: Mapping[str, Sequence[Evaluation]], counts: Mapping[str, int], combine: Combine) -> str:
        """Say why a candidate stops after the trials of each engine, of ``counts`` there are; empty: it goes on."""
        trials = [evaluation for of in tried.values() for evaluation in of]
        if self.first is not None and trials[0].status != "rejected" and trials[0].reward <= self.first:
            return f"it earned {trials[0].reward:.3g} in the first, and fitness.stop_first is {self.first:g}"
        most = min(combine(_filled(tried.get(engine, ()), count, 1.0)) for engine, count in counts.items())
        if self.below is not None and most <= self.below + _ROUNDING:
            return f"it can't earn more than {most:.3g} any more, and fitness.stop_below is {self.below:g}"
        return ""


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

    def combined(self, combine: Combine = mean, trial: str = "change") -> Evaluation:
        """Combine its evaluations (`worst`): trials that it did not come to count 0."""
        found = worst(self.candidate, self.tried, combine, trial)
        every = [evaluation for of in self.tried.values() for evaluation in of]
        details = {key: value for key, value in found.details.items() if key != SAVED}
        saved = [evaluation.details[SAVED] for evaluation in every if SAVED in evaluation.details]
        left = sum(self.counts.values()) - len(every)
        if saved or left:
            seconds = sum(of["seconds"] for of in saved) + left * self.seconds / len(every)
            details[SAVED] = {"rollouts": len(saved) + left, "seconds": seconds}
        if not left:
            return replace(found, details=details)
        total = len(every) + left
        details[STOPPED] = {"after": len(every), "of": total}
        said = f"stopped after {len(every)} of {total} {trial}s: {self.stopped}"
        certain = [combine(_filled(self.tried.get(engine, ()), count, 0.0)) for engine, count in self.counts.items()]
        return replace(found, reward=min(certain), details=details, warnings=(*found.warnings, said))


def try_in_turn(
    candidates: Sequence[Candidate],
    evaluators: Mapping[str, Sequence[Evaluate]],
    combine: Combine,
    stops: Stops,
) -> list[Tried]:
    """Try each candidate with one evaluator of each engine after the other, until it stops."""
    counts = {engine: len(of) for engine, of in evaluators.items()}
    found = [Tried(candidate, counts) for candidate in candidates]
    order = [(engine, evaluate) for engine, of in evaluators.items() for evaluate in of]
    for number, (engine, evaluate) in enumerate(order, start=1):
        going = [trials for trials in found if not trials.stopped]
        if not going:
            break
        began = time.process_time()
        evaluations = evaluate([trials.candidate for trials in going])
        took = time.process_time() - began
        for trials, evaluation in zip(going, evaluations, strict=True):
            trials.tried.setdefault(engine, []).append(evaluation)
            trials.seconds += took / len(going)
            if number < len(order):
                trials.stopped = stops.why(trials.tried, counts, combine)
    return found
