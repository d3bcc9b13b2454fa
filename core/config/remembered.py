"""Remember on this machine which configurations this user began runs with, outside of the runs' folders.

Another person's folder can bring any configuration, but no line in this user's own state directory.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import platformdirs

from core.errors import UserError
from core.support.files import read_untrusted

MOST_BYTES = 100_000_000  # a million and a half configurations


def remember(config: Mapping[str, Any]) -> None:
    """Note that this user has typed what a configuration says, if it can be noted."""
    if is_remembered(config):
        return

    file = _file()
    with suppress(OSError):
        file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        handle = os.open(file, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
        with os.fdopen(handle, "w") as stream:
            stream.write(f"{_mark(config)}\n")


def is_remembered(config: Mapping[str, Any]) -> bool:
    """Report whether this user has begun a run with just this configuration here."""
    try:
        lines = read_untrusted(_file(), MOST_BYTES).split()
    except UserError:
        return False

    return _mark(config).encode() in lines


def _file() -> Path:
    return platformdirs.user_state_path("vlmgineer") / "configurations"


def _mark(config: Mapping[str, Any]) -> str:
    """Hash a configuration, the same before it is stored and after."""
    text = json.dumps(config, sort_keys=True, default=float)
    return hashlib.sha256(text.encode()).hexdigest()
