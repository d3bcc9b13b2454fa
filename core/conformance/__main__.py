"""``python -m core.conformance KIND=NAME``: does a part do what every part of its kind must?"""

from __future__ import annotations

import sys

from core.cli import arguments, command
from core.config.compose import load, part
from core.conformance.suites import SUITES, verdicts
from core.errors import UsageError, UserError
from core.plugins import Part

USAGE = f"usage: python -m core.conformance {{{'|'.join(SUITES)}}}=NAME [KIND.SETTING=VALUE ...]"


def main() -> None:
    """One line per check.

    Raises:
        UsageError: no part is named.
        UserError: some did not pass; says how many.
    """
    config = load("conformance", arguments(USAGE))
    asked = [part(kind, config[kind]) for kind in SUITES if config.get(kind) is not None]
    if not asked:
        raise UsageError(f"what is to be checked? {USAGE}")
    report(asked)


def report(asked: list[Part]) -> None:
    """Print a line for each check of each part.

    Raises:
        UserError: some did not pass; says how many.
    """
    failed = count = 0
    for one in asked:
        if len(asked) > 1:
            sys.stdout.write(f"{one.kind} {one.name}\n")
        for verdict in verdicts(one):
            count += 1
            failed += verdict.problem is not None
            told = "ok" if verdict.problem is None else f"FAILED: {verdict.problem}"
            sys.stdout.write(f"{verdict.seconds:6.2f} s  {verdict.check}: {told}\n")
    if failed:
        raise UserError(f"{failed} of {count} checks failed")


if __name__ == "__main__":
    command(main)
