"""How long the steps of PyBullet and SAPIEN are."""

from __future__ import annotations

from typing import Literal

from core.errors import UsageError, check_positive

Speed = Literal["accurate", "fast"]
LONGEST_S = 0.02


def step_length(time_step: float, speed: Speed) -> float:
    """Return the length of a step, seconds: ``time_step``, or twice as much with ``fast``.

    Raises:
        UsageError: it is not above 0, or so long that contacts would break.
    """
    check_positive("sim.", time_step=time_step)
    times = 2 if speed == "fast" else 1
    if times * time_step > LONGEST_S:
        raise UsageError(f"sim.time_step must be at most {LONGEST_S / times} s, got {time_step}: contacts would break")
    return times * time_step
