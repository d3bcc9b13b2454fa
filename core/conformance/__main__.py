"""``python -m core.conformance sim=NAME``: does a simulator do what every simulator must?"""

from __future__ import annotations

import sys
import time

from core.cli import arguments, command
from core.config import load, part
from core.conformance.simulator import CHECKS
from core.errors import UserError

USAGE = "usage: python -m core.conformance sim=NAME [sim.SETTING=VALUE ...]"


def main() -> None:
    """One line per check.

    Raises:
        UserError: some did not pass; says how many.
    """
    simulator = part("sim", load("conformance", arguments(USAGE)).sim).create()
    failed = 0
    for check in CHECKS:
        begun, verdict = time.perf_counter(), "ok"
        try:
            check(simulator)
        except Exception as error:  # whatever a stranger's engine raises is its result
            failed += 1
            told = str(error) if isinstance(error, AssertionError) else f"{type(error).__name__}: {error}"
            verdict = f"FAILED: {told}"
        name = check.__name__.removeprefix("check_").replace("_", " ")
        sys.stdout.write(f"{time.perf_counter() - begun:6.2f} s  {name}: {verdict}\n")
    if failed:
        raise UserError(f"{failed} of {len(CHECKS)} checks failed")


if __name__ == "__main__":
    command(main)
