"""``vlmgineer NAME ...``, or ``python -m core NAME ...``: every command under one name, those of plugins too.

The command ``vlmgineer`` does not look for modules in the working directory, as ``python -m`` does.
"""

from __future__ import annotations

from typing import NoReturn

from core.errors import choices
from core.support.cli import command, print_table, say

USAGE = "usage: vlmgineer NAME [ARGUMENT ...]      (vlmgineer NAME --help: what a command takes)"


def main() -> NoReturn:
    """Call the command that the first word names; without a word list them all."""
    command(_dispatch)


def _dispatch(words: list[str]) -> int | None:
    from core.plugins import installed

    plugins = installed()
    if words and words[0] not in ("--help", "-h"):
        name, *arguments = words
        if name not in plugins.names("command"):
            raise choices("command", name, plugins.names("command"))
        return plugins.run_command(name, arguments)
    rows = [(name, plugins.create("command", name).help) for name in plugins.names("command")]
    say(USAGE, "")
    print_table(("command", "what it does"), rows)
    return None


if __name__ == "__main__":
    main()
