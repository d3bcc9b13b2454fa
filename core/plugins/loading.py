"""Run the code of a plugin where nothing of this program would be there any more to say whose it was."""

from __future__ import annotations

import ast
import importlib.util
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import NoReturn

from core.errors import RAISED, in_line
from core.support.interrupts import was_interrupted
from core.support.progress_display import busy

PATIENCE_S = 10.0  # until it is said what is being loaded


class Contained(Exception):
    """A plugin raised what ends a program, or would have ended it; the message says what."""


def find_usage(main: str) -> str:
    """Find the ``USAGE`` of the module of a command, such as ``package.module:main``, without what it imports.

    Empty: it has none that stands there as a text.
    """
    module = main.partition(":")[0]
    try:
        spec = importlib.util.find_spec(module)
        tree = ast.parse(Path(str(spec and spec.origin)).read_bytes())
        for part in tree.body:
            if isinstance(part, ast.Assign) and ast.unparse(part.targets[0]) == "USAGE":
                return str(ast.literal_eval(part.value))
    except (ImportError, OSError, SyntaxError, ValueError):
        return ""

    return ""


@contextmanager
def contained(doing: str = "") -> Iterator[None]:
    """Contain what a plugin's code does as it is loaded: it ends no command.

    What it raises that is no `Exception` becomes one. An interrupt of the user stays what it is.

    Args:
        doing: what is said if it lasts; empty: nothing.

    Raises:
        Contained: of what would have ended the program without a word, or in another's name.
    """
    try:
        with _kept_alive(), busy(doing, PATIENCE_S) if doing else nullcontext():
            yield
    except RAISED:
        raise
    except KeyboardInterrupt as error:
        if was_interrupted():
            raise
        raise Contained(in_line(error)) from error
    except BaseException as error:
        raise Contained(in_line(error)) from error


@contextmanager
def _kept_alive() -> Iterator[None]:
    """Refuse to end the process, and only this one: what a plugin starts may end as it likes.

    Folders that it takes out of ``sys.path`` come back, or nothing else could be imported.
    """
    path = [*sys.path]
    process = os.getpid()
    end = os._exit
    abort = os.abort

    def refuse(*_: object) -> NoReturn:
        if os.getpid() != process:
            end(1)
        raise Contained("it ends the program, by os._exit or os.abort")

    os._exit = refuse  # type: ignore[assignment]
    os.abort = refuse
    try:
        yield
    finally:
        os._exit = end
        os.abort = abort
        sys.path += [folder for folder in path if folder not in sys.path]
