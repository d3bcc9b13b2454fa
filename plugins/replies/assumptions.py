"""Say what is assumed of an answer that is not written as it was asked for."""

from __future__ import annotations

import logging
from functools import lru_cache

_log = logging.getLogger(__name__)


@lru_cache(maxsize=200)
def assume(assumption: str) -> None:
    """Say once how answers are read: ``'toolUrdf' is read as 'tool_urdf'``."""
    _log.warning("of the model's answers: %s", assumption)
