"""Receives the events of a run and records them for Rerun. No failure in here reaches the run."""

from __future__ import annotations

import contextlib
import os
import sys
import threading
from collections import defaultdict
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Literal

from core.design import best_tools
from core.errors import check_positive
from core.hooks import hookimpl
from core.interfaces import Reply, Request
from core.support.cli import say
from plugins.listeners.rerun.sinks import address, sinks

if TYPE_CHECKING:
    from core.events import Generation, Run
    from plugins.listeners.rerun.streams import Streams
    from plugins.listeners.rerun.writer import Writer

FILE = "recording.rrd"


class RerunListener:
    """Records a run in ``recording.rrd`` in its folder. The first failure is reported in one line and ends the
    recording.

    Args:
        spawn: show the recording as it grows, in a viewer on this machine that is opened if there is none.
        connect: send it to a viewer elsewhere: ``HOST:PORT``, a port of this machine, or Rerun's own address.
        elites: record the rollout of a generation's ``best`` tool, or of ``all`` of its best, at most ``k_top``.
        hz: frames per simulated second.
    """

    def __init__(
        self,
        spawn: bool = False,
        connect: int | str | None = None,
        elites: Literal["best", "all"] = "best",
        hz: float = 25.0,
    ) -> None:
        check_positive("listener.rerun.", hz=hz)
        self._spawn = spawn
        self._connect = None if connect is None else address(connect)
        self._elites = elites
        self._hz = hz
        self._run: Run | None = None
        self._streams: Streams | None = None
        self._writer: Writer | None = None
        self._replies: dict[int, list[tuple[Request, Reply]]] = defaultdict(list)  # by generation
        self._lock = threading.Lock()  # replies come from another thread

    @hookimpl
    def run_started(self, run: Run) -> None:
        self._run = run
        self._attempt(self._open, run)

    @hookimpl
    def reply_received(self, request: Request, reply: Reply) -> None:
        with self._lock:
            self._replies[request.brief.generation].append((request, reply))

    @hookimpl
    def generation_finished(self, generation: Generation) -> None:
        if self._writer is not None and self._streams:
            self._attempt(self._record, generation)

    @hookimpl
    def run_ended(self) -> None:
        if self._streams is not None:
            self._attempt(self._streams.close)
            self._streams = None

    def _open(self, run: Run) -> None:
        with _quiet():  # Rerun takes a third of a second to import, so only now
            from plugins.listeners.rerun.streams import Streams
            from plugins.listeners.rerun.writer import Writer

        targets = sinks(run.folder / FILE, self._spawn, self._connect, _say)
        self._streams = Streams(targets, f"{run.task.name}, {run.folder.name}", _say)
        self._writer = Writer(run, self._streams)

    def _record(self, generation: Generation) -> None:
        assert self._run is not None
        assert self._writer is not None
        ranked = best_tools(generation.ranking)[: self._run.budget.k_top]
        with self._lock:
            replies = sorted(self._replies[generation.index], key=lambda pair: pair[0].id)
        self._writer.generation(generation, ranked, replies)
        shown = list(enumerate(ranked, start=1))[: None if self._elites == "all" else 1]
        for rank, evaluation in reversed(shown):  # the best last: its rollout is the one that stays
            self._writer.rollout(generation.index, rank, evaluation, self._hz)

    def _attempt(self, function: Callable[..., None], *arguments: object) -> None:
        try:
            function(*arguments)
        except Exception as error:  # from Rerun, the disk or the network
            self._writer = None
            _say(f"no recording from here on: {_reason(error)}")


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Keep Rerun, imported in the block, from writing log lines to the terminal; failures are raised as well."""
    before = os.environ.get("RUST_LOG")
    os.environ.setdefault("RUST_LOG", "off")
    try:
        yield
    finally:
        if before is None:
            del os.environ["RUST_LOG"]


def _reason(error: Exception) -> str:
    if isinstance(error, ModuleNotFoundError) and error.name == "rerun":
        return "Rerun is not installed (pip install rerun-sdk)"
    return " ".join(f"{type(error).__name__}: {error}".split())


def _say(what: str) -> None:
    say(f"rerun: {what}", file=sys.stderr)
