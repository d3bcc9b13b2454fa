"""End a command soon after a signal, whatever it is doing.

The first signal raises `KeyboardInterrupt` in the main thread, which wakes what waits. It may be lost: Python swallows
what a destructor raises, and libraries call back. Then it is raised again, as soon as Python says that it was lost; a
loop asks `check_interrupt`. A command that is still there after `GRACE_S`, as in a long call of a library, is ended.
That loses nothing: what a run has paid for is on the disk when it is known.
"""

from __future__ import annotations

import math
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from os import _exit
from typing import Any

from core.support.scratch import remove_scratch

GRACE_S = 2.0
"""A command may take so long to clean up after a signal."""
WRITE_S = 20.0
"""A run that has taken an interrupt may take so long to write what it came to, on a machine that is busy."""
_AGAIN_S = 0.02  # until an interrupt that was lost is raised again
_LAST_WORDS_S = 0.3
_SIGNALS = (signal.SIGINT, signal.SIGTERM)

_hints: list[str] = []


class Interrupts:
    """The handler of signals, which also listens to them in a thread of its own: the main thread may be in a library.

    A second signal ends the process at once. Some senders signal the process, then its group: signals within a second
    count as one.

    Args:
        end: prints a line and ends the process, whatever other threads do.
    """

    def __init__(self, end: Callable[[str], object]) -> None:
        self.first = math.inf
        self.is_writing = False
        self._end = end
        self._was_lost = False

    def listen(self) -> None:
        """Take the signals of the process from now on."""
        for number in _SIGNALS:
            # Ignored where a shell runs it in the background.
            if signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, self)

        heard, told = os.pipe()
        os.set_blocking(told, False)
        signal.set_wakeup_fd(told, warn_on_full_buffer=False)
        threading.Thread(target=self._limit, args=(heard,), daemon=True).start()
        sys.unraisablehook = self._raise_again

    def __call__(self, *_: object) -> None:
        now = time.monotonic()
        is_new = now < self.first
        if not (is_new or self._was_lost):
            if now > self.first + 1.0:
                remove_scratch()
                _exit(130)
            return

        self.first = min(now, self.first)
        self._was_lost = False
        raise KeyboardInterrupt

    def _limit(self, heard: int) -> None:
        """Wait for a signal, and end the process if it is there after a while."""
        while os.read(heard, 1)[0] not in _SIGNALS:
            pass
        time.sleep(GRACE_S)
        if self.is_writing:
            time.sleep(WRITE_S - GRACE_S)
        # Even if nobody reads what is printed.
        threading.Timer(_LAST_WORDS_S, _exit, (130,)).start()
        self._end(describe_interrupt())

    def _raise_again(self, lost: Any) -> None:
        """Raise an interrupt again that Python could not pass on; of all else say what Python says."""
        if not issubclass(lost.exc_type, KeyboardInterrupt):
            sys.__unraisablehook__(lost)
            return

        self._was_lost = True
        main = threading.main_thread().ident
        assert main is not None
        threading.Timer(_AGAIN_S, signal.pthread_kill, (main, signal.SIGINT)).start()


def check_interrupt() -> None:
    """Raise `KeyboardInterrupt` if a signal has come: a loop goes on where the first one was swallowed."""
    handler = signal.getsignal(signal.SIGINT)
    if isinstance(handler, Interrupts) and handler.first < math.inf:
        raise KeyboardInterrupt


def allow_writing() -> None:
    """Give the process `WRITE_S` to write what it came to: the interrupt has arrived where that is done."""
    handler = signal.getsignal(signal.SIGINT)
    if isinstance(handler, Interrupts):
        handler.is_writing = True


def was_interrupted() -> bool:
    """Report whether a signal came; where a command does not listen to them, nobody can tell, and it may have."""
    handler = signal.getsignal(signal.SIGINT)
    return not isinstance(handler, Interrupts) or handler.first < math.inf


@contextmanager
def resumable(hint: str) -> Iterator[None]:
    """Say how to go on, if an interrupt ends what is done here."""
    _hints.append(hint)
    try:
        yield
    except KeyboardInterrupt:
        raise KeyboardInterrupt(hint) from None
    finally:
        _hints.remove(hint)


def describe_interrupt(*hints: object) -> str:
    """Say that a command was interrupted, and how to go on; without ``hints`` as what it is doing says."""
    return "; ".join(["interrupted", *map(str, hints or _hints[:1])])
