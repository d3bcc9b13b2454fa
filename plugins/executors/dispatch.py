"""Dispatch chunks to workers that take one at a time: what the executors share."""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence, Sized
from dataclasses import dataclass
from functools import partial
from itertools import islice
from typing import TypeVar

from core.errors import Fault, UsageError, check_positive, fault
from core.interfaces import CHUNK
from core.support.threads import run_in_thread

A = TypeVar("A")
B = TypeVar("B")


@dataclass(frozen=True)
class _Raised:
    error: Exception


def time_limit(timeout_s: float | None, chunk: object) -> float | None:
    """Return the seconds that a chunk may take: ``timeout_s`` for every ten candidates begun; None: no limit.

    A chunk that needs more is tried again one by one, with ``timeout_s`` for each candidate. So one that hangs is found
    after one limit instead of ten, and a slow one is not lost.
    """
    count = len(chunk) if isinstance(chunk, Sized) else 1
    return None if timeout_s is None else timeout_s * max(1, -(-count // CHUNK))


def dispatch(
    workers: Sequence[Callable[[A], B | Exception]], chunks: Iterable[A]
) -> Iterator[tuple[A, B | Exception]]:
    """Yield each chunk with a worker's result, in the order in which they finish.

    Each worker has a thread, which reads its next chunk when it is free. So results come while the next chunk is
    awaited. At most two chunks for each worker are read and not yet taken. What a worker or ``chunks`` raises is raised
    here.
    """
    source = iter(chunks)
    reading = threading.Lock()
    results: queue.SimpleQueue[tuple[A, B | Exception] | _Raised | None] = (
        queue.SimpleQueue()
    )
    # A chunk holds it until its result is taken.
    room = threading.Semaphore(2 * len(workers))
    stop = threading.Event()

    def serve(worker: Callable[[A], B | Exception]) -> None:
        while room.acquire() and not stop.is_set():
            with reading:
                taken = [] if stop.is_set() else [*islice(source, 1)]

            if not taken or stop.is_set():
                return

            (chunk,) = taken
            results.put((chunk, worker(chunk)))

    def end(error: Exception | None) -> None:
        results.put(_Raised(error) if error is not None else None)

    serving = len(workers)
    try:
        for worker in workers:
            run_in_thread(partial(serve, worker), end, "worker")

        while serving:
            result = results.get()
            if result is None:
                serving -= 1
            elif isinstance(result, _Raised):
                raise result.error
            else:
                room.release()
                yield result
    finally:
        stop.set()
        room.release(len(workers))


def check_limits(workers: int | None, timeout_s: float | None) -> None:
    """Check two settings that executors share; None: default, or no limit.

    Raises:
        UsageError: one is too small.
    """
    if workers is not None and workers < 1:
        raise UsageError(f"executor.workers must be at least 1, got {workers}")
    if timeout_s is not None:
        check_positive("executor.", timeout_s=timeout_s)


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
