"""``python -m core.plugins``: list the installed parts, and the plugins that failed to load."""

from __future__ import annotations

from core.errors import UsageError
from core.plugins.registry import installed
from core.support.cli import arguments, command, print_table, say

USAGE = "usage: python -m core.plugins"


def main(words: list[str]) -> None:
    """Print a table of all that is offered, and the plugins that failed to load."""
    given = arguments(USAGE, words)
    if given:
        raise UsageError(f"can't read {given[0]!r}; {USAGE}")
    plugins = installed()
    rows = [
        (offer.kind, offer.name, offer.entry_point, offer.distribution)
        for offer in plugins.offers.values()
    ]
    print_table(("kind", "name", "entry point", "distribution"), sorted(rows))
    for failure in plugins.failures:
        say(f"failed {failure.entry_point} ({failure.distribution}): {failure.reason}")


if __name__ == "__main__":
    command(main)
