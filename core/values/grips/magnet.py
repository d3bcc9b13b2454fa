"""Define the permanent magnet."""

from __future__ import annotations

import math
from typing import ClassVar

from core.values.grips.grip import Pressing, Surface

REMANENCE_T = 1.3
"""Of sintered neodymium of the grade N42 (makers state 1.28 to 1.32 T)."""

VACUUM_PERMEABILITY = 4e-7 * math.pi  # N/A^2
SLENDERNESS = 0.5  # thickness of the disc, as a share of its diameter


class Magnet(Pressing):
    """A disc magnet of neodymium, half as thick as wide. It holds bodies that are magnetic, and is always on.

    It pulls with B^2 A / (2 mu_0) at thick steel. B is the field on its axis at the steel, in which the magnet mirrors
    itself: B_r t / sqrt(t^2 + R^2) for a disc of thickness t and radius R (E. P. Furlani, "Permanent Magnet and
    Electromechanical Devices", 2001, sections 3.12 and 4.2). Makers print about as much, as measured
    at polished steel of 10 mm: 110 N for 20 x 10 mm.
    """

    kind: ClassVar[str] = "magnet"
    # Makers state that a magnet slips on steel at 15 to 25 % of its pull.
    friction: ClassVar[float] = 0.2
    words: ClassVar[str] = (
        "a permanent magnet; holds magnetic bodies with 0.336 N for each mm2, and along the patch with a fifth of what "
        "the pull leaves, always: only a larger force takes them off"
    )

    @property
    def thickness_m(self) -> float:
        return SLENDERNESS * 2 * self.radius_m

    @property
    def strength_n(self) -> float:
        field = REMANENCE_T * self.thickness_m
        field /= math.hypot(self.thickness_m, self.radius_m)
        return field**2 * self.area_m2 / (2 * VACUUM_PERMEABILITY)

    def find_obstacle(self, surface: Surface) -> str:
        return "" if surface.magnetic else "it is not magnetic"

    @property
    def parts(self) -> str:
        return (
            f"a disc magnet of neodymium N42, {2000 * self.radius_m:.1f} x {1000 * self.thickness_m:.1f} mm, let in "
            "flush and glued"
        )
