"""``vlmgineer conformance KIND=NAME``: check that a part does what every part of its kind must."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import field, make_dataclass
from typing import Any

from omegaconf import DictConfig, OmegaConf

from core.config.compose import load, part
from core.errors import UsageError, UserError
from core.plugins import KINDS, PluginPart
from core.support.cli import arguments, say
from core.values.materials import Material
from core.values.printers import Printer
from plugins.conformance.suites import SUITES, examine, subject

USAGE = (
    f"usage: vlmgineer conformance {{{'|'.join(SUITES)}}}=NAME [KIND.SETTING=VALUE ...]"
)


ConformanceConfig = make_dataclass(
    "ConformanceConfig",
    [
        ("seed", int, 0),
        ("material", Material, field(default_factory=Material)),
        ("printer", Printer, field(default_factory=Printer)),
        *((kind, dict[str, Any] | None, None) for kind in KINDS),
    ],
)
"""Settings of ``vlmgineer conformance``: the part of each kind to check, if any. The configs of parts may name
``seed``, ``material`` and ``printer``.
"""


def main(words: list[str]) -> None:
    """Check the parts that the command line names.

    Raises:
        UsageError: no part is named.
        UserError: checks failed; says how many.
    """
    parts = list(
        _named(load("conformance", arguments(USAGE, words), ConformanceConfig))
    )
    if not parts:
        raise UsageError(f"name a part to check; {USAGE}")

    failed = count = 0
    for checked in parts:
        if len(parts) > 1:
            say(f"{checked.kind} {checked.name}")

        for verdict in examine(checked.kind, subject(checked)):
            count += 1
            failed += verdict.problem is not None
            remark = f" ({verdict.remark})" if verdict.remark else ""
            result = (
                f"ok{remark}"
                if verdict.problem is None
                else f"FAILED: {verdict.problem}"
            )
            say(f"{verdict.seconds:6.2f} s  {verdict.check}: {result}")
            sys.stdout.flush()

    if failed:
        raise UserError(f"{failed} of {count} checks failed")


def _named(config: DictConfig) -> Iterator[PluginPart]:
    """Yield the parts that the configuration names."""
    for kind in SUITES:
        if config.get(kind) is None:
            continue
        if kind == "listener":  # settings by name, since a run has several
            for name, settings in config.listener.items():
                yield part(
                    KINDS[kind], OmegaConf.create({"name": name, **(settings or {})})
                )
        else:
            yield part(KINDS[kind], config[kind])
