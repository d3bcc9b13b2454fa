"""What a tool is made with: a printer, and the clearances of what joins and mounts its parts."""

from __future__ import annotations

from dataclasses import dataclass

from core.errors import UsageError, check_positive


@dataclass(unsafe_hash=True)
class Printer:
    """A printer, hashable. The defaults are a Prusa MK4's.

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
    name: str = "mk4"
    profile: str = ""

    def __post_init__(self) -> None:
        if len(self.plate_mm) != 3:
            raise UsageError(
                f"plate_mm must be three lengths (x, y, z), got {list(self.plate_mm)}"
            )

        # A configuration has a list.
        self.plate_mm = tuple(self.plate_mm)
        check_positive("plate_mm.", **dict(zip("xyz", self.plate_mm, strict=True)))
        check_positive("", min_wall_mm=self.min_wall_mm)


@dataclass
class Fit:
    """Gaps and walls of what bolts a tool to an arm, and joins its parts; millimetres.

    Attributes:
        plate_mm: the thickness of the plate at the flange.
        clearance_mm: by how much a screw's bore is wider than its thread: 0.6 is ISO 273's medium.
        sleeve_mm: the gap between a sleeve and the finger, on each side.
        insert_mm: the bore of the clamping screw: 4.0 fits a brass insert M3.
        tolerance_mm: by how much a printed dimension may be off.
        joint_mm: the gap between tongue and socket of a joint between pieces, on each side.

    Raises:
        UsageError: a number is negative or not finite, or a wall is 0.
    """

    plate_mm: float = 7.0
    clearance_mm: float = 0.6
    sleeve_mm: float = 0.2
    insert_mm: float = 4.0
    tolerance_mm: float = 0.2
    joint_mm: float = 0.1

    def __post_init__(self) -> None:
        limits = {
            "plate_mm": (0.8, 500),
            "clearance_mm": (0, 5),
            "sleeve_mm": (0, 5),
            "insert_mm": (0.8, 500),
            "tolerance_mm": (0, 5),
            "joint_mm": (0, 1),
        }
        for name, (low, high) in limits.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise UsageError(f"fit.{name} must be {low} to {high} mm, got {value}")
