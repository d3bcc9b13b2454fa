"""``python -m core.plugins``: list the installed parts; with ``--check NAME`` run their conformance suites."""

from __future__ import annotations

import os
import subprocess
import sys

from core.errors import UsageError, UserError, choices
from core.plugins.discovery import SWITCH
from core.plugins.kinds import KINDS
from core.plugins.registry import installed
from core.support.cli import command, print_table, say

USAGE = "usage: python -m core.plugins [--check NAME]"


def main(words: list[str]) -> None:
    """Print a table of every part, and the plugins that failed to load.

    With ``--check NAME`` run the conformance suites of the parts of that name, plugin or distribution.

    Raises:
        UserError: there is no such part, or it fails a check.
    """
    match words:
        case []:
            _list()
        case ["--check", name]:
            _check(name)
        case ["--help" | "-h"]:
            say(*USAGE.splitlines())
        case _:
            raise UsageError(f"can't read {' '.join(words)!r}; {USAGE}")


def _check(name: str) -> None:
    found = installed()
    chosen = [offer for offer in found.offers.values() if name in (offer.name, offer.entry_point, offer.distribution)]
    failures = [failure for failure in found.failures if name in (failure.entry_point, failure.distribution)]
    for failure in failures:
        say(f"{failure.entry_point} of {failure.distribution}: {failure.reason}")
    if not chosen and not failures:
        names = {key for o in found.offers.values() for key in (o.name, o.entry_point, o.distribution)}
        raise choices("part, plugin or distribution", name, names)
    if failures:
        raise UserError(f"{len(failures)} of the plugin's hooks failed")
    failed = 0
    child = [sys.executable, "-P", "-m", "core", "conformance"]
    paths = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}  # imports as this process does
    for word in (f"{offer.kind}={offer.name}" for offer in chosen):
        say(word)
        sys.stdout.flush()
        failed += subprocess.run([*child, word], env=paths).returncode != 0  # noqa: S603
    if failed:
        raise UserError(f"{failed} of {len(chosen)} parts fail a check")


def _list() -> None:
    plugins = installed()
    offers = [plugins.offers[kind, name] for kind in KINDS for name in plugins.names(kind)]
    rows = [(offer.kind, offer.name, offer.entry_point, offer.distribution) for offer in offers]
    print_table(("kind", "name", "entry point", "distribution"), rows)
    if SWITCH in os.environ:
        say(f"{SWITCH}={os.environ[SWITCH]}: other plugins are not loaded")
    for failure in plugins.failures:
        say(f"failed {failure.entry_point} ({failure.distribution}): {failure.reason}")


if __name__ == "__main__":
    command(main)
