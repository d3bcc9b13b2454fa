"""``python -m core.plugins``: list the installed parts, and the plugins that failed to load."""

from __future__ import annotations

import os

from core.errors import UsageError
from core.plugins.discovery import SWITCH
from core.plugins.kinds import KINDS
from core.plugins.registry import installed
from core.support.cli import command, print_table, say

USAGE = "usage: python -m core.plugins"


def main(words: list[str]) -> None:
    """Print a table of every part, and the plugins that failed to load."""
    if words in (["--help"], ["-h"]):
        say(USAGE)
        return
    if words:
        raise UsageError(f"can't read {' '.join(words)!r}; {USAGE}")
    plugins = installed()
    offers = [plugins.offers[kind, name] for kind in KINDS for name in plugins.names(kind)]
    offers += plugins.extensions.values()
    rows = [(offer.kind, offer.name, offer.entry_point, offer.distribution) for offer in offers]
    print_table(("kind", "name", "entry point", "distribution"), rows)
    if SWITCH in os.environ:
        say(f"{SWITCH}={os.environ[SWITCH]}: other plugins are not loaded")
    for failure in plugins.failures:
        say(f"failed {failure.entry_point} ({failure.distribution}): {failure.reason}")


if __name__ == "__main__":
    command(main)
