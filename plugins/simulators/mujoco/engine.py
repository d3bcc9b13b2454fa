"""Import MuJoCo, or report what is missing. Keep it from printing and writing a log file."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

from core.errors import UserError

try:
    import mujoco
    from mujoco.rollout import rollout
except ModuleNotFoundError as error:
    raise UserError(
        "sim=mujoco needs MuJoCo 4 or newer: pip install 'mujoco>=4,<5'"
    ) from error
except Exception as error:  # its package reads MUJOCO_GL when it is imported; what it raises depends on the value
    if (chosen := os.environ.get("MUJOCO_GL")) is None:
        raise
    raise UserError(
        f"MUJOCO_GL={chosen} does not work here ({error}); unset it, or set it to disable"
    ) from error


@contextmanager
def warnings_caught() -> Iterator[list[str]]:
    """Collect MuJoCo's warnings in a list, instead of the terminal and MUJOCO_LOG.TXT in the working directory."""
    caught: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(caught.append)
    try:
        yield caught
    finally:
        mujoco.set_mju_user_warning(before)


__all__ = ["mujoco", "rollout", "warnings_caught"]
