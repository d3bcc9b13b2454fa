"""Define what tools are printed with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from core.errors import UsageError, check_positive
from core.values.harmless import Harmless, Names


@dataclass(unsafe_hash=True)
class Printer:
    """A printer. The defaults are a Prusa MK4's.

    Attributes:
        plate_mm: its build volume (x, y, z).
        min_wall_mm: the thinnest wall, of two lines.
        name: of the machine.
        profile: a file of settings for the slicer, which count before those of ours; empty: none.
        speed_mm_s: of infill; walls are slower.
        acceleration_mm_s2: at which it prints.
        flow_mm3_s: the most plastic that it melts.

    Raises:
        UsageError: a number that is not positive, or not three lengths.
    """

    plate_mm: tuple[float, ...] = (250.0, 210.0, 220.0)
    min_wall_mm: float = 0.8
    name: Harmless[str] = "mk4"
    profile: Annotated[str, Names("file")] = ""
    speed_mm_s: float = 180.0
    acceleration_mm_s2: float = 3000.0
    flow_mm3_s: float = 12.0

    def __post_init__(self) -> None:
        if len(self.plate_mm) != 3:
            raise UsageError(
                f"plate_mm must be three lengths (x, y, z), got {list(self.plate_mm)}"
            )

        # A configuration has a list.
        self.plate_mm = tuple(self.plate_mm)
        check_positive("plate_mm.", **dict(zip("xyz", self.plate_mm, strict=True)))
        numbers = (
            "min_wall_mm",
            "speed_mm_s",
            "acceleration_mm_s2",
            "flow_mm3_s",
        )
        check_positive("", **{name: getattr(self, name) for name in numbers})


MK4 = Printer()
