"""The ``rerun`` listener: a recording of a run for the Rerun viewer (https://rerun.io)."""

from __future__ import annotations

from collections.abc import Mapping

from core.hooks import Command, hookimpl


@hookimpl
def listeners() -> Mapping[str, str]:
    return {"rerun": "plugins.listeners.rerun.listener:RerunListener"}


@hookimpl
def commands() -> Mapping[str, Command]:
    return {
        "view": Command(
            "show the recording of a run", "plugins.listeners.rerun.view:main"
        )
    }
