"""Define the adhesive pad."""

from __future__ import annotations

from typing import ClassVar

from core.values.grips.grip import Sticking


class Adhesive(Sticking):
    """A pad of acrylic foam tape, which sticks to everything, and is always on.

    A pad that is pressed on for a moment wets little of what it touches. So it bears a fifth of what the tape does once
    it is bonded: 690 kPa of pull and 480 kPa of shear (3M, technical data of VHB tape 4910: normal tensile strength,
    dynamic overlap shear).
    """

    kind: ClassVar[str] = "adhesive"
    pull_pa: ClassVar[float] = 690e3 / 5
    shear_pa: ClassVar[float] = 480e3 / 5
    words: ClassVar[str] = (
        "a pad of adhesive foam; holds every body with 0.138 N for each mm2, and 0.096 N along it, always; a moment "
        "peels it off"
    )

    @property
    def parts(self) -> str:
        return f"a pad of acrylic foam tape, {2000 * self.radius_m:.0f} mm across; a fresh one for each job"
