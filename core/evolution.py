"""The loop: ask for candidates, evaluate them, tell what they earned; until the budget or the goal is reached."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence

import pluggy

from core.design import Candidate, Evaluation
from core.interfaces import Budget, EvolutionStrategy, Executor
from core.record import Generation, Result

CHUNK = 8  # candidates of one tool that travel to a worker together

Evaluate = Callable[[Sequence[Candidate]], list[Evaluation]]


def evolve(
    strategy: EvolutionStrategy, evaluate: Evaluate, executor: Executor, budget: Budget, events: pluggy.PluginManager
) -> Result:
    """Run ``budget.n_iteration`` + 1 generations, fewer if the best reward reaches ``budget.stop_reward``.

    ``evaluate`` is called in the executor's workers, with candidates of one tool.
    """
    began = time.monotonic()
    generations: list[Generation] = []
    for index in range(budget.n_iteration + 1):
        events.hook.generation_started(index=index)
        evaluations = []
        for evaluation in evaluate_all(strategy.ask(), evaluate, executor):
            events.hook.candidate_evaluated(evaluation=evaluation)
            evaluations.append(evaluation)
        evaluations.sort(key=lambda e: e.candidate.key)
        strategy.tell(evaluations)
        generation = Generation(index, tuple(evaluations))
        generations.append(generation)
        events.hook.generation_finished(generation=generation)
        best = generation.best
        if budget.stop_reward is not None and best is not None and best.reward >= budget.stop_reward:
            break
    return Result(tuple(generations), time.monotonic() - began)


def evaluate_all(candidates: Iterable[Candidate], evaluate: Evaluate, executor: Executor) -> Iterator[Evaluation]:
    """Of all candidates, as they finish. Where a chunk breaks, its candidates are tried again one by one."""
    broken: list[list[Candidate]] = []
    rejected: list[Evaluation] = []

    def tryable() -> Iterator[Candidate]:
        for candidate in candidates:
            if candidate.problem is None:
                yield candidate
            else:
                rejected.append(Evaluation(candidate, "rejected", reason=candidate.problem))

    for chunk, result in executor.map(evaluate, _chunks(tryable())):
        yield from rejected
        rejected.clear()
        if isinstance(result, Exception):
            broken += [[candidate] for candidate in chunk]
        else:
            yield from result
    yield from rejected
    for chunk, result in executor.map(evaluate, broken):
        if isinstance(result, Exception):
            yield Evaluation(chunk[0], "failed", reason=f"{type(result).__name__}: {result}")
        else:
            yield from result


def _chunks(candidates: Iterable[Candidate]) -> Iterator[list[Candidate]]:
    """Candidates in a row that share a tool, at most `CHUNK` of them."""
    chunk: list[Candidate] = []
    for candidate in candidates:
        if chunk and (len(chunk) == CHUNK or candidate.tool is not chunk[-1].tool):
            yield chunk
            chunk = []
        chunk.append(candidate)
    if chunk:
        yield chunk
