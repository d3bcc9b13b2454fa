"""Dispatch chunks to workers that take one at a time: what the executors share."""

from __future__ import annotations

import contextlib
import math
import os
import pickle
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence, Sized
from functools import partial
from itertools import chain, islice
from typing import Annotated, Generic, Protocol, Self, TypeVar, runtime_checkable

from pydantic import Field, FiniteFloat

from core.errors import Fault, fault
from core.interfaces import CHUNK
from core.support.threads import merge

A = TypeVar("A")
B = TypeVar("B")
Positive = Annotated[FiniteFloat, Field(gt=0)]


@runtime_checkable
class Divisible(Protocol):
    """A chunk that can be dealt out in pieces."""

    def __len__(self) -> int: ...

    def pieces(self, size: int) -> Iterator[Self]:
        """Yield chunks of at most ``size`` members."""


def time_limit(timeout_s: float | None, chunk: object) -> float | None:
    """Return the seconds that a chunk may take: ``timeout_s`` for every ten candidates begun; None: no limit.

    A chunk that needs more is tried again one by one, with ``timeout_s`` for each candidate. So one that hangs is found
    after one limit instead of ten, and a slow one is not lost.
    """
    count = len(chunk) if isinstance(chunk, Sized) else 1
    return None if timeout_s is None else timeout_s * max(1, -(-count // CHUNK))


class _Supply(Generic[A]):
    """Chunks for workers, read ahead of them.

    Once all are read, no worker takes more than an equal share of what is left: none is idle while another one works
    through a long last chunk.

    Args:
        chunks: at most two for each worker are read whose result was not taken yet.
        workers: how many there are.
    """

    def __init__(self, chunks: Iterable[A], workers: int) -> None:
        self._source = iter(chunks)
        self._workers = workers
        # A chunk holds it until its result is taken.
        self._room = threading.Semaphore(2 * workers)
        self._read: deque[A] = deque()
        self._changed = threading.Condition()
        self._ended = False
        self._stopped = False

    def read(self) -> None:
        """Read chunks as long as there are any, and while there is room."""
        while self._room.acquire() and not self._stopped:
            chunks = [*islice(self._source, 1)]
            with self._changed:
                self._read += chunks
                self._ended = not chunks
                self._changed.notify_all()

            if not chunks:
                return

    def make_room(self) -> None:
        """Let one more chunk be read: the result of an earlier one is taken."""
        self._room.release()

    def take(self) -> list[A]:
        """Wait for the next chunk, or a piece of it; none: there are no more."""
        with self._changed:
            self._changed.wait_for(lambda: self._read or self._ended or self._stopped)
            if self._stopped or not self._read:
                return []

            chunk = self._read.popleft()
            if self._ended and isinstance(chunk, Divisible):
                chunk, *others = chunk.pieces(self._share(chunk))
                self._read.extendleft(reversed(others))

            return [chunk]

    def _share(self, chunk: Divisible) -> int:
        """Compute a worker's share of a chunk and what comes after it."""
        left = len(chunk)
        for other in self._read:
            if isinstance(other, Sized):
                left += len(other)

        return max(1, math.ceil(left / self._workers))

    def stop(self) -> None:
        """Let no chunk be taken any more."""
        with self._changed:
            self._stopped = True
            self._changed.notify_all()

        self._room.release()


def dispatch(
    workers: Sequence[Callable[[A], B | Exception]], chunks: Iterable[A]
) -> Iterator[tuple[A, B | Exception]]:
    """Yield each chunk with a worker's result, in the order in which they finish.

    Each worker has a thread, and one reads ``chunks``. So results come while the next chunk is awaited. The last ones
    are dealt out in pieces, if they are `Divisible`, and yielded so (see `_Supply`). What a worker or ``chunks`` raises
    is raised here.
    """
    supply = _Supply(chunks, len(workers))

    def serve(
        worker: Callable[[A], B | Exception],
    ) -> Iterator[tuple[A, B | Exception]]:
        for chunk in chain.from_iterable(iter(supply.take, [])):
            yield chunk, worker(chunk)

    def read() -> Iterator[tuple[A, B | Exception]]:
        supply.read()
        yield from ()

    threads = {"chunks": read}
    for number, worker in enumerate(workers):
        threads[f"worker {number}"] = partial(serve, worker)

    try:
        for result in merge(threads):
            supply.make_room()
            yield result
    finally:
        supply.stop()


def cores() -> int:
    """Count the cores that this process may use."""
    return (
        len(os.sched_getaffinity(0))
        if hasattr(os, "sched_getaffinity")
        else os.cpu_count() or 1
    )


def portable(error: BaseException) -> Exception:
    """Return an exception that can be pickled: `Fault` for a fault of the machine, else ``error`` or its text."""
    why = fault(error)
    if why is not None:
        return Fault(why)
    if isinstance(error, Exception):
        with contextlib.suppress(Exception):  # its class may do anything
            pickle.loads(pickle.dumps(error))  # noqa: S301
            return error

    return RuntimeError(f"{type(error).__name__}: {error}")
