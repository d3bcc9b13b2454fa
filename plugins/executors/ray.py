"""Try chunks on a Ray cluster: each is a task, for which Ray finds a node with room and a process that is there."""

from __future__ import annotations

import logging
import math
import os
import pickle
import signal
import socket
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import cache, partial
from typing import Annotated, Any, TypeVar

from pydantic import Field, FiniteFloat, NonNegativeInt, PositiveInt

from core.errors import RAISED, Fault, UsageError, UserError
from core.hooks import Names
from core.interfaces import Executor
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

_REACH_S = 5.0
_END_S = 10.0  # for threads to notice that their tasks are cancelled


class RayExecutor(Executor):
    """Processes on the nodes of a Ray cluster, where the same version of this program has to be installed.

    A chunk that is lost with its process or node is tried again elsewhere.

    Args:
        address: of a running cluster: ``HOST:PORT``, ``ray://HOST:PORT`` or ``auto``; None: a cluster is started on
            this machine, and ends with the run.
        workers: how many chunks are tried at once, where there is room; None: as many as the cluster's cores and
            graphics cards allow, or one for an engine with batches that uses no card.
        num_cpus: cores that the cluster reserves for each worker.
        num_gpus: graphics cards that it reserves for each worker; with 0.5 two workers share one.
        retries: how often a chunk is tried again after its process was lost.
        timeout_s: seconds for a candidate, and for a chunk of up to ten. A chunk that takes longer is given up, and its
            process ends. None: no limit. Waiting for room on the cluster does not count.
    """

    def __init__(
        self,
        address: Annotated[str | None, Names("host")] = None,
        workers: PositiveInt | None = None,
        num_cpus: Positive = 1.0,
        num_gpus: Annotated[FiniteFloat, Field(ge=0)] = 0.0,
        retries: NonNegativeInt = 2,
        timeout_s: Positive | None = 300.0,
    ) -> None:
        # Or it starts a cluster where it has lost one.
        os.environ.setdefault("RAY_ENABLE_AUTO_CONNECT", "0")
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        if address is not None:  # a cluster that is there answers the first time
            os.environ.setdefault("RAY_NUM_REDIS_GET_RETRIES", "3")
        try:
            import ray
        except ModuleNotFoundError as error:
            raise UserError(
                "executor=ray needs Ray: pip install 'ray>=2.40'"
            ) from error

        if address is not None:
            _reach(address)
        self._ray = ray
        self._address = address
        self._workers = workers
        self._num_cpus = num_cpus
        self._num_gpus = num_gpus
        self._retries = retries
        self._timeout_s = timeout_s
        self._connected = self._closed = False
        self._tasks: dict[int, Any] = {}  # that threads wait for
        self._lock = threading.Condition()

    def map(
        self, function: Callable[[A], B], chunks: Iterable[A]
    ) -> Iterator[tuple[A, B | Exception]]:
        """See `Executor.map` and `plugins.executors.dispatch.dispatch`."""
        if not self._connected:
            self._connect()
        count = self._workers or self._room(getattr(function, "batch", 1) > 1)
        task = self._ray.remote(max_calls=0)(_work).options(
            num_cpus=self._num_cpus,
            num_gpus=self._num_gpus,
            max_retries=0,
            num_returns="streaming",
        )
        return dispatch([partial(self._call, task, function)] * count, chunks)

    def _call(self, task: Any, function: Callable[[A], B], chunk: A) -> B | Exception:
        """Return the result of ``function`` for ``chunk``, or an exception that says why there is none.

        Raises:
            UserError: a node can't do it.
        """
        job = pickle.dumps((function, chunk))
        limit = time_limit(self._timeout_s, chunk)
        lost = self._ray.exceptions
        machine = False
        why = ""
        for _ in range(1 + self._retries):
            try:
                answer = pickle.loads(self._result(task, job, limit))  # noqa: S301
            except lost.GetTimeoutError:
                return RuntimeError(
                    "the rollout took longer than executor.timeout_s and was given up"
                )
            except lost.RayError as error:
                if self._closed:
                    break
                # No fault of the chunk.
                machine = isinstance(error, lost.OutOfMemoryError | lost.NodeDiedError)
                why = f"{type(error).__name__}: {str(error).strip()}".splitlines()[0]
                continue

            if not isinstance(answer, Fault):
                return answer  # type: ignore[no-any-return]
            machine, why = True, str(answer)

        if self._closed:
            return RuntimeError("the executor is closed")
        return (Fault if machine else RuntimeError)(
            f"the worker was lost {1 + self._retries} times: {why}"
        )

    def _result(self, task: Any, job: bytes, limit: float | None) -> bytes:
        """Wait for a task, `_work`; from when it begins for ``limit`` seconds at most.

        While one waits, Ray is not shut down: what calls it afterwards ends the whole process.

        Raises:
            UserError: the node can't do it.
        """
        with self._lock:
            if self._closed:
                raise self._ray.exceptions.RayError("the executor is closed")
            answers = task.remote(job)
            self._tasks[id(answers)] = answers

        try:
            unusable: bytes = self._ray.get(next(answers))
            if unusable:
                raise UserError(unusable.decode())
            if not self._ray.wait([answers], timeout=limit)[0]:
                self._ray.cancel(answers, force=True)
                raise self._ray.exceptions.GetTimeoutError

            result: bytes = self._ray.get(next(answers))
            next(answers, None)  # its end: the process is free for the next chunk

            return result
        finally:
            with self._lock:
                self._tasks.pop(id(answers), None)
                self._lock.notify_all()

    def _room(self, batches: bool) -> int:
        """Count the workers that the cluster has room for; with ``batches`` one uses a whole machine.

        Raises:
            UserError: it has fewer cores or graphics cards than one worker needs.
        """
        has = self._ray.cluster_resources()
        room = has.get("CPU", 0) / self._num_cpus
        if room < 1:
            raise UserError(
                f"executor.num_cpus={self._num_cpus:g}: the cluster has {has.get('CPU', 0):g} cores; "
                "where it grows by itself, set executor.workers"
            )

        if self._num_gpus > 0:
            cards = has.get("GPU", 0)
            if cards < self._num_gpus:
                raise UserError(
                    f"executor.num_gpus={self._num_gpus:g}: the cluster has {cards:g} graphics cards"
                )

            room = min(room, cards / self._num_gpus)
        elif batches:
            return 1

        return int(room)

    def _connect(self) -> None:
        """Connect to the cluster, or start one.

        Raises:
            UserError: there is no cluster, or it can't be used.
        """
        settings: dict[str, Any] = {"address": self._address}
        if self._address is None:
            wanted = math.ceil((self._workers or 1) * self._num_cpus)
            settings = {
                "address": "local",
                "num_cpus": max(wanted, cores()),
                "include_dashboard": False,
            }

        self._connected = True  # perhaps in part only
        # The public switch, RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER=0, is read when Ray is imported: too late if it has been
        # before, and it would hold for a cluster that the process joins later. So what it sets is set.
        constants = self._ray._private.ray_constants
        usual = constants.ENABLE_RAY_CLUSTER
        # A cluster that is started here listens on 127.0.0.1 only, as on macOS and Windows, not on all addresses.
        constants.ENABLE_RAY_CLUSTER = usual and self._address is not None

        try:
            with _hold_interrupts():
                self._ray.init(
                    **settings,
                    logging_level=logging.ERROR,
                    configure_logging=False,
                    log_to_driver=False,
                )
        except (
            Exception
        ) as error:  # Ray has no class of its own for what can go wrong here
            why = str(error).strip().splitlines()[0]
            raise UserError(
                f"no Ray cluster {self._address or 'on this machine'}: {why}"
            ) from error
        finally:
            constants.ENABLE_RAY_CLUSTER = usual

    def close(self) -> None:
        with self._lock:
            self._closed = True
            for waited in self._tasks.values():
                with suppress(Exception):  # gone already, with its node or the cluster
                    self._ray.cancel(waited, force=True)
            self._lock.wait_for(lambda: not self._tasks, _END_S)
        if self._connected:
            self._ray.shutdown()
        self._connected = False


@contextmanager
def _hold_interrupts() -> Iterator[None]:
    """Hold the first interrupt back until Ray has started: what it has started in part it does not end."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    held = list[int]()
    handler: Any = signal.getsignal(signal.SIGINT)
    terminate = signal.getsignal(signal.SIGTERM)

    def hold(number: int, frame: Any) -> None:
        if held:
            handler(number, frame)
        held.append(number)

    if callable(handler):
        signal.signal(signal.SIGINT, hold)
    try:
        yield
    finally:
        if callable(handler):
            signal.signal(signal.SIGINT, handler)
        if terminate is not None:
            signal.signal(signal.SIGTERM, terminate)  # Ray replaces it
    if held:
        raise KeyboardInterrupt


def _reach(address: str) -> None:
    """Check that something listens at the address; Ray itself would try for minutes.

    Raises:
        UserError: nothing does.
    """
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if address in ("auto", "local"):
        return
    if not host or not port.isdigit():
        raise UsageError(
            f"executor.address must be HOST:PORT, ray://HOST:PORT or auto, got {address!r}"
        )

    try:
        socket.create_connection((host, int(port)), timeout=_REACH_S).close()
    except (OSError, OverflowError) as error:
        raise UserError(
            f"executor.address={address}: nothing answers there ({error})"
        ) from error


@cache
def _keep_scratch() -> None:
    """Keep this process's temporary files in a folder that goes with it."""
    use_scratch(scratch())


def _work(job: bytes) -> Iterator[bytes]:
    """Call a pickled function with a pickled chunk in a process of the cluster, and yield the pickled result.

    What the function needs is imported and made first, which counts for no chunk's time. Then comes an empty answer, as
    the chunk begins; or why it can't.
    """
    _keep_scratch()

    try:
        function, chunk = pickle.loads(job)  # noqa: S301  # from the process that started this one
        getattr(function, "prepare", lambda: None)()
    except RAISED as error:
        what = f"{type(error).__name__}: {error}"
        yield f"workers on the Ray cluster can't be used: {what}".encode()
        return

    yield b""

    try:
        result = pickle.dumps(function(chunk))
    except RAISED as error:
        result = pickle.dumps(portable(error))

    yield result
