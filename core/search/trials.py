"""Try candidates in conditions: the scheduler of trials.

Each pair of a design and a condition is tried once in a run. So an equal plan, a tool's plan for one task of a design
that was tried in others, a finalist and a resumed run cost nothing twice. Chunks of one condition and one tool's
candidates are dealt to an executor's workers, so layouts of one candidate run side by side. A trial is stored when it
ends, before its candidate has all of its trials.
"""

from __future__ import annotations

import queue
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace

from core.design import Candidate
from core.errors import RAISED, UserError, fault, in_line
from core.interfaces import CHUNK, Executor, Fitness
from core.plugins import describe_part
from core.plugins.blame import PluginError
from core.simulation.play import play
from core.support.threads import run_in_thread
from core.trial import Condition, Evaluation, Score, Trial, TrialKey

LINGER_S = 0.2  # how long a chunk waits for one more candidate, for an engine with large batches

Play = Callable[[Condition, Sequence[Candidate]], list[Trial]]
"""Tries candidates in a condition (`core.simulation.play.play`)."""
Tried = tuple[Candidate, tuple[Trial, ...]]
"""A candidate with its trials in all conditions."""


@dataclass(frozen=True)
class Chunk:
    """Candidates that are tried together in one condition."""

    condition: Condition
    candidates: tuple[Candidate, ...]

    def __len__(self) -> int:
        return len(self.candidates)

    def __iter__(self) -> Iterator[Candidate]:
        return iter(self.candidates)

    def split(self, size: int) -> Iterator[Chunk]:
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
class _Waiting:
    """A candidate until all of its trials have ended; ``keys`` are those of all, and ``missing`` are under way."""

    candidate: Candidate
    keys: list[TrialKey]
    missing: int = 0


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
        self._waiting: dict[TrialKey, list[_Waiting]] = {}
        # What needs no trial of its own, until the caller's thread yields it.
        self._settled: deque[Tried] = deque()

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
        broken: list[Chunk] = []
        try:
            yield from self._play(player, chunks, broken)
            if batch > 1:
                chunks = (
                    piece for chunk in list(broken) for piece in chunk.split(CHUNK)
                )
                broken = []
                yield from self._play(player, chunks, broken)

            alone = (piece for chunk in broken for piece in chunk.split(1))
            yield from self._play(player, alone, None)
            yield from self._drain()

            if self._waiting:
                raise UserError(
                    f"{describe_part(self.executor)}: map gave no result for {len(self._waiting)} trials"
                )
        finally:  # of what an error or an interrupt cut short
            self._waiting.clear()
            self._settled.clear()

    def _play(
        self, player: _Player, chunks: Iterable[Chunk], broken: list[Chunk] | None
    ) -> Iterator[Tried]:
        """Have chunks played, and yield the candidates that have all of their trials then.

        Chunks that fail are appended to ``broken``, to be tried again in smaller ones. None: they have one candidate,
        which has failed.

        Raises:
            UserError: the machine is at fault.
        """
        for chunk, result in self.executor.map(player, chunks):
            yield from self._drain()
            if not isinstance(result, Exception):
                yield from self._take(chunk, result)
            elif broken is not None:
                broken.append(chunk)
            else:
                yield from self._take(chunk, [_fail(chunk, result)])

    def _chunks(
        self,
        conditions: Sequence[Condition],
        candidates: Iterable[Candidate],
        batch: int,
    ) -> Iterator[Chunk]:
        """Yield what is to be tried; candidates that need no trial are settled at once."""
        groups = _gather(candidates, batch) if batch > 1 else _group_by_tool(candidates)
        for group in groups:
            to_try: dict[Condition, list[Candidate]] = {
                condition: [] for condition in conditions
            }
            for candidate in group:
                if candidate.problem is not None:
                    self._settled.append((candidate, ()))
                else:
                    self._register(candidate, conditions, to_try)

            for condition, members in to_try.items():
                if members:
                    yield Chunk(condition, tuple(members))

    def _register(
        self,
        candidate: Candidate,
        conditions: Sequence[Condition],
        to_try: dict[Condition, list[Candidate]],
    ) -> None:
        """Note which trials of a candidate are missing, and add it where nobody is tried for it yet."""
        keys = [key_of(candidate, condition) for condition in conditions]
        waiting = _Waiting(candidate, keys)
        with self._lock:
            # A fitness may name a condition twice.
            for key, condition in dict(zip(keys, conditions, strict=True)).items():
                if key in self.known:
                    continue
                waiting.missing += 1

                if key not in self._waiting:
                    self._waiting[key] = []
                    to_try[condition].append(candidate)

                self._waiting[key].append(waiting)

        if waiting.missing == 0:
            self._settled.append((candidate, self._trials_of(waiting)))

    def _take(self, chunk: Chunk, result: Sequence[Trial]) -> Iterator[Tried]:
        """Keep the trials of a chunk, and yield the candidates that have all of theirs now."""
        for candidate, trial in zip(chunk, result, strict=True):
            key = key_of(candidate, chunk.condition)
            if key not in self._waiting:
                name = describe_part(self.executor)
                raise UserError(f"{name}: map gave the result of a chunk twice")
            self.tell(key, trial)
            with self._lock:
                self.known[key] = trial
                waiting = self._waiting.pop(key)
                for other in waiting:
                    other.missing -= 1
                ended = [other for other in waiting if other.missing == 0]
            for other in ended:
                yield other.candidate, self._trials_of(other)

    def _drain(self) -> Iterator[Tried]:
        while self._settled:
            yield self._settled.popleft()

    def _trials_of(self, waiting: _Waiting) -> tuple[Trial, ...]:
        return tuple(self.known[key] for key in waiting.keys)


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

    if is_possible:
        return score
    reason = f"{name}: the reward {score.reward} is not in [0, 1]"
    return replace(score, reward=0.0, reason=reason)


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
        )

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
