"""Read words of a command line as they are meant, where Hydra's grammar would read something else."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from dataclasses import fields

from hydra.core.override_parser.types import Quote, QuotedString

from core.errors import UsageError
from core.plugins import TASK, installed
from core.plugins.registry import settings_of
from core.support.cli import key_of, path_exists

_PLAIN = re.compile(r"[\w./+:%@-]*", re.ASCII)  # all of it is text or a number


def quote_paths(words: Sequence[str]) -> list[str]:
    """Put values in quotes that are paths which exist, or lie in a folder that does.

    A value that does not exist may also refer to a key, or be several of a sweep: then it stays as it is.

    Raises:
        UsageError: a word has no key.
    """
    is_sweep = not {"-m", "--multirun"}.isdisjoint(words)
    quoted = []
    for word in words:
        key, _, value = word.partition("=")
        if not key:
            raise UsageError(f"can't read {word!r}; write KEY=VALUE")
        folder = value[: value.rfind("/") + 1] or value
        if "${" in value or ("," in value and is_sweep):
            folder = value
        if not _PLAIN.fullmatch(value) and (path_exists(value) or path_exists(folder)):
            quoted.append(_quote(key, value))
        else:
            quoted.append(word)
    return quoted


def place_settings(words: Sequence[str], schema: type) -> list[str]:
    """Read ``KEY=VALUE`` as ``task.KEY=VALUE`` where the named task has such a setting, and the command no such key.

    Args:
        words: of the command line; one of them is ``task=NAME``, or nothing is placed.
        schema: the dataclass of the command's keys.
    """
    named = [word for word in words if word.startswith("task=")]
    name = named[-1].removeprefix("task=") if named else ""
    if (TASK.name, name) not in installed().offers:
        return list(words)

    possible = settings_of(installed().factory(TASK.name, name))
    known = {field.name for field in fields(schema)}
    return [
        f"task.{word}" if key_of(word) in possible.keys() - known else word
        for word in words
    ]


def _quote(key: str, value: str) -> str:
    """Write a text as it is, even where it looks like a reference to another key."""
    value = value.replace("${", "\\${")
    return f"{key}={QuotedString(value, Quote.double).with_quotes()}"


def explain_word(word: str) -> UsageError:
    """Say how to write a word that has another meaning, or none, as it is."""
    key, equals, value = word.partition("=")
    if not equals:
        return UsageError(f"can't read {word!r}; write KEY=VALUE")
    quoted = shlex.quote(_quote(key, value))
    mend = f"put its value in quotes: {quoted}"
    if value.startswith(("[", "{")):
        mend = f"close its brackets, put texts in them in quotes, or if it is a text {mend}"
    return UsageError(f"can't read {word}; {mend}")
