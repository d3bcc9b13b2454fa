"""How long the steps of PyBullet and SAPIEN may be."""

from __future__ import annotations

from core.errors import UsageError, check_positive

LONGEST_S = 0.02


def check_time_step(time_step: float) -> None:
    """Refuse a step, seconds, that no contact bears.

    Raises:
        UsageError: it is not above 0, or so long that contacts would break.
    """
    check_positive("sim.", time_step=time_step)
    if time_step > LONGEST_S:
        raise UsageError(
            f"sim.time_step must be at most {LONGEST_S} s, got {time_step}: contacts would break"
        )
