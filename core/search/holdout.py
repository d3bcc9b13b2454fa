"""Try the best candidate where the search never looked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from core.design import Candidate, Evaluation
from core.errors import UserError, fault
from core.interfaces import Evaluate, Executor, Fitness

_Job = tuple[str, int]  # the engine, and the trial's number


@dataclass(frozen=True)
class _Trials:
    """A picklable function of jobs: each is a trial of the candidate."""

    trials: Mapping[str, Sequence[Evaluate]]
    candidate: Candidate

    def __call__(self, jobs: Sequence[_Job]) -> list[Evaluation]:
        return [self.trials[engine][number]([self.candidate])[0] for engine, number in jobs]


def try_unseen(best: Evaluation, fitness: Fitness, executor: Executor) -> dict[str, tuple[float, ...]]:
    """Return the rewards of the best candidate in the fitness's unseen trials, by engine. A trial that fails counts 0.

    Raises:
        UserError: the machine is at fault for a trial that failed.
    """
    trials = fitness.unseen()
    jobs = [[(engine, number)] for engine, of in trials.items() for number in range(len(of))]
    earned: dict[_Job, float] = {}
    for (job,), result in executor.map(_Trials(trials, best.candidate), jobs):
        if isinstance(result, Exception) and (machine := fault(result)) is not None:
            raise UserError(f"the best candidate can't be tried in unseen layouts: {machine}")
        earned[job] = 0.0 if isinstance(result, Exception) else float(result[0].reward)
    return {engine: tuple(earned[engine, number] for number in range(len(of))) for engine, of in trials.items()}
