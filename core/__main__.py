"""``vlmgineer NAME ...``, or ``python -m core NAME ...``: every command under one name, those of plugins too.

The command ``vlmgineer`` does not look for modules in the working directory, as ``python -m`` does.
"""

from __future__ import annotations

from typing import NoReturn

from core.errors import UserError, choices
from core.support.cli import command, print_table, say

USAGE = "usage: vlmgineer NAME [ARGUMENT ...]      (vlmgineer NAME --help: what a command takes)"


def main() -> NoReturn:
    """Call the command that the first word names; without a word list them all."""
    command(dispatch_words)


def dispatch_words(words: list[str]) -> int | None:
    """Call the command that the first word names with the others, and return its exit status; without any list them.

    Raises:
        UserError: there is no such command, or what it raises; or a part that it made called `sys.exit`.
    """
    from core.plugins import culprit, describe_failure, installed

    plugins = installed()
    if words and words[0] not in ("--help", "-h"):
        name, *arguments = words
        if name not in plugins.names("command"):
            raise choices("command", name, plugins.names("command"))
        try:
            return plugins.run_command(name, arguments)
        except SystemExit as end:  # a command may raise it, as argparse does; a part that it makes may not
            offer = culprit(end, plugins)
            if offer is None or offer.kind == "command":
                raise
            raise UserError(describe_failure(end, plugins)) from end
    rows = [(name, plugins.create("command", name).help) for name in plugins.names("command")]
    say(USAGE, "")
    print_table(("command", "what it does"), rows)
    return None


if __name__ == "__main__":
    main()
