"""Check a plugin's part against what every part of its kind must do; each check is a plain function."""

from __future__ import annotations

from core.hooks import Command, hookimpl


@hookimpl
def commands() -> dict[str, Command]:
    return {
        "conformance": Command("check that a part does what its kind must do", "plugins.conformance.command:main"),
        "facts": Command(
            "measure how exact the arm is in engines, and write a sheet about it", "plugins.conformance.facts:main"
        ),
    }
