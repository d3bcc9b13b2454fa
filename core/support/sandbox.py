"""Read what others made in a process of its own: libraries may take any time and memory, or crash, on such a file."""

from __future__ import annotations

import contextlib
import os
import pkgutil
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from core.errors import UserError
from core.support.cli import say
from core.support.progress_display import busy
from core.support.scratch import scratch

LIMIT_S = 600
MEMORY = 8_000_000_000  # bytes of addresses
_REFUSED = 3  # the exit status where it is refused, and standard error says why


class TooSlowError(UserError):
    """Reading a file takes longer than is allowed."""


def isolated(
    function: Callable[..., bytes],
    what: str,
    data: bytes,
    *words: str,
    limit_s: float | None = None,
    step: str = "",
) -> bytes:
    """Call a module's function with untrusted data, and words, in a process of its own, with limits on memory and time.

    What is being done is said if it lasts: ``step``, or that ``what`` is being read.

    Raises:
        UserError: the function raises one, takes too long (`TooSlowError`), or ends otherwise; it begins with ``what``.
    """
    with (
        busy(step or f"reading {what}"),
        tempfile.TemporaryDirectory(dir=scratch()) as folder,
    ):
        out = Path(folder) / "made"
        named = f"{function.__module__}:{function.__name__}"
        try:
            done = subprocess.run(  # noqa: S603  # our own module
                [sys.executable, "-P", "-m", __name__, named, *words, str(out)],
                input=data,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                timeout=limit_s or LIMIT_S,
                cwd=folder,
                env={
                    **os.environ,
                    "PYTHONPATH": os.pathsep.join(
                        str(Path(path).absolute()) for path in sys.path
                    ),
                },
                check=False,
            )
        except subprocess.TimeoutExpired as error:
            mend = "make it smaller, a mesh by fewer triangles or by cutting it into convex pieces yourself"
            raise TooSlowError(
                f"{what} takes more than {limit_s or LIMIT_S:g} s to read; {mend}"
            ) from error

        last = " ".join(done.stderr.decode("utf-8", "replace").splitlines()[-1:])
        if done.returncode == _REFUSED:
            raise UserError(f"{what} {last}")
        if done.returncode or not out.exists():
            raise UserError(
                f"{what} can't be read: the process ended with {done.returncode} {last[:200]}; repair it"
            )

        return out.read_bytes()


def _main(function: str, *words: str) -> None:
    """Call a function with what is piped in, and write the bytes that it returns to the file that comes last."""
    *given, out = words

    # A system that has no such limit, or a lower one.
    with contextlib.suppress(ValueError, OSError):
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))

    try:
        read = pkgutil.resolve_name(function)
        Path(out).write_bytes(read(sys.stdin.buffer.read(), *given))
    except (UserError, MemoryError) as error:
        reason = " ".join(str(error).split())
        say(reason or "needs too much memory; make it smaller", file=sys.stderr)
        sys.exit(_REFUSED)


if __name__ == "__main__":
    _main(*sys.argv[1:])
