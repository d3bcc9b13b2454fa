"""The errors that a user's mistake raises. The commands print them as one line, without a traceback."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable


class UserError(Exception):
    """What is wrong, where, and what is possible; for a person."""


class NoPicture(UserError):
    """Nothing here can draw a picture; says why, and what would."""


class UsageError(UserError):
    """A command was told something that it doesn't understand."""


class LimitReached(UserError):
    """What a run may spend is spent: no further request is sent, and the run ends with its best so far."""


def check_positive(where: str, **numbers: float) -> None:
    """Refuse numbers that are not finite and greater than 0.

    Raises:
        UsageError: says which.
    """
    for name, number in numbers.items():
        if not (math.isfinite(number) and number > 0):
            raise UsageError(f"{where}{name} must be greater than 0, got {number}")


def choices(kind: str, wrong: str, possible: Iterable[str], where: str = "") -> UsageError:
    """There is no ``wrong``: name the possible ones, and the likeliest."""
    names = sorted(possible)
    close = difflib.get_close_matches(wrong.lower(), [name.lower() for name in names], n=1, cutoff=0.6)
    meant = [name for name in names if close and name.lower() == close[0]]
    hint = f" (did you mean {meant[0]!r}?)" if meant else ""
    at = f" in {where}" if where else ""
    listed = ", ".join(names) if names else "none"
    return UsageError(f"no {kind} {wrong!r}{at}{hint}; possible: {listed}")
