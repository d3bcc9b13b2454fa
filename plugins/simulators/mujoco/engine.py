"""Imports MuJoCo, or says what is missing; and catches what it would print and write to a log file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from core.errors import UserError

try:
    import mujoco
    from mujoco.rollout import rollout
except ModuleNotFoundError as error:
    raise UserError("sim=mujoco needs MuJoCo 4 or newer: pip install 'mujoco>=4,<5'") from error


@contextmanager
def warnings_caught() -> Iterator[list[str]]:
    """Within it MuJoCo's warnings go to the list, not to the terminal and a file MUJOCO_LOG.TXT where one stands."""
    caught: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(caught.append)
    try:
        yield caught
    finally:
        mujoco.set_mju_user_warning(before)


__all__ = ["mujoco", "rollout", "warnings_caught"]
