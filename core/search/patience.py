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
_PASSING = (
    errno.ENOSPC,
    errno.EDQUOT,
    errno.EIO,
    errno.ENOMEM,
    errno.EMFILE,
    errno.ENFILE,
    errno.ETIMEDOUT,
    errno.EHOSTUNREACH,
)
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

    left_s = patience_s
    wait_s = FIRST_WAIT_S
    come: int | None = None  # what was stored after the last wait
    has_waited = False
    while True:
        try:
            if has_waited:
                store = RunStore.open(folder)
            if has_waited and store is not None:
                stored = len(store.past.replies) + len(store.past.trials)
                if come is not None and stored > come:
                    left_s = patience_s
                    wait_s = FIRST_WAIT_S
                come = stored
            return start(store)
        except UserError as error:
            if store is not None:
                store.run_ended()
            if not may_pass(error) or left_s <= 0:
                raise
            store = None
            wait_s = min(wait_s, left_s)
            cause = error.__cause__  # without the words to type
            why = cause if isinstance(cause, UserError) else error
            say(
                f"{why}; this may pass: the run goes on by itself in {wait_s:g} s, and gives up after "
                f"{left_s:g} s (patience_s={patience_s:g})",
                file=sys.stderr,
            )
            with resumable(resume_hint(folder)):
                time.sleep(wait_s)
            has_waited = True
            left_s -= wait_s
            wait_s = min(2 * wait_s, LONGEST_WAIT_S)


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
