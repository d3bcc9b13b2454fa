"""Read the folders of runs that a command line names."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from core.errors import UsageError
from core.support.cli import answer_help, path_exists, read_path


def folders_and_overrides(
    usage: str, given: Sequence[str]
) -> tuple[list[Path], list[str]]:
    """Return the folders that the command line names, as they are or as ``runs=FOLDER``, and its overrides.

    With ``--help`` it prints the usage and ends the process. A path that exists is a folder, even with a ``=``
    in its name, as a multirun's jobs may have.
    """
    folders: list[Path] = []
    overrides: list[str] = []
    for word in answer_help(usage, given):
        if word.startswith("-"):
            raise UsageError(f"can't read {word!r}; {usage.splitlines()[0]}")
        key, _, value = word.partition("=")

        if "=" not in word or path_exists(word):
            folders.append(read_path(word))
        elif key in ("run", "runs"):
            folders.append(read_path(value))
        else:
            overrides.append(word)

    return folders, overrides
