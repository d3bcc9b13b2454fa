"""Join two threads: the protocol's, in which an agent's calls arrive, and the run's, in which all of them are answered.

An engine is used by one thread, and so is what draws. So calls wait in line until the run's thread takes them, one
after the other.
"""

from __future__ import annotations

import logging
import queue
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from core.errors import RAISED, UserError, in_line
from core.interfaces import Picture, Text
from core.support.progress_display import find_step

MOST_WAITING = 16
"""The most calls that wait in line; more are refused at once."""

Answer = Sequence[Text | Picture]
"""What a call gives, in the order in which it is shown."""

_ENDED = "this run has come to its end, and its winner lies in best/ in its folder; begin another one in another folder"
"""Said where the run had ended before the agent came."""

_log = logging.getLogger(__name__)


class Refused(UserError):
    """A call that can't be done; the message is for the agent: what is wrong, and what to do."""


class Later(Exception):
    """A call whose answer comes later: the run goes on to make it.

    Attributes:
        designs: the document to try; None: the agent has finished.
    """

    def __init__(self, designs: str | None) -> None:
        super().__init__()
        self.designs = designs


class Desk(Protocol):
    """Does what calls ask for, in the run's thread."""

    def do(self, name: str, arguments: Mapping[str, Any]) -> Answer:
        """Do a call.

        Raises:
            Refused: it can't be done.
            Later: the run has to go on first.
        """


@dataclass(frozen=True, eq=False)
class Call:
    """A call of a tool that waits for its answer.

    Attributes:
        name: of the tool.
        arguments: by name, as the tool's schema has them.
        future: of the answer; one that is cancelled before its turn is left out.
    """

    name: str
    arguments: Mapping[str, Any]
    future: Future[Answer] = field(default_factory=Future)


@dataclass(eq=False)
class Bench:
    """The line of an agent's calls, and the one whose answer the run is making.

    **Threads.** `submit`, `describe` and `leave` are called by the protocol's thread, the others by the run's.

    Attributes:
        interrupt: interrupts the run's thread.
        desk: does what calls ask for; None: there is no search, or not yet.
        folder: of the run; None: it has not begun.
        has_ended: the run has come to its end.
        agent: the name of the program that calls, as it says itself.
        doing: what the run is at, in words.
        designs: the document that is to be tried.
        is_trying: designs that a call brought are being tried.
    """

    interrupt: Callable[[], None] = lambda: None
    desk: Desk | None = None
    folder: Path | None = None
    has_ended: bool = False
    agent: str = ""
    doing: str = "the run is being made ready"
    designs: str | None = None
    is_trying: bool = False
    _line: queue.Queue[Call | None] = field(default_factory=queue.Queue)
    _open: Call | None = None
    _ended: str | None = None

    # --- the protocol's thread ----------------------------------------------------------------------------------

    def submit(self, name: str, arguments: Mapping[str, Any]) -> Future[Answer]:
        """Put a call in line.

        Raises:
            Refused: too many calls wait, or nobody answers any more.
        """
        if self._ended is not None:
            raise Refused(self._ended)
        if self._line.qsize() >= MOST_WAITING:
            raise Refused(
                f"{MOST_WAITING} calls wait already; this one is left out: call again when one of them is answered"
            )

        call = Call(name, arguments)
        self._line.put(call)
        return call.future

    def describe(self) -> str:
        """Say what the run is at."""
        step = find_step()
        return f"{self.doing}: {step}" if step and not self.is_trying else self.doing

    def leave(self) -> None:
        """Say that no further call will come. What is being tried is interrupted; finals go on to their end."""
        self._line.put(None)
        if self.is_trying:
            self.interrupt()

    # --- the run's thread ---------------------------------------------------------------------------------------

    def wait(self) -> bool:
        """Answer calls until one brings designs (True), which are then `designs`, or says that it is done (False).

        Raises:
            KeyboardInterrupt: the agent has left.
        """
        while True:
            self.is_trying = False
            call = self._line.get()
            if call is None:
                raise KeyboardInterrupt
            # One whose caller does not wait for it any more is left out.
            if not call.future.set_running_or_notify_cancel():
                continue

            self.doing = f"doing {call.name}"
            if self.desk is None:
                call.future.set_exception(Refused(_ENDED))
                continue

            try:
                call.future.set_result(self.desk.do(call.name, call.arguments))
            except Later as later:
                self._open = call
                self.designs = later.designs
                self.is_trying = later.designs is not None
                self.doing = "trying" if self.is_trying else "finals"
                return self.is_trying
            except Refused as refused:
                call.future.set_exception(refused)
            except RAISED as error:
                # A picture that fails costs the picture, never the run.
                _log.warning("%s failed", call.name, exc_info=error)
                call.future.set_exception(Refused(f"{call.name}: {in_line(error)}"))

    def serve(self) -> None:
        """Answer calls after the run has ended.

        Raises:
            KeyboardInterrupt: the agent has left.
        """
        while True:
            self.wait()

    def answer(self, answer: Callable[[], Answer]) -> None:
        """Answer the call that the run went on for, if there is one."""
        call = self._open
        self._open = None
        if call is None:
            return
        try:
            call.future.set_result(answer())
        except RAISED as error:
            _log.warning("%s failed", call.name, exc_info=error)
            call.future.set_exception(Refused(f"{call.name}: {in_line(error)}"))

    def end(self, why: str) -> bool:
        """Refuse the calls that wait, and those that still come; return whether any waited."""
        self._ended = why
        waiting = [self._open]
        self._open = None
        while not self._line.empty():
            waiting.append(self._line.get())

        left = [call for call in waiting if call and not call.future.done()]
        for call in left:
            call.future.set_exception(Refused(why))
        return bool(left)


_bench: list[Bench] = []


def open_bench(interrupt: Callable[[], None]) -> Bench:
    """Open this process's bench: as its input and output, there is one."""
    assert not _bench, "a process has one bench"
    _bench.append(Bench(interrupt))
    return _bench[0]


def find_bench() -> Bench | None:
    """Return this process's bench; None: no agent is there."""
    return next(iter(_bench), None)
