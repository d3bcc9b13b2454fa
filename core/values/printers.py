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

    Raises:
        UsageError: a number that is not positive, or not three lengths.
    """

    plate_mm: tuple[float, ...] = (250.0, 210.0, 220.0)
    min_wall_mm: float = 0.8
    name: Harmless[str] = "mk4"
    profile: Annotated[str, Names("file")] = ""

    def __post_init__(self) -> None:
        if len(self.plate_mm) != 3:
            raise UsageError(
                f"plate_mm must be three lengths (x, y, z), got {list(self.plate_mm)}"
            )

        # A configuration has a list.
        self.plate_mm = tuple(self.plate_mm)
        check_positive("plate_mm.", **dict(zip("xyz", self.plate_mm, strict=True)))
        check_positive("", min_wall_mm=self.min_wall_mm)


MK4 = Printer()
