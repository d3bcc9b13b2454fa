"""``executor=local``: worker processes on this machine.

Each worker has a pipe of its own, and a thread here that waits at its end. Workers share no lock and no queue. So the
death of a worker is noticed at once, and costs nothing but its chunk.
"""

from __future__ import annotations

import gc
import multiprocessing
import os
import pickle
import queue
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import Any, TypeVar

from pydantic import PositiveInt

from core.errors import RAISED, Fault, UserError
from core.interfaces import Executor
from core.support.memory import release_memory
from core.support.scratch import scratch, use_scratch
from plugins.executors.dispatch import (
    Positive,
    cores,
    dispatch,
    portable,
    time_limit,
)

A = TypeVar("A")
B = TypeVar("B")

# Threads of libraries in several workers would compete for the same cores. Read when a worker imports a library.
_ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"
)
_START_S = 600.0  # for a process to take its first chunk: imports are slow on a disk of a network, or beside others

_spawn = multiprocessing.get_context("spawn")
# If two threads wait for one process, one does not get its exit code.
_reaping = threading.Lock()


class LocalExecutor(Executor):
    """Long-lived processes, started when there are chunks for them. One that dies costs its own chunk only.

    Args:
        workers: the number of processes; None: one for each core, or a single one for an engine with batches.
        timeout_s: seconds for a candidate, and for a chunk of up to ten. A chunk that takes longer is given up, and its
            worker is replaced. None: no limit.
        memory_mb: megabytes for a worker's data. A worker that needs more gets no memory, which ends the chunk and the
            worker. None: no limit. Only Linux enforces it.
    """

    def __init__(
        self,
        workers: PositiveInt | None = None,
        timeout_s: Positive | None = 300.0,
        memory_mb: PositiveInt | None = 4096,
    ) -> None:
        self.workers = workers if workers is not None else cores()
        self._choose = workers is None  # the number may follow the engine
        self._timeout_s = timeout_s
        self._memory_mb = memory_mb
        self._pool: list[_Worker] = []

    def map(
        self, function: Callable[[A], B], chunks: Iterable[A]
    ) -> Iterator[tuple[A, B | Exception]]:
        """See `Executor.map` and `plugins.executors.dispatch.dispatch`."""
        count = (
            1 if self._choose and getattr(function, "batch", 1) > 1 else self.workers
        )
        self._pool = self._pool or [
            _Worker(self._timeout_s, self._memory_mb) for _ in range(count)
        ]
        return dispatch(
            [partial(worker.call, function) for worker in self._pool], chunks
        )

    def close(self) -> None:
        for worker in self._pool:
            worker.close()

        self._pool = []


class _Died(Exception):
    """A worker process ended by itself; says how."""


class _Worker:
    """One process, started when it is needed, and started again when it has died."""

    def __init__(self, timeout_s: float | None, memory_mb: int | None) -> None:
        self._timeout_s = timeout_s
        self._memory_mb = memory_mb
        self._calling = threading.Lock()
        self._process: SpawnProcess | None = None
        self._pipe: Connection[Any, Any] | None = None
        self._closed = False

    def call(self, function: Callable[[A], B], chunk: A) -> B | Exception:
        """Return the result of ``function`` for ``chunk``, or an exception that says why there is none.

        Raises:
            UserError: no process could be started that takes the chunk.
        """
        job = pickle.dumps((function, chunk))
        with self._calling:
            fresh = self._hand_over(job)
            result = self._result(chunk)
            if not fresh and isinstance(result, _Died | MemoryError | Fault):
                # Earlier chunks may have left something in the process that is to blame.
                self._bury()
                self._hand_over(job)
                result = self._result(chunk)

            if isinstance(result, MemoryError | Fault):
                self._bury()
            if isinstance(result, MemoryError):
                return RuntimeError(
                    f"it took more memory than executor.memory_mb={self._memory_mb} allows"
                )

            return RuntimeError(str(result)) if isinstance(result, _Died) else result

    def _hand_over(self, job: bytes) -> bool:
        """Send the job to the process, or else to a new one; say if it is new.

        Raises:
            UserError: a new process does not take it.
        """
        if self._process is not None and self._sent(job) is None:
            return False

        self._start()
        why = self._sent(job)
        if why is not None:
            self._bury()
            raise UserError(f"worker processes can't be used: {why}")

        return True

    def _sent(self, job: bytes) -> str | None:
        """Send the job, and wait until the process is ready for it; say why it is not."""
        assert self._pipe is not None
        try:
            self._pipe.send_bytes(job)
            refusal = self._receive(_START_S)
        except (_Died, Fault, OSError) as error:
            return str(error)

        return None if refusal is None else str(refusal) or type(refusal).__name__

    def _result(self, chunk: Any) -> Any:
        """Return the process's result for the chunk, or an exception."""
        try:
            return self._receive(time_limit(self._timeout_s, chunk))
        except (_Died, Fault) as death:
            return death
        except TimeoutError:
            self._bury()
            return RuntimeError(
                f"the rollout took longer than executor.timeout_s={self._timeout_s:g} and was given up"
            )

    def _start(self) -> None:
        self._bury()
        os.environ.update(_ONE_THREAD)

        with _reaping:
            if self._closed:
                raise UserError("the executor is closed")
            if hasattr(signal, "pthread_sigmask"):  # not on Windows
                resource_tracker.ensure_running()  # or it is started below, and lets signals through again
                # The process inherits it: Ctrl-C is not for it, not even while it starts.
                signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})

            if (
                multiprocessing.get_start_method()
                not in multiprocessing.get_all_start_methods()
            ):
                # In a job of joblib it is joblib's own method, whose name a new process would not know.
                multiprocessing.set_start_method("spawn", force=True)

            self._pipe, theirs = _spawn.Pipe()
            with theirs:
                arguments = [theirs, self._memory_mb, scratch()]
                self._process = _spawn.Process(
                    target=_work, args=arguments, name="worker", daemon=True
                )
                self._process.start()

    def _receive(self, timeout_s: float | None) -> Any:
        """Return what the process sends next.

        Raises:
            TimeoutError: nothing arrived in time.
            Fault: something else killed the process.
        """
        process, pipe = self._process, self._pipe
        assert process is not None
        assert pipe is not None
        if not wait([pipe, process.sentinel], timeout_s):
            raise TimeoutError(f"no answer within {timeout_s:g} s")

        try:
            if pipe.poll():  # a child of the dead process may hold the pipe's other end, so that reading would not end
                return pipe.recv()
        except (EOFError, OSError):
            pass

        self._bury()

        if process.exitcode in (-signal.SIGTERM, -9):
            raise Fault(
                "the worker process died: it was killed, as the system does when memory runs out"
            )

        raise _Died(f"the worker process died (exit code {process.exitcode})")

    def _bury(self) -> None:
        """End the process at once."""
        # It was started.
        if self._process is not None and self._process.pid is not None:
            self._process.kill()
            with _reaping:
                self._process.join()
        if self._pipe is not None:
            self._pipe.close()

        self._process = None
        self._pipe = None

    def close(self) -> None:
        """End the process for good; a thread that waits for it gets `_Died`."""
        with _reaping:
            self._closed = True
            if self._process is not None and self._process.pid is not None:
                self._process.kill()

        with self._calling:
            self._bury()


def _work(pipe: Connection[Any, Any], memory_mb: int | None, folder: Path) -> None:
    """Do job after job in the worker process, until the other end of the pipe is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    use_scratch(folder)
    jobs: queue.SimpleQueue[bytes] = queue.SimpleQueue()

    def receive() -> None:
        try:
            while True:
                jobs.put(pipe.recv_bytes())
        finally:
            os._exit(0)

    # In a thread, so that the pipe's end is noticed during a job too.
    threading.Thread(target=receive, name="jobs", daemon=True).start()
    begun = False
    while True:
        job = jobs.get()
        try:
            function, chunk = pickle.loads(job)  # noqa: S301  # from the process that started this one
            getattr(function, "prepare", lambda: None)()
        except RAISED as error:
            pipe.send(portable(error))
            return

        if not begun:
            begun = True
            gc.freeze()  # what was imported stays: Python's garbage collector need not look there again and again
            if memory_mb is not None:
                _limit_memory(memory_mb)

        pipe.send(None)

        try:
            result = pickle.dumps(function(chunk))
        except MemoryError:
            result = pickle.dumps(MemoryError())
        except RAISED as error:
            result = pickle.dumps(portable(error))

        pipe.send_bytes(result)
        del function, chunk, job, result
        release_memory()


def _limit_memory(memory_mb: int) -> None:
    """Limit the memory of the process's data, and write no core files.

    Addresses that are only reserved, as by graphics drivers, don't count.
    """
    if sys.platform == "win32":
        return

    import resource

    for what, most in (
        (resource.RLIMIT_DATA, memory_mb * 2**20),
        (resource.RLIMIT_CORE, 0),
    ):
        _, hard = resource.getrlimit(what)
        allowed = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(what, (allowed, hard))
