"""Run the loop: ask for candidates, evaluate them, report to the strategy; until the budget or the goal is reached."""

from __future__ import annotations

import itertools
import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain

import pluggy

from core.design import Candidate, DesignError, Evaluation, Tool
from core.designs.rules import check_tool
from core.errors import LimitReached, UserError, fault
from core.events import INTERRUPTED, Generation, Result
from core.interfaces import CHUNK, Budget, EvolutionStrategy, Executor, Robot
from core.plugins import describe_part, installed
from core.plugins.blame import PluginError
from core.simulation.together import Together
from core.support.text import shorten
from core.support.threads import run_in_thread
from core.values.plans import digest

LINGER_S = 0.2  # how long a chunk waits for one more candidate, for an engine with large batches

Evaluate = Callable[[Sequence[Candidate]], list[Evaluation]]
Known = Callable[[Candidate], Evaluation | None]


def evolve(
    strategy: EvolutionStrategy,
    evaluate: Evaluate,
    executor: Executor,
    budget: Budget,
    events: pluggy.PluginManager,
    known: Known | None = None,
    robot: Robot | None = None,
) -> Result:
    """Run the generations of a strategy, fewer if the highest reward reaches ``budget.stop_reward``.

    ``evaluate`` is called in the executor's workers with candidates of one tool. If it has a ``batch`` above 1, it is
    called with all candidates that have arrived. Candidates whose evaluation is ``known`` are not evaluated. Tools must
    suit ``robot``, by default the default one. A limit that the strategy runs into, or an interrupt, ends the loop
    early (`Result.stopped`).
    """
    began = time.monotonic()
    trials = Trials(evaluate, executor, known)
    candidates = _UntilLimit(strategy, robot or installed().default_robot)
    arrived: list[list[Evaluation]] = []  # by generation
    generations: list[Generation] = []
    try:
        for index in itertools.takewhile(lambda number: strategy.goes_on(number, budget), itertools.count()):
            events.hook.generation_started(index=index)
            arrived.append([])
            for evaluation in trials(candidates):
                events.hook.candidate_evaluated(evaluation=evaluation)
                arrived[-1].append(evaluation)
            if candidates.limit is not None:
                break
            for evaluation in _joined(evaluate, arrived):
                events.hook.candidate_evaluated(evaluation=evaluation)
                arrived[-1].append(evaluation)
            generation = _generation(index, arrived[-1], strategy.tie)
            strategy.tell(generation.evaluations)
            generations.append(generation)
            events.hook.generation_finished(generation=generation)
            reached = generation.best_reward
            if budget.stop_reward is not None and reached is not None and reached >= budget.stop_reward:
                break
        stopped = candidates.limit
    except KeyboardInterrupt:  # the caller finds it in the result
        stopped = INTERRUPTED
    for index in range(len(generations), len(arrived)):  # the one that was cut short
        if arrived[index]:
            generations.append(_generation(index, arrived[index], strategy.tie))
    return Result(tuple(generations), time.monotonic() - began, stopped, strategy.tie)


def _joined(evaluate: Evaluate, arrived: Sequence[Sequence[Evaluation]]) -> Iterator[Evaluation]:
    """Yield for each tool of the last generation the best of all its plans for several tasks, if that is new."""
    if not isinstance(evaluate, Together):
        return
    tools: dict[str, list[Evaluation]] = {}
    for evaluation in sorted(chain.from_iterable(arrived), key=lambda e: e.candidate.key):
        if evaluation.status == "ok" and evaluation.candidate.tool is not None:
            tools.setdefault(digest(evaluation.candidate.tool.content), []).append(evaluation)
    for own in tools.values():
        now = [e.candidate.key for e in own if e.candidate.generation == len(arrived) - 1]
        if now:
            first = now[0][:3]
            action = 1 + max(e.candidate.action for e in arrived[-1] if e.candidate.key[:3] == first)
            made = evaluate.joined(own, (*first, action))
            yield from [made] if made is not None else []


def _generation(index: int, evaluations: Iterable[Evaluation], tie: float) -> Generation:
    return Generation(index, tuple(sorted(evaluations, key=lambda e: e.candidate.key)), tie)


class _UntilLimit:
    """A strategy's candidates, one generation for each iteration; ``limit`` says which limit ended the last one."""

    def __init__(self, strategy: EvolutionStrategy, robot: Robot) -> None:
        self._strategy, self._robot = strategy, robot
        self.limit: str | None = None
        self._sound: Tool | None = None  # the last that was checked; candidates in a row share one

    def __iter__(self) -> Iterator[Candidate]:
        """Raise UserError where the strategy gives something else; it names the strategy."""
        name = describe_part(self._strategy)
        try:
            candidates = self._strategy.ask()
            if not isinstance(candidates, Iterable):
                raise UserError(f"{name}: ask gave {candidates!r}; expected an iterator of Candidate")
            for candidate in candidates:
                if not isinstance(candidate, Candidate):
                    wrong = f"ask gave {shorten(repr(candidate))} among its candidates"
                    raise UserError(f"{name}: {wrong}; expected a Candidate")
                yield self._checked(candidate)
        except LimitReached as limit:
            self.limit = str(limit)

    def _checked(self, candidate: Candidate) -> Candidate:
        """Add a problem to a candidate whose tool breaks a rule: a strategy may build tools without the designer."""
        tool = candidate.tool
        if candidate.problem is None and tool is not None and tool.components and tool is not self._sound:
            try:
                check_tool(tool, self._robot)
            except DesignError as error:
                return replace(candidate, problem=f"{describe_part(self._strategy)} built a wrong tool: {error}")
            self._sound = tool
        return candidate


def evaluate_all(candidates: Iterable[Candidate], evaluate: Evaluate, executor: Executor) -> Iterator[Evaluation]:
    """Yield the evaluations of all candidates as they finish."""
    return Trials(evaluate, executor)(candidates)


class Trials:
    """Evaluates candidates in an executor's workers.

    Of candidates with the same `Candidate.content` one is tried, and all get its evaluation. Where a chunk
    fails, its candidates are tried again in smaller chunks, at last one by one. A candidate whose evaluation is
    ``known`` is not tried. Neither is one that the machine is at fault for: a UserError says so.
    """

    def __init__(
        self,
        evaluate: Evaluate,
        executor: Executor,
        known: Known | None = None,
    ) -> None:
        self._evaluate = evaluate
        self._batch = int(getattr(evaluate, "batch", 1))
        self._executor = executor
        self._known = known or (lambda _: None)
        self._lock = threading.Lock()  # executors may read chunks in a thread of their own
        self._earned: dict[str, Evaluation] = {}
        self._waiting: dict[str, list[Candidate]] = {}  # for the one of the same content that is being tried

    def __call__(self, candidates: Iterable[Candidate]) -> Iterator[Evaluation]:
        """Yield the evaluations of all candidates as they finish."""
        settled: deque[Evaluation] = deque()
        broken: list[list[Candidate]] = []
        untried = self._untried(candidates, settled)
        chunks = _gathered(untried, self._batch) if self._batch > 1 else _chunks(untried)
        for chunk, result in self._executor.map(self._evaluate, chunks):
            yield from _drained(settled)
            if isinstance(result, Exception):
                broken.append(chunk)
            else:
                yield from self._results(chunk, result)
        for size in (CHUNK, 1) if self._batch > 1 else (1,):
            pieces = [chunk[at : at + size] for chunk in broken for at in range(0, len(chunk), size)]
            broken = []
            for chunk, result in self._executor.map(self._evaluate, pieces):
                if not isinstance(result, Exception):
                    yield from self._results(chunk, result)
                elif size > 1:
                    broken.append(chunk)
                elif (machine := fault(result)) is not None:
                    raise UserError(
                        f"candidate {chunk[0].id} can't be tried: {machine}; this is a fault of the machine, not of "
                        "the design, which stays untried: see that there is room on its disks and in its memory"
                    )
                else:
                    why = str(result) if isinstance(result, PluginError) else f"{type(result).__name__}: {result}"
                    yield from self._results(chunk, [Evaluation(chunk[0], "failed", reason=why)])
        yield from _drained(settled)
        if self._waiting:
            raise UserError(f"{describe_part(self._executor)}: map gave no result for {len(self._waiting)} candidates")

    def _untried(self, candidates: Iterable[Candidate], settled: deque[Evaluation]) -> Iterator[Candidate]:
        """Yield the candidates to try; evaluations of the others go to ``settled`` at once, or come from `_results`."""
        for candidate in candidates:
            known = self._known(candidate)
            if known is not None:
                with self._lock:
                    self._earned.setdefault(candidate.content, known)
                settled.append(known)
                continue
            if candidate.problem is not None:
                settled.append(Evaluation(candidate, "rejected", reason=candidate.problem))
                continue
            with self._lock:
                earned = self._earned.get(candidate.content)
                waiting = self._waiting.get(candidate.content)
                if earned is not None:
                    settled.append(replace(earned, candidate=candidate))
                elif waiting is not None:
                    waiting.append(candidate)
                else:
                    self._waiting[candidate.content] = []
            if earned is None and waiting is None:
                yield candidate

    def _results(self, chunk: Sequence[Candidate], result: Sequence[Evaluation]) -> Iterator[Evaluation]:
        for candidate, evaluation in zip(chunk, result, strict=True):
            earned = replace(evaluation, candidate=candidate)  # not the copy that a worker sent back
            with self._lock:
                self._earned[candidate.content] = earned
                waiting = self._waiting.pop(candidate.content)
            yield earned
            yield from (replace(earned, candidate=other) for other in waiting)


def _drained(settled: deque[Evaluation]) -> Iterator[Evaluation]:
    while settled:
        yield settled.popleft()


def _chunks(candidates: Iterable[Candidate]) -> Iterator[list[Candidate]]:
    """Group candidates in a row that share a tool, at most `CHUNK` of them."""
    chunk: list[Candidate] = []
    for candidate in candidates:  # not groupby by id: a tool of an earlier reply is gone, and its id may come again
        if chunk and (len(chunk) == CHUNK or candidate.tool is not chunk[-1].tool):
            yield chunk
            chunk = []
        chunk.append(candidate)
    if chunk:
        yield chunk


def _gathered(candidates: Iterable[Candidate], most: int) -> Iterator[list[Candidate]]:
    """Group the candidates that have arrived since the last chunk was taken, at most ``most`` of them.

    A thread of its own reads them, so that replies arrive while a chunk is tried. What reading raises is raised here.
    """
    arrived: queue.Queue[Candidate | Exception | None] = queue.Queue(maxsize=most)

    def read() -> None:
        for candidate in candidates:
            arrived.put(candidate)

    run_in_thread(read, arrived.put, "candidates")
    while True:
        item = arrived.get()
        chunk: list[Candidate] = []
        while isinstance(item, Candidate):
            chunk.append(item)
            if len(chunk) == most:
                break
            try:
                item = arrived.get(timeout=LINGER_S)
            except queue.Empty:
                break
        if chunk:
            yield chunk
        if isinstance(item, Exception):
            raise item
        if item is None:
            return
