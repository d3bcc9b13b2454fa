"""Define hook-and-loop."""

from __future__ import annotations

from typing import ClassVar

from core.values.grips.grip import Sticking, Surface


class HookAndLoop(Sticking):
    """A patch of hooks, which holds bodies that are not smooth: what has loops or is covered by them. It is always on.

    The figures are those that makers of woven nylon tape state as typical by ASTM D5169 (shear, 8 N/cm^2 and more) and
    by pulls on a whole patch (4 N/cm^2).
    """

    kind: ClassVar[str] = "hook_and_loop"
    pull_pa: ClassVar[float] = 40e3
    shear_pa: ClassVar[float] = 80e3
    words: ClassVar[str] = (
        "a patch of hooks; holds looped bodies with 0.04 N for each mm2, and 0.08 N along it, always; a moment peels "
        "it off"
    )

    def find_obstacle(self, surface: Surface) -> str:
        return "" if surface.loops else "it has no loops"

    @property
    def parts(self) -> str:
        return f"hook tape, a round piece of {2000 * self.radius_m:.0f} mm, glued on"
