"""Keep temporary files in one folder of the process, which is removed when it ends.

What a process leaves that was killed is in the system's temporary folder, and the system removes it.
"""

from __future__ import annotations

import atexit
import os
import shutil
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path

from core.errors import UserError
from core.support.files import write_whole

_folder: Path | None = None
_maker: int | None = (
    None  # the process that made the folder, and removes it: a forked one may not
)
_lock = threading.Lock()


def scratch() -> Path:
    """Return the folder for temporary files of this process, made when it is first needed, and again when it is gone.

    Raises:
        UserError: it can't be made.
    """
    global _folder, _maker

    with _lock:
        try:
            if _folder is None:
                _folder = Path(tempfile.mkdtemp(prefix="vlmgineer-"))
                _maker = os.getpid()
            _folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        except OSError as error:
            mend = "make room, or set TMPDIR to a folder that has it"
            raise UserError(
                f"no temporary folder can be made: {error}; {mend}"
            ) from error
        return _folder


def use_scratch(folder: Path) -> None:
    """Keep this process's temporary files, those of libraries too, in a folder that another process removes."""
    global _folder
    with _lock:
        _folder = folder
    tempfile.tempdir = os.environ["TMPDIR"] = str(folder)


@atexit.register
def remove_scratch() -> None:
    """Remove the folder, before this process ends."""
    if _folder is not None and _maker == os.getpid():
        shutil.rmtree(_folder, ignore_errors=True)


def write_once(file: Path, make: Callable[[], str]) -> Path:
    """Write the text that ``make`` returns, unless the file is there; return the file."""
    if not file.exists():
        write_whole(file, make().encode(), shared=True)
    return file
