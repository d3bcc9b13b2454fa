"""The clearances of what joins and mounts a tool's parts."""

from __future__ import annotations

from dataclasses import dataclass

from core.errors import UsageError


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
