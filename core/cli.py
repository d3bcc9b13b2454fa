"""How the commands end: 0 done, 1 error, 2 wrong usage, 130 interrupted; a mistake is one line on standard error."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

from core.errors import UsageError, UserError


def command(function: Callable[[], None]) -> NoReturn:
    """Call ``function`` and leave the process as people expect."""
    signal.signal(signal.SIGTERM, _interrupt)
    try:
        function()
    except UserError as error:
        sys.exit(_say(error, 2 if isinstance(error, UsageError) else 1))
    except KeyboardInterrupt:
        sys.exit(_say("interrupted", 130))
    sys.exit(0)


def arguments(usage: str) -> list[str]:
    """The command line's overrides; with ``--help`` the usage is printed and the process ends."""
    given = sys.argv[1:]
    if "--help" in given or "-h" in given:
        sys.stdout.write(f"{usage}\n")
        sys.exit(0)
    unknown = [argument for argument in given if argument.startswith("-") or "=" not in argument]
    if unknown:
        raise UsageError(f"can't read {unknown[0]!r}; {usage}")
    return given


def write_bytes(file: Path, data: bytes) -> None:
    """Write an output file that the user named.

    Raises:
        UserError: it can't be written.
    """
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(data)
    except OSError as error:
        raise UserError(f"can't write {file}: {error.strerror}") from error


def _say(what: object, code: int) -> int:
    sys.stderr.write(f"error: {what}\n")
    return code


def _interrupt(*_: object) -> NoReturn:
    raise KeyboardInterrupt
