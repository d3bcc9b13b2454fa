"""Worker processes on this machine."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from typing import TypeVar

from pebble import ProcessExpired, ProcessPool

from core.errors import UsageError, check_positive
from core.hooks import hookimpl
from core.interfaces import Executor

A = TypeVar("A")
B = TypeVar("B")

# A library's threads inside several workers only fight for the same cores; read when a worker imports it.
_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


@hookimpl
def executors() -> Mapping[str, Callable[..., Executor]]:
    return {"local": LocalExecutor}


class LocalExecutor(Executor):
    """A pool of long-lived processes, started when the first chunk comes. One that dies takes along its own chunk only.

    Args:
        workers: how many; None: as many as there are cores.
        timeout_s: a chunk that takes longer is given up and its worker replaced; None: never.
    """

    def __init__(self, workers: int | None = None, timeout_s: float | None = None) -> None:
        if workers is not None and workers < 1:
            raise UsageError(f"executor.workers must be at least 1, got {workers}")
        self.workers = workers if workers is not None else _cores()
        if timeout_s is not None:
            check_positive("executor.", timeout_s=timeout_s)
        self._timeout_s = timeout_s
        self._pool: ProcessPool | None = None

    def map(self, function: Callable[[A], B], chunks: Iterable[A]) -> Iterator[tuple[A, B | Exception]]:
        running: dict[Future[B], A] = {}
        for chunk in chunks:
            while len(running) >= 2 * self.workers:  # one in work and one waiting for each worker
                yield from self._finished(running)
            running[self._schedule(function, chunk)] = chunk
        while running:
            yield from self._finished(running)

    def _schedule(self, function: Callable[[A], B], chunk: A) -> Future[B]:
        if self._pool is None:
            os.environ.update(_ONE_THREAD)
            self._pool = ProcessPool(self.workers, context=multiprocessing.get_context("spawn"))
        future: Future[B] = self._pool.schedule(function, args=[chunk], timeout=self._timeout_s)
        return future

    @staticmethod
    def _finished(running: dict[Future[B], A]) -> Iterator[tuple[A, B | Exception]]:
        done, _ = wait(running, return_when=FIRST_COMPLETED)
        for future in done:
            chunk = running.pop(future)
            try:
                yield chunk, future.result()
            except ProcessExpired as error:
                yield chunk, RuntimeError(f"the worker process died (exit code {error.exitcode})")
            except TimeoutError:
                yield chunk, RuntimeError("the rollout took longer than executor.timeout_s and was given up")
            except Exception as error:  # raised by the function, in the worker
                yield chunk, error

    def close(self) -> None:
        if self._pool is not None:
            self._pool.stop()
            self._pool.join()
            self._pool = None


def _cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
