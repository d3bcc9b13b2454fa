"""The ``rerun`` listener: a recording of a run for the Rerun viewer (https://rerun.io)."""

from __future__ import annotations

from collections.abc import Mapping

from core.hooks import hookimpl


@hookimpl
def listeners() -> Mapping[str, str]:
    return {"rerun": "plugins.listeners.rerun.listener:RerunListener"}
