"""Read what others made in a process of its own: libraries may take any time and memory, or crash, on such a file."""

from __future__ import annotations

import contextlib
import importlib
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from core.errors import UserError
from core.support.progress import busy
from core.support.scratch import scratch

LIMIT_S = 600
MEMORY = 8_000_000_000  # bytes of addresses
_REFUSED = "refused: "


def isolated(
    function: Callable[..., bytes],
    what: str,
    data: bytes,
    *words: str,
    limit_s: float | None = None,
    step: str = "",
) -> bytes:
    """Call a module's function with untrusted data, and words, in a process of its own, with limits on memory and time.

    ``step``, what is being done, is said at once; without it the reading is, if it lasts.

    Raises:
        UserError: the function raises one, takes too long, or ends otherwise; it begins with ``what``.
    """
    with (
        busy(step or f"reading {what}", at_once=bool(step)),
        tempfile.TemporaryDirectory(dir=scratch()) as folder,
    ):
        out = Path(folder) / "made"
        called = [__name__, function.__module__, function.__name__, *words, str(out)]
        try:
            done = subprocess.run(  # noqa: S603  # our own module
                [sys.executable, "-P", "-m", *called],
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
            raise UserError(
                f"{what} takes more than {limit_s or LIMIT_S:g} s to read; {mend}"
            ) from error

        last = " ".join(done.stderr.decode("utf-8", "replace").splitlines()[-1:])
        if last.startswith(_REFUSED):
            raise UserError(f"{what} {last.removeprefix(_REFUSED)}")
        if done.returncode or not out.exists():
            raise UserError(
                f"{what} can't be read: the process ended with {done.returncode} {last[:200]}; repair it"
            )

        return out.read_bytes()


def _main(module: str, function: str, *words: str) -> None:
    """Call a function with what is piped in, and write the bytes that it returns to the file that comes last."""
    *given, out = words

    # A system that has no such limit, or a lower one.
    with contextlib.suppress(ValueError, OSError):
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))

    try:
        Path(out).write_bytes(
            getattr(importlib.import_module(module), function)(
                sys.stdin.buffer.read(), *given
            )
        )
    except (UserError, MemoryError) as error:
        sys.exit(
            _REFUSED
            + (" ".join(str(error).split()) or "needs too much memory; make it smaller")
        )


if __name__ == "__main__":
    _main(*sys.argv[1:])
