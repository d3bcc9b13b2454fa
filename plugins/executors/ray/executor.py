"""Workers on a Ray cluster: actors that live as long as their node, each with one chunk at a time."""

from __future__ import annotations

import logging
import os
import pickle
import signal
import socket
import threading
from collections.abc import Callable, Iterable, Iterator, Sized
from contextlib import contextmanager, suppress
from functools import partial
from typing import Any, TypeVar

from core.dealing import deal
from core.errors import UsageError, UserError, check_positive
from core.interfaces import Executor

A = TypeVar("A")
B = TypeVar("B")

_REACH_S = 5.0


class RayExecutor(Executor):
    """Long-lived workers on the nodes of a Ray cluster, where this program has to be installed as it is here. What is
    lost with a worker or its node is tried again elsewhere.

    Args:
        address: of a cluster that is there: ``HOST:PORT``, ``ray://HOST:PORT`` or ``auto``; None: one is started on
            this machine, and ends with the run.
        workers: how many; None: as many as there are cores for.
        num_cpus: cores that the cluster sets aside for each.
        retries: of a chunk whose worker is lost.
        timeout_s: for each candidate; a chunk that takes longer than that for all of its candidates is given up and
            its worker replaced. None: never. Waiting for room on the cluster does not count.
        dashboard: Ray's, on http://127.0.0.1:8265, of a cluster that is started here.
    """

    def __init__(
        self,
        address: str | None = None,
        workers: int | None = None,
        num_cpus: float = 1.0,
        retries: int = 2,
        timeout_s: float | None = 300.0,
        dashboard: bool = False,
    ) -> None:
        if workers is not None and workers < 1:
            raise UsageError(f"executor.workers must be at least 1, got {workers}")
        if retries < 0:
            raise UsageError(f"executor.retries must be 0 or greater, got {retries}")
        check_positive("executor.", num_cpus=num_cpus)
        if timeout_s is not None:
            check_positive("executor.", timeout_s=timeout_s)
        os.environ.setdefault("RAY_ENABLE_AUTO_CONNECT", "0")  # or it starts a cluster where it has lost one
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        try:
            import ray
        except ModuleNotFoundError as error:
            raise UserError("executor=ray needs Ray: pip install 'vlmgineer[ray]'") from error
        if address is not None:
            _reach(address)
        self._ray = ray
        self._address = address
        self._workers = workers
        self._num_cpus = num_cpus
        self._retries = retries
        self._timeout_s = timeout_s
        self._dashboard = dashboard
        self._pool: list[_Worker] = []

    def map(self, function: Callable[[A], B], chunks: Iterable[A]) -> Iterator[tuple[A, B | Exception]]:
        """See `Executor.map` and `core.dealing.deal`."""
        if not self._pool:
            self._connect()
            count = self._workers or max(1, int(self._ray.cluster_resources().get("CPU", 1) / self._num_cpus))
            actor = self._ray.remote(_Hands).options(
                num_cpus=self._num_cpus, max_restarts=0, scheduling_strategy="SPREAD"
            )
            self._pool = [_Worker(self._ray, actor, self._retries, self._timeout_s) for _ in range(count)]
        return deal([partial(worker.call, function) for worker in self._pool], chunks)

    def _connect(self) -> None:
        """To the cluster, or start one.

        Raises:
            UserError: there is no cluster, or it can't be used.
        """
        settings: dict[str, Any] = {"address": self._address}
        if self._address is None:
            cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
            settings = {
                "address": "local",
                "num_cpus": int(-(-self._workers * self._num_cpus // 1)) if self._workers is not None else cores,
                "include_dashboard": self._dashboard,
                "dashboard_host": "127.0.0.1",
            }
        with _signals_kept():
            try:
                self._ray.init(**settings, logging_level=logging.ERROR, configure_logging=False, log_to_driver=False)
            except Exception as error:  # Ray has no class of its own for what can go wrong here
                where = self._address or "on this machine"
                raise UserError(f"no Ray cluster {where}: {str(error).strip().splitlines()[0]}") from error

    def close(self) -> None:
        for worker in self._pool:
            worker.close()
        if self._pool:
            self._ray.shutdown()
        self._pool = []


def _reach(address: str) -> None:
    """Refuse an address where nobody listens; Ray itself would try for minutes.

    Raises:
        UserError: says so.
    """
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if address in ("auto", "local"):
        return
    if not host or not port.isdigit():
        raise UsageError(f"executor.address must be HOST:PORT, ray://HOST:PORT or auto, got {address!r}")
    try:
        socket.create_connection((host, int(port)), timeout=_REACH_S).close()
    except (OSError, OverflowError) as error:
        raise UserError(f"executor.address={address}: nobody answers there ({error})") from error


@contextmanager
def _signals_kept() -> Iterator[None]:
    """Ray takes over SIGTERM; how this program ends is its own business."""
    mine = threading.current_thread() is threading.main_thread()
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)} if mine else {}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


class _Worker:
    """One actor, started when it is needed, and anew, on whatever node has room, when it is lost."""

    def __init__(self, ray: Any, actor: Any, retries: int, timeout_s: float | None) -> None:
        self._ray = ray
        self._make = actor
        self._retries = retries
        self._timeout_s = timeout_s
        self._actor: Any = None
        self._closed = False

    def call(self, function: Callable[[A], B], chunk: A) -> B | Exception:
        """What ``function`` makes of ``chunk`` in the worker, or an exception that says why nothing came of it."""
        job = pickle.dumps((function, chunk))
        limit = self._timeout_s
        if limit is not None and isinstance(chunk, Sized):
            limit *= max(1, len(chunk))
        why = ""
        for _ in range(1 + self._retries):
            try:
                if self._closed:
                    return RuntimeError("the executor is closed")
                if self._actor is None:
                    self._actor = self._make.remote()
                self._ray.get(self._actor.ready.remote())
                result = pickle.loads(self._ray.get(self._actor.work.remote(job), timeout=limit))  # noqa: S301
            except self._ray.exceptions.GetTimeoutError:
                self._bury()
                return RuntimeError("the rollout took longer than executor.timeout_s and was given up")
            except self._ray.exceptions.RayError as error:
                self._bury()
                why = str(error).strip().splitlines()[0]
            else:
                return result  # type: ignore[no-any-return]
        return RuntimeError(f"the worker was lost {1 + self._retries} times: {why}")

    def _bury(self) -> None:
        if self._actor is not None:
            with suppress(Exception):  # gone already, with its node or the cluster
                self._ray.kill(self._actor)
            self._actor = None

    def close(self) -> None:
        self._closed = True
        self._bury()


class _Hands:
    """The actor: takes a pickled function and chunk, and gives back what came of them, pickled."""

    def ready(self) -> None:
        """It is there."""

    def work(self, job: bytes) -> bytes:
        function, chunk = pickle.loads(job)  # noqa: S301  # from the process that started this one
        try:
            return pickle.dumps(function(chunk))
        except Exception as error:
            return _portable(error)


def _portable(error: Exception) -> bytes:
    """``error`` pickled, or what is left of it where it can't travel."""
    try:
        pickle.loads(data := pickle.dumps(error))  # noqa: S301
    except Exception:  # whatever its class does
        return pickle.dumps(RuntimeError(f"{type(error).__name__}: {error}"))
    return data
