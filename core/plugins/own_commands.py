"""The commands that core itself offers."""

from __future__ import annotations

from core.hooks import Command, hookimpl

COMMANDS = {
    "run": Command(
        "search for the best tool and motion for a task, or continue a run",
        "core.run:main",
    ),
    "plugins": Command("list the installed parts", "core.plugins.__main__:main"),
}


@hookimpl
def commands() -> dict[str, Command]:
    return COMMANDS
