"""Try the best candidate where the search never looked."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from core.design import Candidate, Evaluation
from core.errors import UserError, fault
from core.interfaces import Evaluate, Executor, Fitness

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
    tell: Callable[[Job, float], None] = lambda job, reward: None,
) -> list[dict[str, tuple[float, ...]]]:
    """Return the rewards of each candidate in all trials, by engine. A trial that fails counts 0.

    Those that are ``known`` are not tried; ``tell`` is called after each that was.

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
        tell(job, earned[job])
    return [
        {engine: tuple(earned[n, engine, k] for k in each) for engine, each in counts.items()}
        for n in range(len(candidates))
    ]


def try_unseen(best: Evaluation, fitness: Fitness, executor: Executor) -> dict[str, tuple[float, ...]]:
    """Return the rewards of the best candidate in the fitness's unseen trials, by engine (`try_all`)."""
    return try_all([best.candidate], fitness.unseen(), executor)[0]
