"""Write files whole, notice when they change, and read those that others made."""

from __future__ import annotations

import os
import secrets
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from core.errors import UserError

MOST_TEXT = 20_000_000
"""Bytes of a text, unless its reader sets another limit: a designs file of a thousand tools has 5 MB."""

_NOTED: ContextVar[list[Path] | None] = ContextVar("noted", default=None)

FileMark = tuple[int, ...]
"""Numbers of which at least one changes when a file is changed or replaced. The first is its size, bytes."""


def file_mark(file: Path) -> FileMark | None:
    """Return the mark of a file, of a folder, or of a link itself; None: there is none."""
    try:
        status = file.lstat()
    except OSError:
        return None
    return (
        status.st_size,
        status.st_dev,
        status.st_ino,
        status.st_mtime_ns,
        status.st_ctime_ns,
    )


def read_text(
    file: Path, what: str = "", most: int = MOST_TEXT, within: Path | None = None
) -> str:
    """Read a text in UTF-8, which others may have made; see `read_untrusted`.

    Args:
        file: the file.
        what: names it in an error; empty: its path does.
        most: bytes.
        within: a folder that it must lie in, links followed; None: anywhere.

    Raises:
        UserError: it can't be read, or is no such text.
    """
    name = what or str(file)
    try:
        return _decode(read_untrusted(file, most, name, within), name)
    except UserError as error:
        if isinstance(error.__cause__, FileNotFoundError):
            raise UserError(f"{name}: there is no such file") from error
        raise


def _decode(data: bytes, what: str) -> str:
    """Read bytes as UTF-8.

    Raises:
        UserError: they are something else.
    """
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise UserError(
            f"{what} is not UTF-8 text (byte {error.start}); save it as UTF-8"
        ) from error


def write_whole(file: Path, data: bytes, *, shared: bool = False) -> None:
    """Write a file so that no reader gets half of it, whenever the process ends. A link in its place is replaced.

    With ``shared`` several processes may write it at once. Otherwise what an ended process left is removed. After a
    power cut the file may be empty.

    Raises:
        OSError: it can't be written.
    """
    part = file.with_name(f"{file.name}.part")
    if shared:
        part = file.with_name(f".{file.name}.{secrets.token_hex(8)}.part")
    try:
        part.unlink(missing_ok=True)
        with part.open("xb") as stream:
            stream.write(data)
        part.replace(file)
    except OSError:
        part.unlink(missing_ok=True)
        raise


def unwritable(folder: Path, why: object) -> UserError:
    """Make the error of a folder that can't be written."""
    return UserError(f"{folder} can't be written: {why}; what is in it is kept")


@contextmanager
def noting_reads() -> Iterator[list[Path]]:
    """Note which files of others are read in the block, in order; those of a block within it are its own."""
    noted: list[Path] = []
    token = _NOTED.set(noted)
    try:
        yield noted
    finally:
        _NOTED.reset(token)


def note_read(file: Path) -> None:
    """Note that a file is read, where `read_untrusted` does not read it itself."""
    noted = _NOTED.get()
    file = Path(os.path.normpath(file.absolute()))
    if noted is not None and file not in noted:
        noted.append(file)


@contextmanager
def writing(folder: Path) -> Iterator[None]:
    """Turn errors of the disk into one line that says why a folder can't be written.

    Raises:
        UserError: the disk is full, the folder is read-only...
    """
    try:
        yield
    except OSError as error:
        raise unwritable(folder, error.strerror or error) from error


def read_untrusted(
    file: Path, most: int, what: str = "", within: Path | None = None
) -> bytes:
    """Read a file that others made: a regular one of at most ``most`` bytes. Of a pipe or a device nothing is read.

    For the arguments see `read_text`.

    Raises:
        UserError: it is no such file, or can't be read; says why in one line.
    """
    name = what or str(file)
    try:
        if within is not None and not file.resolve().is_relative_to(within.resolve()):
            raise UserError(
                f"{name} is a link that leads out of {within}; copy it there"
            )

        # Opening a pipe would wait otherwise.
        handle = os.open(file, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with os.fdopen(handle, "rb") as stream:
            if not stat.S_ISREG(os.fstat(handle).st_mode):
                raise UserError(f"{name} is no regular file")
            data = stream.read(most + 1)
            size = os.fstat(handle).st_size
    except (OSError, RuntimeError) as error:  # the latter: links in a circle
        reason = getattr(error, "strerror", None) or error
        raise UserError(f"{name} can't be read: {reason}") from error
    except ValueError as error:  # a zero byte in its name
        raise UserError(f"{str(file)!r} can't be a file's name: {error}") from error

    if len(data) > most:
        raise UserError(
            f"{name} has {size / 1e6:.1f} MB; at most {most / 1e6:g} MB are read"
        )

    note_read(file)
    return data
