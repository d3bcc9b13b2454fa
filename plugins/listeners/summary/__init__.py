"""The ``summary`` listener: says more of the winner of a run, and what to type next; then what failed, and why."""

from __future__ import annotations

from collections.abc import Mapping

from core.hooks import hookimpl


@hookimpl
def listeners() -> Mapping[str, str]:
    return {"summary": "plugins.listeners.summary.listener:SummaryListener"}
