"""Define the suction cup."""

from __future__ import annotations

from typing import ClassVar

from core.values.grips.grip import Pressing, Surface

VACUUM_PA = 60e3
"""Below the air's pressure: the 60 % for which makers state holding forces (J. Schmalz GmbH, glossary, "Holding
force")."""

SAFETY = 1.5
"""What makers divide the theoretical force by, at least, for smooth and tight workpieces (the same, "Theoretical
Holding Force of a Suction Cup")."""


class Suction(Pressing):
    """A cup on a pump, which the plan switches. It holds smooth bodies alone."""

    kind: ClassVar[str] = "suction"
    switched: ClassVar[bool] = True
    friction: ClassVar[float] = 0.5  # on dry wood, metal, glass and stone (the same)
    words: ClassVar[str] = (
        "a cup on a pump; holds smooth bodies with 0.04 N for each mm2, and along the patch with half of what the pull "
        "leaves, while the plan switches it on"
    )

    @property
    def strength_n(self) -> float:
        return VACUUM_PA * self.area_m2 / SAFETY

    def find_obstacle(self, surface: Surface) -> str:
        return "" if surface.smooth else "it is not smooth, and lets air in"

    @property
    def parts(self) -> str:
        return (
            f"a flat suction cup of {2000 * self.radius_m:.0f} mm, a vacuum pump or ejector of 60 kPa or more with its "
            "hose, and a valve that lets air in"
        )
