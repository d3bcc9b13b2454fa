"""Write places and directions in words."""

from __future__ import annotations

from collections.abc import Iterable

from core.values.spans import Span

Coordinate = float | Span | None
Coordinates = tuple[Coordinate, Coordinate, Coordinate]
"""A place, m; a coordinate that is None is free."""


def vector(numbers: Iterable[Coordinate], digits: int = 6) -> str:
    """Write a place or a direction; a coordinate that is None is free."""
    said = []
    for axis, number in zip("xyz", numbers, strict=True):
        if number is None:
            said.append(f"any {axis}")
        elif isinstance(number, Span):
            said.append(str(number))
        else:
            said.append(f"{round(number, digits):g}")

    return f"({', '.join(said)})"


def frame(at: str | None) -> str:
    """Say in whose frame a place or a direction is."""
    return "" if at is None else f" in the frame of {at}"
