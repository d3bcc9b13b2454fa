"""Errors for a user's mistakes. The commands print them as one line, without a traceback."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping

RAISED = (Exception, SystemExit)
"""What to catch around the code of a plugin. `sys.exit` raises no Exception, and must not end a run without a word."""


class UserError(Exception):
    """A mistake of the user; the message says what is wrong, where, and what is possible."""


class NoPicture(UserError):
    """No picture can be drawn; the message says why, and what to do."""


class UsageError(UserError):
    """A command, a setting or a name that does not exist or can't be read."""


class LimitReached(UserError):
    """A spending limit is reached: no further request is sent, and the run ends with its best so far."""


class Fault(Exception):
    """The machine failed, not a design: no room on a disk, no memory, a worker that was killed."""


def fault(error: BaseException | None) -> str | None:
    """Describe the fault of the machine behind an error, in one line; None: there is none.

    Neither an OSError nor a lack of memory nor a missing module says anything about a design.
    """
    described = error
    while error is not None:
        no_thread = isinstance(error, RuntimeError) and "can't start new thread" in str(
            error
        )
        if no_thread or isinstance(error, Fault | OSError | MemoryError | ImportError):
            named = isinstance(described, Fault | UserError) or described is not error
            text = (
                str(described) if named else f"{type(described).__name__}: {described}"
            )
            return " ".join(text.split()).removesuffix(":")
        error = error.__cause__
    return None


def check_positive(where: str, **numbers: float) -> None:
    """Refuse numbers that are not finite and greater than 0.

    Raises:
        UsageError: the message names the number.
    """
    for name, number in numbers.items():
        if not (math.isfinite(number) and number > 0):
            raise UsageError(f"{where}{name} must be greater than 0, got {number}")


def refuse(where: str, problems: Mapping[str, object]) -> None:
    """Raise a ValueError for the first of some problems that is there.

    Args:
        where: what has them, such as ``joint 'lid': ``.
        problems: by their messages, whether each is there.
    """
    for problem, found in problems.items():
        if found:
            raise ValueError(f"{where}{problem}")


def choices(
    kind: str, wrong: str, possible: Iterable[str], where: str = ""
) -> UsageError:
    """Build the error for the unknown name ``wrong``: it lists the possible names, and suggests the closest."""
    names = sorted(possible)
    close = difflib.get_close_matches(
        wrong.lower(), [name.lower() for name in names], n=1, cutoff=0.6
    )
    meant = [name for name in names if close and name.lower() == close[0]]
    hint = f" (did you mean {meant[0]!r}?)" if meant else ""
    at = f" in {where}" if where else ""
    listed = ", ".join(names) if names else "none"
    return UsageError(f"no {kind} {wrong!r}{at}{hint}; possible: {listed}")
