"""The ``unseen`` listener: films the unseen layouts in which the best design of a run fails."""

from __future__ import annotations

from collections.abc import Mapping

from core.hooks import hookimpl


@hookimpl
def listeners() -> Mapping[str, str]:
    return {"unseen": "plugins.listeners.unseen.listener:UnseenListener"}
