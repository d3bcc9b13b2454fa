"""``python -m core.conformance KIND=NAME``: check that a part does what every part of its kind must.

Covered by `tests/core/conformance/test_suites.py`.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

from omegaconf import DictConfig, OmegaConf

from core.cli import arguments, command, say
from core.config.compose import load, part
from core.conformance.suites import SUITES, examine, subject
from core.errors import UsageError, UserError
from core.plugins import Part

USAGE = f"usage: python -m core.conformance {{{'|'.join(SUITES)}}}=NAME [KIND.SETTING=VALUE ...]"


def main() -> None:
    """Check the parts that the command line names.

    Raises:
        UsageError: no part is named.
        UserError: checks failed; says how many.
    """
    parts = list(_named(load("conformance", arguments(USAGE))))
    if not parts:
        raise UsageError(f"name a part to check; {USAGE}")
    failed = count = 0
    for one in parts:
        if len(parts) > 1:
            say(f"{one.kind} {one.name}")
        for verdict in examine(one.kind, subject(one)):
            count += 1
            failed += verdict.problem is not None
            remark = f" ({verdict.remark})" if verdict.remark else ""
            result = f"ok{remark}" if verdict.problem is None else f"FAILED: {verdict.problem}"
            say(f"{verdict.seconds:6.2f} s  {verdict.check}: {result}")
            sys.stdout.flush()
    if failed:
        raise UserError(f"{failed} of {count} checks failed")


def _named(config: DictConfig) -> Iterator[Part]:
    """Yield the parts that the configuration names."""
    for kind in SUITES:
        if config.get(kind) is None:
            continue
        if kind == "listener":  # settings by name, since a run has several
            for name, settings in config.listener.items():
                yield part(kind, OmegaConf.create({"name": name, **(settings or {})}))
        else:
            yield part(kind, config[kind])


if __name__ == "__main__":
    command(main)
