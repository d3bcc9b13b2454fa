"""Wait for a machine that fails for a while, and go on with the run: a full disk, a model's server that is away.

The run ends as it would without patience, and is resumed from its store. So what may be resumed may be waited for.
"""

from __future__ import annotations

import errno
import sqlite3
import sys
import time
from collections.abc import Callable
from pathlib import Path

from core.errors import Fault, NoAnswer, UsageError, UserError
from core.events import Result
from core.search.outcome import resume_hint
from core.store.recorder import RunStore
from core.support.cli import say
from core.support.interrupts import resumable

FIRST_WAIT_S = 10.0
LONGEST_WAIT_S = 300.0

# No room, no memory, no file handles, a disk or a network that does not answer. A folder that is read-only stays so.
_PASSING = {
    getattr(errno, name)
    for name in (
        *("ENOSPC", "EDQUOT", "EFBIG", "EIO", "ENOMEM", "EAGAIN", "EMFILE", "ENFILE"),
        *("ESTALE", "ETIMEDOUT", "EHOSTDOWN", "EHOSTUNREACH", "ENETDOWN"),
    )
    if hasattr(errno, name)
}
_PASSING_IN_SQLITE = ("SQLITE_FULL", "SQLITE_IOERR", "SQLITE_BUSY", "SQLITE_NOMEM")


def run_patiently(
    start: Callable[[RunStore | None], Result],
    folder: Path,
    store: RunStore | None,
    patience_s: float,
) -> Result:
    """Start a run; after an error that may pass wait, and go on with what the folder holds.

    Args:
        start: starts a run, or goes on with the one whose store is given.
        folder: of the run.
        store: of the run that is resumed; None: it is new.
        patience_s: seconds to wait in all, counted anew once the run has come further; 0: the first error ends the run.

    Raises:
        UserError: of the run, if it can't pass or has not passed in this time.
        UsageError: a time below 0.
        KeyboardInterrupt: while it waits; says how to go on.
    """
    if not patience_s >= 0:
        raise UsageError(f"patience_s must be 0 or greater, got {patience_s}")

    overrides = () if store is None else store.overrides
    waits = _Waits(patience_s)
    while True:
        try:
            if waits.begun:
                store = RunStore.open(folder)
                waits.note_progress(store)
            if store is not None:
                store.overrides = overrides
            return start(store)
        except UserError as error:
            if store is not None:
                store.run_ended()
            if not may_pass(error) or waits.left_s <= 0:
                raise
            store = None
            with resumable(resume_hint(folder)):
                waits.wait(error)


class _Waits:
    """How long is waited, and what the run had come to.

    Attributes:
        left_s: seconds that may still be waited.
        begun: whether there was a wait already.
    """

    def __init__(self, patience_s: float) -> None:
        self._patience_s = patience_s
        self._come: int | None = None
        self._begin()
        self.begun = False

    def _begin(self) -> None:
        self.left_s = self._patience_s
        self._next_s = FIRST_WAIT_S

    def note_progress(self, store: RunStore | None) -> None:
        """Count anew if more is stored than after the last wait."""
        past = None if store is None else store.past
        come = 0 if past is None else len(past.replies) + len(past.trials)
        if self._come is not None and come > self._come:
            self._begin()
        self._come = come

    def wait(self, error: UserError) -> None:
        """Say why, and wait: twice as long each time, within what is left."""
        wait_s = min(self._next_s, self.left_s)
        cause = error.__cause__  # without the words to type
        why = cause if isinstance(cause, UserError) else error
        say(
            f"{why}; this may pass: the run goes on by itself in {wait_s:g} s, and gives up after "
            f"{self.left_s:g} s (patience_s={self._patience_s:g})",
            file=sys.stderr,
        )
        time.sleep(wait_s)
        self.left_s -= wait_s
        self._next_s = min(2 * self._next_s, LONGEST_WAIT_S)
        self.begun = True


def may_pass(error: BaseException) -> bool:
    """Say if what is behind an error may be over later, without anyone changing the run."""
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, Fault | NoAnswer | MemoryError):
            return True
        if isinstance(cause, OSError) and cause.errno in _PASSING:
            return True
        name = getattr(cause, "sqlite_errorname", "")
        if isinstance(cause, sqlite3.Error) and name.startswith(_PASSING_IN_SQLITE):
            return True
        cause = cause.__cause__

    return False
