"""The loop: ask for candidates, evaluate them, tell what they earned; until the budget or the goal is reached."""

from __future__ import annotations

import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace

import pluggy

from core.design import Candidate, DesignError, Evaluation, Tool
from core.designs.rules import check_tool
from core.errors import LimitReached, UserError
from core.events import INTERRUPTED, Generation, Result
from core.interfaces import Budget, EvolutionStrategy, Executor
from core.plugins import describe_part
from core.plugins.blame import PluginError
from core.search.dispatch import CHUNK
from core.text import shorten

LINGER_S = 0.2  # that a chunk for an engine which takes many waits for one more

Evaluate = Callable[[Sequence[Candidate]], list[Evaluation]]
Known = Callable[[Candidate], Evaluation | None]


def evolve(
    strategy: EvolutionStrategy,
    evaluate: Evaluate,
    executor: Executor,
    budget: Budget,
    events: pluggy.PluginManager,
    known: Known | None = None,
) -> Result:
    """Run ``budget.n_iteration`` + 1 generations, fewer if the highest reward reaches ``budget.stop_reward``.

    ``evaluate`` is called in the executor's workers, with candidates of one tool, or if it has a ``batch`` greater than
    1 with as many as have come; not for those whose evaluation is ``known``. A limit that is reached while candidates
    are asked for, and an interrupt, end the loop with what there is (`Result.stopped`).
    """
    began = time.monotonic()
    trials = Trials(evaluate, executor, known)
    asked = _UntilLimit(strategy)
    came: list[list[Evaluation]] = []  # by generation
    generations: list[Generation] = []
    try:
        for index in range(budget.n_iteration + 1):
            events.hook.generation_started(index=index)
            came.append([])
            for evaluation in trials(asked):
                events.hook.candidate_evaluated(evaluation=evaluation)
                came[-1].append(evaluation)
            if asked.limit is not None:
                break
            generation = _generation(index, came[-1], strategy.tie)
            strategy.tell(generation.evaluations)
            generations.append(generation)
            events.hook.generation_finished(generation=generation)
            reached = generation.best_reward
            if budget.stop_reward is not None and reached is not None and reached >= budget.stop_reward:
                break
        stopped = asked.limit
    except KeyboardInterrupt:  # whoever called sees it in the result
        stopped = INTERRUPTED
    for index in range(len(generations), len(came)):  # the one that was cut short
        if came[index]:
            generations.append(_generation(index, came[index], strategy.tie))
    return Result(tuple(generations), time.monotonic() - began, stopped, strategy.tie)


def _generation(index: int, evaluations: Iterable[Evaluation], tie: float) -> Generation:
    return Generation(index, tuple(sorted(evaluations, key=lambda e: e.candidate.key)), tie)


class _UntilLimit:
    """A strategy's candidates, again and again, until a limit is reached, which is kept."""

    def __init__(self, strategy: EvolutionStrategy) -> None:
        self._strategy = strategy
        self.limit: str | None = None
        self._sound: Tool | None = None  # the last that was checked; candidates in a row share one

    def __iter__(self) -> Iterator[Candidate]:
        """Raises UserError where the strategy gives no candidates; says whose it is."""
        try:
            asked = self._strategy.ask()
            if not isinstance(asked, Iterable):
                raise UserError(
                    f"{describe_part(self._strategy)}: ask gave {asked!r}; expected an iterator of Candidate"
                )
            for candidate in asked:
                if not isinstance(candidate, Candidate):
                    told = f"ask gave {shorten(repr(candidate))} among its candidates"
                    raise UserError(f"{describe_part(self._strategy)}: {told}; expected a Candidate")
                yield self._checked(candidate)
        except LimitReached as limit:
            self.limit = str(limit)

    def _checked(self, candidate: Candidate) -> Candidate:
        """The candidate, with a problem if the strategy built a tool that breaks a rule; a designer's keep them."""
        tool = candidate.tool
        if candidate.problem is None and tool is not None and tool.components and tool is not self._sound:
            try:
                check_tool(tool)
            except DesignError as error:
                return replace(candidate, problem=f"{describe_part(self._strategy)} built a wrong tool: {error}")
            self._sound = tool
        return candidate


def evaluate_all(candidates: Iterable[Candidate], evaluate: Evaluate, executor: Executor) -> Iterator[Evaluation]:
    """Of all candidates, as they finish."""
    return Trials(evaluate, executor)(candidates)


class Trials:
    """Evaluates candidates in an executor's workers.

    Of candidates with the same `Candidate.content`, however far apart they come, one is tried; the others earn what it
    earned. Where a chunk breaks, its candidates are tried again in smaller ones, at last one by one. What is ``known``
    is not tried at all.
    """

    def __init__(self, evaluate: Evaluate, executor: Executor, known: Known | None = None) -> None:
        self._evaluate = evaluate
        self._batch = int(getattr(evaluate, "batch", 1))
        self._executor = executor
        self._known = known or (lambda _: None)
        self._lock = threading.Lock()  # executors may read chunks in a thread of their own
        self._earned: dict[str, Evaluation] = {}
        self._waiting: dict[str, list[Candidate]] = {}  # for the one of the same content that is being tried

    def __call__(self, candidates: Iterable[Candidate]) -> Iterator[Evaluation]:
        """Of all candidates, as they finish."""
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
                else:
                    yield from self._results(chunk, [Evaluation(chunk[0], "failed", reason=_why(result))])
        yield from _drained(settled)
        if self._waiting:
            raise UserError(f"{describe_part(self._executor)}: map gave no result for {len(self._waiting)} candidates")

    def _untried(self, candidates: Iterable[Candidate], settled: deque[Evaluation]) -> Iterator[Candidate]:
        """Those that have to be tried; the others' evaluations go to ``settled``, now or with `_results`."""
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
            earned = replace(evaluation, candidate=candidate)  # not the copy that travelled
            with self._lock:
                self._earned[candidate.content] = earned
                waiting = self._waiting.pop(candidate.content)
            yield earned
            yield from (replace(earned, candidate=other) for other in waiting)


def _why(error: Exception) -> str:
    return str(error) if isinstance(error, PluginError) else f"{type(error).__name__}: {error}"


def _drained(settled: deque[Evaluation]) -> Iterator[Evaluation]:
    while settled:
        yield settled.popleft()


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


def _gathered(candidates: Iterable[Candidate], most: int) -> Iterator[list[Candidate]]:
    """Those that have come since the last chunk was taken, at most that many, and at least one.

    They are read in a thread of its own, so that replies go on coming while a chunk is tried. What reading them raises
    is raised here.
    """
    came: queue.Queue[Candidate | Exception | None] = queue.Queue(maxsize=most)

    def read() -> None:
        try:
            for candidate in candidates:
                came.put(candidate)
            came.put(None)
        except Exception as error:  # to be raised where somebody sees it
            came.put(error)

    threading.Thread(target=read, name="candidates", daemon=True).start()
    while True:
        item = came.get()
        chunk: list[Candidate] = []
        while isinstance(item, Candidate):
            chunk.append(item)
            if len(chunk) == most:
                break
            try:
                item = came.get(timeout=LINGER_S)
            except queue.Empty:
                break
        if chunk:
            yield chunk
        if isinstance(item, Exception):
            raise item
        if item is None:
            return
