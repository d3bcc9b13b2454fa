"""Read a command's words, print its tables, and end it: 0 done, 1 error, 2 wrong usage, 130 interrupted."""

from __future__ import annotations

import contextlib
import errno
import io
import re
import sys
from collections.abc import Callable, Collection, Iterable, Sequence
from functools import partial
from importlib.metadata import version
from os import _exit
from pathlib import Path
from typing import NoReturn, TextIO

from core.errors import UsageError, UserError
from core.support.interrupts import Interrupts, describe_interrupt
from core.support.progress_display import show_progress
from core.support.scratch import remove_scratch
from core.support.secrets import Scrubbed
from core.support.text import clean, visible

_DISTRIBUTION = "vlmgineer"


def command(function: Callable[[list[str]], int | None]) -> NoReturn:
    """Call ``function`` with the arguments, and end the process with its exit status.

    A mistake of the user is one line on standard error. Keys are left out of all that is printed, a signal becomes an
    interrupt, and what takes long is said.
    """
    if isinstance(sys.stdout, io.TextIOWrapper):
        # For an encoding that has not every letter.
        sys.stdout.reconfigure(errors="backslashreplace")

    sys.stdout = Scrubbed(sys.stdout)
    sys.stderr = Scrubbed(sys.stderr)
    show_progress(lambda line: say(line, file=sys.stderr))
    Interrupts(partial(_leave, code=130)).listen()

    if sys.argv[1:] == ["--version"]:
        function = _print_version

    try:
        status = function(join_words(sys.argv[1:]))
        sys.stdout.flush()
    except BrokenPipeError:  # who reads the output is gone, such as head
        _leave("", 1)
    except OSError as error:
        if error.filename is not None or error.errno != errno.ENOSPC:
            raise
        _leave(f"error: the output can't be written: {error.strerror}", 1)
    except UsageError as error:
        _leave(f"error: {error}", 2)
    except UserError as error:
        _leave(f"error: {error}", 1)
    except KeyboardInterrupt as error:
        _leave(describe_interrupt(*error.args), 130)

    sys.exit(status or 0)


def _print_version(_: list[str]) -> None:
    """Print the version of the program, and of the Python that it runs in."""
    python = ".".join(map(str, sys.version_info[:3]))
    say(f"{_DISTRIBUTION} {version(_DISTRIBUTION)} (Python {python})")


def arguments(usage: str, given: Sequence[str]) -> list[str]:
    """Return the command line's overrides; with ``--help`` print the usage and end the process.

    Raises:
        UsageError: a word is no ``KEY=VALUE``.
    """
    given = answer_help(usage, given)
    for word in given:
        if word.startswith("-") or "=" not in word:
            raise UsageError(f"can't read {word!r}; {usage}")
    return given


def join_words(given: Sequence[str]) -> list[str]:
    """Join the values that a shell took apart at their spaces: lists and objects.

    So ``sims=[mujoco, pybullet]`` needs no quotes.
    """
    joined: list[str] = []
    for word in given:
        if joined and _is_open(joined[-1]) and "=" not in word:
            joined[-1] += f" {word}"
        else:
            joined.append(word)

    return joined


def _is_open(word: str) -> bool:
    """Report whether a list or object is not closed yet."""
    value = word.partition("=")[2]
    opened = value.count("[") + value.count("{")
    closed = value.count("]") + value.count("}")
    return value.startswith(("[", "{")) and opened > closed


def key_of(word: str) -> str:
    """Return the key of a word ``KEY=VALUE``, without Hydra's signs before it."""
    return word.lstrip("+~").partition("=")[0]


def read_path(value: str) -> Path:
    """Read a path as it is, or in quotes, as Hydra reads it."""
    quoted = re.fullmatch(r"""(["'])(.+)\1""", value)
    if quoted and not path_exists(value):
        value = quoted[2].replace(f"\\{quoted[1]}", quoted[1])
    return expand(value)


def expand(value: str | Path) -> Path:
    """Put the home folder in place of a ``~``, unless what follows is no user: then it is part of a name."""
    try:
        return Path(value).expanduser()
    except RuntimeError:
        return Path(value)


def path_exists(value: str) -> bool:
    """Check if a value is the path of something that exists."""
    try:
        return expand(value).exists()
    except (OSError, ValueError):  # such as one that is too long
        return False


def answer_help(usage: str, given: Sequence[str]) -> list[str]:
    """Print the usage and end the process if ``--help`` is among the words; else return them."""
    if "--help" in given or "-h" in given:
        say(*usage.splitlines())
        sys.stdout.flush()
        sys.exit(0)

    return list(given)


def say(*lines: str, file: TextIO | None = None) -> None:
    """Print lines: the one way for text to a terminal.

    What is not printable is escaped, since others may have written it: a model, a provider, an owner of a folder.

    Raises:
        BrokenPipeError: who reads the output is gone.
        UserError: the output can't be written.
    """
    file = sys.stdout if file is None else file
    try:
        file.write("".join(f"{visible(line)}\n" for line in lines))
    except BrokenPipeError:
        raise
    except OSError as error:
        why = f"the output can't be written: {error.strerror}"
        raise UserError(why) from error


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


def print_table(
    columns: Sequence[str],
    rows: Iterable[Sequence[str]],
    numbers: Collection[str] = (),
    file: TextIO | None = None,
) -> None:
    """Print a table: folded to the width of a terminal, elsewhere one line per row. No cell is cut.

    Args:
        columns: their names.
        rows: cells; control characters are left out.
        numbers: the columns that are aligned to the right, and never folded.
        file: standard output by default.
    """
    import rich.console
    import rich.table
    import rich.text

    file = sys.stdout if file is None else file
    table = rich.table.Table(box=None, header_style="bold", pad_edge=False)
    for name in columns:
        table.add_column(name, overflow="fold")
        if name in numbers:
            table.columns[-1].justify = "right"
            table.columns[-1].no_wrap = True

    for row in rows:
        table.add_row(*(rich.text.Text(clean(cell, 2000)) for cell in row))

    console = rich.console.Console(file=file, width=None if file.isatty() else 100_000)
    with console.capture() as printed:
        console.print(table, crop=False)
    file.write("".join(f"{line.rstrip()}\n" for line in printed.get().splitlines()))


def _leave(line: str, code: int) -> NoReturn:
    """Print ``line`` and end the process at once, without waiting for other threads.

    A thread inside a library could crash while the interpreter shuts down.
    """
    with contextlib.suppress(OSError):  # the other end may be closed
        say(*line.splitlines(), file=sys.stderr)
        sys.stderr.flush()
        sys.stdout.flush()

    remove_scratch()
    _exit(code)
