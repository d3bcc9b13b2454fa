"""How the commands end: 0 done, 1 error, 2 wrong usage, 130 interrupted; a mistake is one line on standard error."""

from __future__ import annotations

import contextlib
import math
import os
import select
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import ClassVar, NoReturn

from core.errors import UsageError, UserError


def command(function: Callable[[], None]) -> NoReturn:
    """Call ``function`` and leave the process as people expect."""
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) is not signal.SIG_IGN:  # as for what a shell runs in the background
            signal.signal(number, _Interrupt())
    try:
        function()
        sys.stdout.flush()
    except BrokenPipeError:
        if not _unread():
            raise
        _leave("", 1)  # such as head's, once it has seen enough
    except UserError as error:
        _leave(f"error: {error}", 2 if isinstance(error, UsageError) else 1)
    except KeyboardInterrupt as interrupt:
        _leave(f"interrupted{''.join(f'; {why}' for why in interrupt.args)}", 130)
    sys.exit(0)


def arguments(usage: str) -> list[str]:
    """The command line's overrides; with ``--help`` the usage is printed and the process ends."""
    given = _help_or_words(usage)
    unknown = [argument for argument in given if argument.startswith("-") or "=" not in argument]
    if unknown:
        raise UsageError(f"can't read {unknown[0]!r}; {usage}")
    return given


def folders_and_overrides(usage: str) -> tuple[list[Path], list[str]]:
    """The folders that the command line names, and its overrides. What exists is a folder, be there a ``=`` in it, as
    in the name of a multirun's job.
    """
    folders: list[Path] = []
    overrides: list[str] = []
    for word in _help_or_words(usage):
        if word.startswith("-"):
            raise UsageError(f"can't read {word!r}; {usage}")
        if Path(word).exists() or "=" not in word:
            folders.append(Path(word))
        else:
            overrides.append(word)
    return folders, overrides


def _help_or_words(usage: str) -> list[str]:
    given = sys.argv[1:]
    if "--help" in given or "-h" in given:
        sys.stdout.write(f"{usage}\n")
        sys.stdout.flush()
        sys.exit(0)
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


class _Interrupt:
    """A signal is an interrupt, which leaves time to put things in order; a second one ends the process on the spot.

    Some senders signal the process, then its group: what comes within a second is the same signal still.
    """

    first: ClassVar[float] = math.inf

    def __call__(self, *_: object) -> None:
        now = time.monotonic()
        if now > _Interrupt.first + 1.0:
            os._exit(130)
        if now < _Interrupt.first:
            _Interrupt.first = now
            raise KeyboardInterrupt


def _unread() -> bool:
    """Whoever read standard output is gone."""
    if not hasattr(select, "poll"):  # on Windows
        return False
    output = select.poll()
    output.register(sys.stdout, 0)  # errors are told unasked
    return bool(output.poll(0))


def _leave(line: str, code: int) -> NoReturn:
    """Now, whatever other threads are doing: in the middle of a library's code they would fall over an interpreter that
    is being taken down.
    """
    with contextlib.suppress(OSError):  # nobody may be listening any more
        sys.stderr.write(line and f"{line}\n")
        sys.stderr.flush()
        sys.stdout.flush()
    os._exit(code)
