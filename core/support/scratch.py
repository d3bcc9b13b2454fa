"""Keep temporary files in one folder of the process, which is removed however the process ends."""

from __future__ import annotations

import atexit
import contextlib
import errno
import os
import shutil
import subprocess
import tempfile
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

from core.errors import UserError
from core.support.files import FileMark, file_mark

# Waits until the process has ended, which closes the pipe; workers may write while they end.
_REMOVE = 'read -r _; for i in 1 2 3 4 5; do rm -rf -- "$1"; [ -e "$1" ] || exit 0; sleep 1; done'


class _Root:
    """The folder of this process, and the process that removes it when this one is killed."""

    def __init__(self, folder: Path, *, own: bool) -> None:
        self.folder = folder
        self.mark = file_mark(folder)  # a folder of the same name may come later, of another user
        self.process = os.getpid()
        self.own = own
        self.remover: subprocess.Popen[bytes] | None = None
        if own and os.name == "posix":
            with contextlib.suppress(OSError):  # no process left: the folder is removed all the same at a normal end
                self.remover = subprocess.Popen(  # noqa: S603  # our own words
                    ["/bin/sh", "-c", _REMOVE, "sh", str(folder)],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,
                    cwd="/",
                    start_new_session=True,
                )

    def gone(self) -> bool:
        """Say if this process has no such folder: it was deleted, or this process was forked."""
        mark = file_mark(self.folder)
        same = mark and self.mark and mark.identity == self.mark.identity
        return not same or self.process != os.getpid()

    def remove(self) -> None:
        if not self.own or self.process != os.getpid():  # forked: it is the parent's
            return
        shutil.rmtree(self.folder, ignore_errors=True)
        if self.remover is not None and self.remover.stdin is not None:
            self.remover.stdin.close()
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.remover.wait(5.0)


_roots: list[_Root] = []  # the last one is in use; earlier ones were deleted by something else
_elsewhere: str | None = None  # where folders for temporary files usually are, in a worker
_lock = threading.Lock()
_written: dict[Path, dict[Path, FileMark | None]] = {}  # by folder


def scratch() -> Path:
    """Return the folder for temporary files of this process, made when it is first needed, and again when it is gone.

    Raises:
        UserError: it can't be made.
    """
    with _lock:
        if not _roots or _roots[-1].gone():
            try:
                _roots.append(_Root(Path(tempfile.mkdtemp(prefix="vlmgineer-", dir=_elsewhere)), own=True))
            except OSError as error:
                raise _no_room(error) from error
        return _roots[-1].folder


def temporary_folder() -> tempfile.TemporaryDirectory[str]:
    """Make a new folder in `scratch`.

    Raises:
        UserError: it can't be made.
    """
    try:
        return tempfile.TemporaryDirectory(dir=scratch())
    except OSError as error:
        raise _no_room(error) from error


def use_scratch(folder: Path) -> None:
    """Keep this process's temporary files, those of libraries too, in a folder that another process removes."""
    global _elsewhere
    with _lock, contextlib.suppress(OSError):  # there is none: then only the folder can be used
        _elsewhere = _elsewhere or tempfile.gettempdir()
    with _lock:
        _roots.append(_Root(folder, own=False))
    tempfile.tempdir = os.environ["TMPDIR"] = str(folder)


@atexit.register
def remove_scratch() -> None:
    """Remove the folder, before this process ends."""
    while _roots:
        _roots.pop().remove()


def write_once(file: Path, make: Callable[[], str]) -> Path:
    """Write the text that ``make`` returns, unless the file was written before and is as it was; return the file."""
    marks = _written.setdefault(file.parent, {})
    if file not in marks or marks[file] != file_mark(file):
        marks.pop(file, None)
        file.write_text(make())
        marks[file] = file_mark(file)
    return file


@contextlib.contextmanager
def intact(folder: Path) -> Iterator[None]:
    """Check after the block that the files of `write_once` in a folder were there: an engine may not report it.

    Raises:
        FileNotFoundError: one was deleted or changed meanwhile, in place of what was raised within.
    """
    try:
        yield
    finally:
        for file, mark in _written.get(folder, {}).items():
            if file_mark(file) != mark:
                _written.pop(folder)
                raise FileNotFoundError(errno.ENOENT, "a temporary file was deleted meanwhile", str(file))


def _no_room(error: OSError) -> UserError:
    return UserError(f"no temporary folder can be made: {error}; make room, or set TMPDIR to a folder that has it")
