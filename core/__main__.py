"""``vlmgineer NAME ...``, or ``python -m core NAME ...``: every command under one name, those of plugins too.

The command ``vlmgineer`` does not look for modules in the working directory, as ``python -m`` does.
"""

from __future__ import annotations

from typing import NoReturn

from core.support.cli import command, print_table, say

USAGE = "usage: vlmgineer NAME [ARGUMENT ...]      (vlmgineer NAME --help: what a command takes)"


def main() -> NoReturn:
    """Call the command that the first word names; without a word list them all."""
    command(dispatch_words)


def dispatch_words(words: list[str]) -> int | None:
    """Call the command that the first word names with the others, and return its exit status; without any list them.

    Raises:
        UserError: there is no such command, or what it raises.
    """
    from core.plugins import COMMAND, installed

    plugins = installed()
    if words and words[0] not in ("--help", "-h"):
        return plugins.run_command(words[0], words[1:])
    rows = [
        (name, plugins.create(COMMAND, name).help) for name in plugins.names("command")
    ]
    say(USAGE, "")
    print_table(("command", "what it does"), rows)

    return None


if __name__ == "__main__":
    main()
