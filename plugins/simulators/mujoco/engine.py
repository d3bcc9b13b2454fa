"""Import MuJoCo, or report what is missing. Keep it from printing, writing a log file, and reading the clock."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

from core.errors import UserError

try:
    import mujoco
    from mujoco.rollout import rollout
except ModuleNotFoundError as error:
    raise UserError("sim=mujoco needs MuJoCo 4 or newer: pip install 'mujoco>=4,<5'") from error
except Exception as error:  # its package reads MUJOCO_GL when it is imported; what it raises depends on the value
    if (chosen := os.environ.get("MUJOCO_GL")) is None:
        raise
    raise UserError(f"MUJOCO_GL={chosen} does not work here ({error}); unset it, or set it to disable") from error


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


@contextmanager
def timers_off() -> Iterator[None]:
    """Keep MuJoCo from reading the clock.

    Its Python package reads it some twenty times a step, for `MjData.timer`, which is not used here. That is a tenth of
    a step of the arm alone.
    """
    clock = _clock()
    before, clock.value = clock.value, None
    try:
        yield
    finally:
        clock.value = before


@cache
def _clock() -> ctypes.c_void_p:
    """Find C's ``mjcb_time``, which `mujoco.set_mjcb_time` can't clear: None restores the package's own clock.

    Where it can't be reached (Windows does not search a library's dependencies), a dummy is returned, and timers stay
    on.
    """
    try:
        return ctypes.c_void_p.in_dll(ctypes.CDLL(mujoco._callbacks.__file__), "mjcb_time")
    except (AttributeError, OSError, ValueError):
        return ctypes.c_void_p()


__all__ = ["mujoco", "rollout", "timers_off", "warnings_caught"]
