"""Checks that every command must pass. Each takes the part, which is called as ``vlmgineer NAME`` calls it."""

from __future__ import annotations

import contextlib
import io
import sys

from core.errors import UsageError, UserError
from core.hooks import Command
from core.plugins import PluginPart, installed
from plugins.conformance.shared import expect_a


def _call(part: PluginPart[Command], word: str) -> tuple[object, str]:
    """Call the command with one word; return its exit status and what it prints."""
    status: object
    output = io.StringIO()
    given = sys.argv
    sys.argv = [part.name, word]  # Hydra reads and changes them

    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(io.StringIO()):
        try:
            status = installed().run_command(part.name, [word])
        except SystemExit as end:
            status = end.code
        finally:
            sys.argv = given

    return status or 0, output.getvalue()


def check_its_help_is_one_line(part: PluginPart[Command]) -> None:
    text = part.create().help
    expect_a(str, text, "help is")
    assert text.strip(), "help is empty; a line that says what it does is needed"
    assert len(text.splitlines()) == 1, "help has more than one line"


def check_help_prints_its_usage(part: PluginPart[Command]) -> None:
    status, printed = _call(part, "--help")
    assert status == 0, f"with --help its exit status is {status} instead of 0"
    assert printed.startswith("usage: "), (
        f"with --help it prints {printed[:60]!r} instead of a line 'usage: ...'"
    )


def check_an_unknown_word_is_one_line(part: PluginPart[Command]) -> None:
    """It ends with status 2, as a `UsageError` does."""
    found: object = None
    try:
        found = f"exit status {_call(part, 'no_such_key=1')[0]}"
    except UserError as error:
        found = error

    assert isinstance(found, UsageError), (
        f"an unknown word raises no UsageError: {found}"
    )
    assert len(str(found).splitlines()) == 1, (
        f"an unknown word is more than one line: {found}"
    )
