"""Workers on a Ray cluster: actors that live as long as their node, each with one chunk at a time.

A chunk waits for the next free actor. So no chunk waits for an actor that the cluster has no room for, from the start
or since a node was lost.
"""

from __future__ import annotations

import logging
import math
import os
import pickle
import queue
import signal
import socket
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from functools import partial
from typing import Any, TypeVar

from core.errors import RAISED, Fault, UsageError, UserError, check_positive
from core.interfaces import Executor
from core.support.cli import say
from core.support.scratch import scratch, use_scratch
from core.support.threads import run_in_thread
from plugins.executors.dispatch import check_limits, cores, dispatch, portable, time_limit

A = TypeVar("A")
B = TypeVar("B")

_REACH_S = 5.0
_STARTS = 3  # attempts to start a worker
_PATIENCE_S = 30.0  # then standard error says that no worker has started
_END_S = 10.0  # for calls in progress to notice that their workers are gone


class RayExecutor(Executor):
    """Long-lived workers on the nodes of a Ray cluster, where the same version of this program has to be installed.

    A chunk that is lost with a worker or its node is tried again elsewhere.

    Args:
        address: of a running cluster: ``HOST:PORT``, ``ray://HOST:PORT`` or ``auto``; None: a cluster is started on
            this machine, and ends with the run.
        workers: the number of workers; None: as many as the cluster's cores and graphics cards allow, or one for an
            engine with batches that uses no card.
        num_cpus: cores that the cluster reserves for each worker.
        num_gpus: graphics cards that it reserves for each worker; with 0.5 two workers share one.
        retries: how often a chunk is tried again after its worker was lost.
        timeout_s: seconds for a candidate, and for a chunk of up to ten. A chunk that takes longer is given up, and its
            worker is replaced. None: no limit. Waiting for room on the cluster does not count.
    """

    def __init__(
        self,
        address: str | None = None,
        workers: int | None = None,
        num_cpus: float = 1.0,
        num_gpus: float = 0.0,
        retries: int = 2,
        timeout_s: float | None = 300.0,
    ) -> None:
        check_limits(workers, timeout_s)
        if retries < 0:
            raise UsageError(f"executor.retries must be 0 or greater, got {retries}")
        check_positive("executor.", num_cpus=num_cpus)
        if not 0 <= num_gpus < math.inf:
            raise UsageError(f"executor.num_gpus must be 0 or greater, got {num_gpus}")
        os.environ.setdefault("RAY_ENABLE_AUTO_CONNECT", "0")  # or it starts a cluster where it has lost one
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        if address is not None:  # a cluster that is there answers the first time
            os.environ.setdefault("RAY_NUM_REDIS_GET_RETRIES", "3")
        try:
            import ray
        except ModuleNotFoundError as error:
            raise UserError("executor=ray needs Ray: pip install 'ray>=2.40'") from error
        if address is not None:
            _reach(address)
        self._ray = ray
        self._address = address
        self._workers = workers
        self._num_cpus = num_cpus
        self._num_gpus = num_gpus
        self._retries = retries
        self._timeout_s = timeout_s
        self._connected = False
        self._crew: _Crew | None = None

    def map(self, function: Callable[[A], B], chunks: Iterable[A]) -> Iterator[tuple[A, B | Exception]]:
        """See `Executor.map` and `plugins.executors.dispatch.dispatch`."""
        if self._crew is None:
            self._connect()
            count = self._workers or self._room(getattr(function, "batch", 1) > 1)
            actor = self._ray.remote(_Worker).options(
                num_cpus=self._num_cpus, num_gpus=self._num_gpus, max_restarts=0, scheduling_strategy="SPREAD"
            )
            self._crew = _Crew(self._ray, actor, count, self._retries, self._timeout_s)
        self._crew.gather(function)
        return dispatch([partial(self._crew.call, function)] * self._crew.count, chunks)

    def _room(self, batches: bool) -> int:
        """Count the workers that the cluster has room for, at least one; with ``batches`` one uses a whole machine.

        Raises:
            UserError: it has fewer graphics cards than one worker needs.
        """
        has = self._ray.cluster_resources()
        room = has.get("CPU", 0) / self._num_cpus
        if self._num_gpus > 0:
            cards = has.get("GPU", 0)
            if cards < self._num_gpus:
                raise UserError(f"executor.num_gpus={self._num_gpus:g}: the cluster has {cards:g} graphics cards")
            room = min(room, cards / self._num_gpus)
        elif batches:
            return 1
        return max(1, int(room))

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
                "num_cpus": max(wanted, cores() if self._workers is None else 0),
                "include_dashboard": False,
            }
        self._connected = True  # perhaps in part only
        with _signals_kept(), nullcontext() if self._address else _loopback(self._ray):
            try:
                self._ray.init(**settings, logging_level=logging.ERROR, configure_logging=False, log_to_driver=False)
            except Exception as error:  # Ray has no class of its own for what can go wrong here
                where, hint = self._address or "on this machine", ""
                if self._address is not None and "RAY_AUTH_MODE" not in os.environ:
                    hint = "; one that asks for a token needs RAY_AUTH_MODE=token in the environment"
                why = str(error).strip().splitlines()[0]
                raise UserError(f"no Ray cluster {where}: {why}{hint}") from error

    def close(self) -> None:
        if self._crew is not None:
            self._crew.close()
        if self._connected:
            self._ray.shutdown()
        self._crew, self._connected = None, False


def _reach(address: str) -> None:
    """Check that something listens at the address; Ray itself would try for minutes.

    Raises:
        UserError: nothing does.
    """
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if address in ("auto", "local"):
        return
    if not host or not port.isdigit():
        raise UsageError(f"executor.address must be HOST:PORT, ray://HOST:PORT or auto, got {address!r}")
    try:
        socket.create_connection((host, int(port)), timeout=_REACH_S).close()
    except (OSError, OverflowError) as error:
        raise UserError(f"executor.address={address}: nothing answers there ({error})") from error


@contextmanager
def _loopback(ray: Any) -> Iterator[None]:
    """Let a cluster that is started within listen on 127.0.0.1 only, as on macOS and Windows, not on all addresses."""
    constants = ray._private.ray_constants
    before = constants.ENABLE_RAY_CLUSTER
    constants.ENABLE_RAY_CLUSTER = False
    try:
        yield
    finally:
        constants.ENABLE_RAY_CLUSTER = before


@contextmanager
def _signals_kept() -> Iterator[None]:
    """Keep this program's signal handlers: Ray replaces the one for SIGTERM."""
    mine = threading.current_thread() is threading.main_thread()
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)} if mine else {}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


class _Closed(Exception):
    """The executor is closed."""


class _Crew:
    """``count`` actors. One that is lost is replaced, on any node that has room."""

    def __init__(self, ray: Any, actor: Any, count: int, retries: int, timeout_s: float | None) -> None:
        self.count = count
        self._ray = ray
        self._elsewhere = (ray.exceptions.OutOfMemoryError, ray.exceptions.NodeDiedError)  # no fault of a chunk
        self._make = actor
        self._retries = retries
        self._timeout_s = timeout_s
        self._actors: set[Any] = set()  # ready, busy, or waiting for room
        # Free actors; a UserError if there will be none; None at the end.
        self._free: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._lock = threading.Condition()
        self._waiting = 0  # threads in Ray's code
        self._begun = self._warned = self._closed = False

    def gather(self, function: Callable[..., Any]) -> None:
        """Start the actors that are missing."""
        with self._lock:
            missing = self.count - len(self._actors)
        for _ in range(missing):
            self._hire(pickle.dumps(function))

    def call(self, function: Callable[[A], B], chunk: A) -> B | Exception:
        """Return the result of ``function`` for ``chunk``, or an exception that says why there is none.

        Raises:
            UserError: no actor could be started.
        """
        job = pickle.dumps((function, chunk))
        limit = time_limit(self._timeout_s, chunk)
        machine, why = False, ""
        for _ in range(1 + self._retries):
            actor = self._take(function)
            if actor is None:
                return RuntimeError("the executor is closed")
            try:
                result = self._wait(partial(actor.work.remote, job), limit)
            except _Closed:
                return RuntimeError("the executor is closed")
            except self._ray.exceptions.GetTimeoutError:
                self._replace(actor, function)
                return RuntimeError("the rollout took longer than executor.timeout_s and was given up")
            except self._ray.exceptions.RayError as error:
                self._replace(actor, function)
                machine, why = isinstance(error, self._elsewhere), _first_line(error)
            else:
                answer = pickle.loads(result)  # noqa: S301
                if not isinstance(answer, Fault):
                    self._free.put(actor)
                    return answer  # type: ignore[no-any-return]
                self._replace(actor, function)
                machine, why = True, str(answer)
        return (Fault if machine else RuntimeError)(f"the worker was lost {1 + self._retries} times: {why}")

    def _take(self, function: Callable[..., Any]) -> Any:
        """Take the next free actor that is still alive; None: the executor is closed.

        Raises:
            UserError: no actor can be started.
        """
        while True:
            try:
                actor = self._free.get(timeout=_PATIENCE_S)
            except queue.Empty:
                self._warn()
                continue
            if isinstance(actor, UserError):
                self._free.put(actor)  # for the others
                raise actor
            if actor is None:
                return None
            try:
                self._wait(actor.ping.remote, None)
            except _Closed:
                return None
            except self._ray.exceptions.RayError:  # its node was lost while it had nothing to do
                self._replace(actor, function)
            else:
                return actor

    def _warn(self) -> None:
        """Say once that no worker has started yet: the cluster may have no room."""
        with self._lock:
            first, self._warned = not (self._begun or self._warned), True
        if first:
            say(f"executor=ray: no worker has started for {_PATIENCE_S:.0f} s; has the cluster room?", file=sys.stderr)

    def _hire(self, function: bytes) -> None:
        def ended(error: Exception | None) -> None:
            if error is not None:
                self._free.put(UserError(f"workers on the Ray cluster can't be used: {_first_line(error)}"))

        run_in_thread(partial(self._start, function), ended, "hire")

    def _start(self, function: bytes) -> None:
        """Start an actor, and check that it can work."""
        why = ""
        for _ in range(_STARTS):
            with self._lock:
                if self._closed:
                    return
                actor = self._make.remote()
                self._actors.add(actor)
            try:
                self._wait(partial(actor.ready.remote, function), None)
            except _Closed:
                return
            except self._ray.exceptions.RayTaskError as error:  # it lives, and would fail the next time too
                self._bury(actor)
                why = _first_line(error.cause)
                break
            except self._ray.exceptions.RayError as error:
                self._bury(actor)
                why = _first_line(error)
            else:
                self._begun = True
                self._free.put(actor)
                return
        if not self._closed:
            self._free.put(UserError(f"workers on the Ray cluster can't be used: {why}"))

    @contextmanager
    def _in_ray(self) -> Iterator[None]:
        """Keep Ray from being shut down: what calls it afterwards ends the whole process.

        Raises:
            _Closed: the executor is closed.
        """
        with self._lock:
            if self._closed:
                raise _Closed
            self._waiting += 1
        try:
            yield
        finally:
            with self._lock:
                self._waiting -= 1
                self._lock.notify_all()

    def _wait(self, call: Callable[[], Any], limit: float | None) -> Any:
        """Wait for the result of a remote call."""
        with self._in_ray():
            return self._ray.get(call(), timeout=limit)

    def _replace(self, actor: Any, function: Callable[..., Any]) -> None:
        self._bury(actor)
        self._hire(pickle.dumps(function))

    def _bury(self, actor: Any) -> None:
        with self._lock:
            self._actors.discard(actor)
        with suppress(Exception), self._in_ray():  # gone already, with its node or the cluster
            self._ray.kill(actor)

    def close(self) -> None:
        """End the actors. Threads that wait for one notice it before Ray itself is shut down."""
        with self._lock:
            self._closed = True
            actors = list(self._actors)
        for actor in actors:
            with suppress(Exception):  # gone already
                self._ray.kill(actor)
        for _ in range(self.count):
            self._free.put(None)
        with self._lock:
            self._lock.wait_for(lambda: not self._waiting, _END_S)


def _first_line(error: BaseException) -> str:
    return f"{type(error).__name__}: {str(error).strip()}".splitlines()[0]


class _Worker:
    """The actor: it calls a pickled function with a pickled chunk, and returns the pickled result."""

    def ready(self, function: bytes) -> None:
        """Import and make what ``function`` needs. It takes a while, and counts for no chunk's time."""
        use_scratch(scratch())
        needed = pickle.loads(function)  # noqa: S301  # from the process that started this one
        getattr(needed, "prepare", lambda: None)()

    def ping(self) -> None:
        """Do nothing: the actor is alive."""

    def work(self, job: bytes) -> bytes:
        try:
            function, chunk = pickle.loads(job)  # noqa: S301
            return pickle.dumps(function(chunk))
        except RAISED as error:
            return pickle.dumps(portable(error))
