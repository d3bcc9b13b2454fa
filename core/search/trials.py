"""Try candidates in conditions: the scheduler of trials.

Each pair of a design and a condition is tried once in a run. So an equal plan, a tool's plan for one task of a design
that was tried in others, a finalist and a resumed run cost nothing twice. Chunks of one condition and one tool's
candidates are dealt to an executor's workers, so layouts of one candidate run side by side. A trial is stored when it
ends, before its candidate has all of its trials.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain

from core.design import Candidate
from core.errors import RAISED, SharedByThreads, UserError, fault, in_line
from core.interfaces import CHUNK, Executor, Fitness
from core.plugins import describe_part
from core.plugins.blame import PluginError
from core.simulation.measuring import cost_of
from core.simulation.play import play
from core.support.interrupts import check_interrupt
from core.support.text import shorten
from core.support.threads import run_in_thread
from core.trial import Condition, Evaluation, Score, Trial, TrialKey

LINGER_S = 0.2  # how long a chunk waits for one more candidate, for an engine with large batches

Play = Callable[[Condition, Sequence[Candidate]], list[Trial]]
"""Tries candidates in a condition (`core.simulation.play.play`)."""
Tried = tuple[Candidate, tuple[Trial, ...]]
"""A candidate with its trials in all conditions."""
_Open = tuple[Candidate, list[TrialKey]]
"""A candidate that was not yielded yet, with the keys of all its trials."""


@dataclass(frozen=True)
class Chunk:
    """Candidates that are tried together in one condition."""

    condition: Condition
    candidates: tuple[Candidate, ...]

    def __len__(self) -> int:
        return len(self.candidates)

    def __iter__(self) -> Iterator[Candidate]:
        return iter(self.candidates)

    def pieces(self, size: int) -> Iterator[Chunk]:
        """Yield chunks of at most ``size`` candidates."""
        for begin in range(0, len(self), size):
            yield Chunk(self.condition, self.candidates[begin : begin + size])


@dataclass(frozen=True)
class _Player:
    """What workers call with chunks; ``conditions`` are those of all chunks."""

    play: Play
    conditions: tuple[Condition, ...]
    batch: int

    def prepare(self) -> None:
        """Make the tasks and engines of the conditions: what fails here is no candidate's fault."""
        for condition in self.conditions:
            condition.task.shared()
            condition.sim.shared()

    def __call__(self, chunk: Chunk) -> list[Trial]:
        return self.play(chunk.condition, chunk.candidates)


@dataclass(eq=False)
class Trials:
    """The scheduler of a run's trials.

    Executors may read chunks in a thread of their own, so what is known is kept under a lock.

    Attributes:
        executor: plays chunks.
        tell: is called with each trial when it ends, in the caller's thread, with its key.
        known: the trials so far, those of an earlier session too.
        play: tries a chunk's candidates, in a worker.
    """

    executor: Executor
    tell: Callable[[TrialKey, Trial], None] = lambda key, trial: None
    known: dict[TrialKey, Trial] = field(default_factory=dict)
    play: Play = play

    def __post_init__(self) -> None:
        self._lock = threading.Lock()
        self._under_way: set[TrialKey] = set()
        self._open: list[_Open] = []

    def evaluate(
        self, candidates: Iterable[Candidate], fitness: Fitness
    ) -> Iterator[Evaluation]:
        """Yield the evaluation of each candidate by a fitness, when its last trial has ended."""
        conditions = tuple(fitness.conditions())
        for candidate, trials in self.try_in(conditions, candidates):
            score = make_score(fitness, candidate, trials) if trials else Score(0.0)
            yield Evaluation(candidate, trials, score)

    def try_in(
        self, conditions: Sequence[Condition], candidates: Iterable[Candidate]
    ) -> Iterator[Tried]:
        """Yield each candidate with its trials in all conditions, as they end; no trials where it breaks a rule."""
        batch = min((condition.batch for condition in conditions), default=1)
        player = _Player(self.play, tuple(conditions), batch)
        chunks = self._chunks(conditions, candidates, batch)
        # What fails is tried again in smaller chunks, at last one candidate after the other.
        sizes = [CHUNK, 1] if batch > 1 else [1]

        try:
            broken = yield from self._play(player, chunks)
            for size in sizes:
                pieces = chain.from_iterable(chunk.pieces(size) for chunk, _ in broken)
                broken = yield from self._play(player, pieces)

            for chunk, error in broken:
                self._keep(chunk, [_fail(chunk, error)])
            yield from self._drain()

            if self._under_way:
                raise UserError(
                    f"{describe_part(self.executor)}: map gave no result for {len(self._under_way)} trials"
                )
        finally:  # of what an error or an interrupt cut short
            self._under_way.clear()
            self._open.clear()

    def _play(
        self, player: _Player, chunks: Iterable[Chunk]
    ) -> Generator[Tried, None, list[tuple[Chunk, Exception]]]:
        """Have chunks played, and yield candidates as they end; return the chunks that failed, and why.

        Raises:
            UserError: the executor plays in several threads of one process.
        """
        broken: list[tuple[Chunk, Exception]] = []
        for pair in self.executor.map(player, chunks):
            check_interrupt()
            chunk, result = self._read_pair(pair)
            if isinstance(result, SharedByThreads):
                raise UserError(f"{describe_part(self.executor)}: {result}")
            if isinstance(result, Exception):
                broken.append((chunk, result))
            else:
                self._keep(chunk, result)
            yield from self._drain()

        return broken

    def _read_pair(self, pair: object) -> tuple[Chunk, Sequence[Trial] | Exception]:
        """Return a chunk and its result, as an executor gave them.

        Raises:
            UserError: it gave something else; names it.
        """
        match pair:
            case (Chunk() as chunk, Exception() as error):
                return chunk, error
            case (Chunk() as chunk, list(trials)) if all(
                isinstance(trial, Trial) for trial in trials
            ):
                if len(trials) == len(chunk):
                    return chunk, trials
                got = f"{len(trials)} trials for a chunk of {len(chunk)}"
            case _:
                got = f"{shorten(repr(pair))}; expected pairs of a chunk and what the function gave for it"

        raise UserError(f"{describe_part(self.executor)}: map gave {got}")

    def _chunks(
        self,
        conditions: Sequence[Condition],
        candidates: Iterable[Candidate],
        batch: int,
    ) -> Iterator[Chunk]:
        """Yield what is to be tried."""
        groups = _gather(candidates, batch) if batch > 1 else _group_by_tool(candidates)
        for group in groups:
            to_try: dict[Condition, list[Candidate]] = {
                condition: [] for condition in conditions
            }
            for candidate in group:
                self._open_candidate(candidate, conditions, to_try)

            for condition, members in to_try.items():
                if members:
                    yield Chunk(condition, tuple(members))

    def _open_candidate(
        self,
        candidate: Candidate,
        conditions: Sequence[Condition],
        to_try: dict[Condition, list[Candidate]],
    ) -> None:
        """Note which trials a candidate has, and add it to ``to_try`` where nobody is tried for it yet."""
        keys: list[TrialKey] = []
        if candidate.problem is None:
            keys = [key_of(candidate, condition) for condition in conditions]

        with self._lock:
            self._open.append((candidate, keys))
            for key, condition in zip(keys, conditions, strict=False):
                if key not in self.known and key not in self._under_way:
                    self._under_way.add(key)
                    to_try[condition].append(candidate)

    def _keep(self, chunk: Chunk, result: Sequence[Trial]) -> None:
        """Keep the trials of a chunk."""
        for candidate, trial in zip(chunk, result, strict=True):
            key = key_of(candidate, chunk.condition)
            if key not in self._under_way:
                name = describe_part(self.executor)
                raise UserError(f"{name}: map gave the result of a chunk twice")
            if trial.candidate != candidate.id:
                name = describe_part(self.executor)
                raise UserError(f"{name}: map gave a chunk the result of another")

            self.tell(key, trial)
            with self._lock:
                self.known[key] = trial
                self._under_way.remove(key)

    def _drain(self) -> Iterator[Tried]:
        """Yield the candidates that have all of their trials now, in the order in which they came."""
        with self._lock:
            ended = [item for item in self._open if self._has_ended(item)]
            self._open = [item for item in self._open if not self._has_ended(item)]

        for candidate, keys in ended:
            yield candidate, tuple(self.known[key] for key in keys)

    def _has_ended(self, item: _Open) -> bool:
        _, keys = item
        return all(key in self.known for key in keys)


def make_score(
    fitness: Fitness, candidate: Candidate, trials: Sequence[Trial]
) -> Score:
    """Let a fitness judge a candidate's trials. A reward that is not in [0, 1] becomes 0, with the reason.

    Raises:
        UserError: the fitness raises something, or gives no score of these trials; names it.
    """
    name = describe_part(fitness)
    try:
        score = fitness.score(candidate, trials)
        is_possible = 0 <= score.reward <= 1
        trials[score.shown]
    except UserError:
        raise
    except RAISED as error:  # of a plugin, or since it gave something else
        what = in_line(error)
        raise UserError(f"{name}: score: {what}") from error

    if not is_possible:
        reason = f"{name}: the reward {score.reward} is not in [0, 1]"
        return replace(score, reward=0.0, reason=reason)

    if fitness.tie_by == Fitness.tie_by:
        return score
    return replace(score, cost=cost_of(trials, fitness.tie_by))


def key_of(candidate: Candidate, condition: Condition) -> TrialKey:
    """Return what is tried where."""
    where = condition.where
    return candidate.of(where.task).content, where


def _fail(chunk: Chunk, error: Exception) -> Trial:
    """Make the trial of the chunk's only candidate, for which its worker failed.

    Raises:
        UserError: the machine is at fault.
    """
    (candidate,) = chunk.candidates
    machine = fault(error)
    if machine is not None:
        raise UserError(
            f"candidate {candidate.id} can't be tried: {machine}; this is a fault of the machine, not of the design, "
            "which stays untried: see that there is room on its disks and in its memory"
        ) from error

    reason = str(error)
    if not isinstance(error, PluginError):
        reason = f"{type(error).__name__}: {reason}"
    return Trial(chunk.condition.where, candidate.id, "failed", reason=reason)


def _group_by_tool(candidates: Iterable[Candidate]) -> Iterator[list[Candidate]]:
    """Group candidates in a row that share a tool, at most `CHUNK` of them."""
    group: list[Candidate] = []
    # Not groupby by id: a tool of an earlier reply is gone, and its id may come again.
    for candidate in candidates:
        if group and (len(group) == CHUNK or candidate.tool is not group[-1].tool):
            yield group
            group = []
        group.append(candidate)
    if group:
        yield group


def _gather(candidates: Iterable[Candidate], most: int) -> Iterator[list[Candidate]]:
    """Group the candidates that have arrived since the last group was taken, at most ``most`` of them.

    A thread of its own reads them, so that replies arrive while a group is tried. What reading raises is raised here.
    """
    arrived: queue.Queue[Candidate | Exception | None] = queue.Queue(maxsize=most)

    def read() -> None:
        for candidate in candidates:
            arrived.put(candidate)

    run_in_thread(read, arrived.put, "candidates")

    while True:
        item = arrived.get()
        group: list[Candidate] = []
        while isinstance(item, Candidate):
            group.append(item)
            if len(group) == most:
                break
            try:
                item = arrived.get(timeout=LINGER_S)
            except queue.Empty:
                break

        if group:
            yield group
        if isinstance(item, Exception):
            raise item
        if item is None:
            return
