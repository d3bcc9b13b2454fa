"""Write plugin packages to start from: ``vlmgineer new``."""

from __future__ import annotations

from core.hooks import Command, hookimpl


@hookimpl
def commands() -> dict[str, Command]:
    return {"new": Command("write a plugin package to start from", "plugins.new.command:main")}
