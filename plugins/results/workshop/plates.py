"""Arrange parts on a printer's plates, and write them as 3MF files. Lengths are millimetres."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import trimesh

from core.values.printers import Printer
from plugins.results.workshop.printing import PrintedPart

APART_MM = 6.0  # between two parts
BESIDE = 1.2  # of a plate's width: where the next one lies in a file of several, as slicers have it


@dataclass(eq=False)
class Plate:
    """Parts that are printed at once.

    Attributes:
        parts: with the middle of each (x, y), from the plate's front left corner.
    """

    parts: list[tuple[PrintedPart, tuple[float, float]]] = field(default_factory=list)


def arrange(parts: Sequence[PrintedPart], printer: Printer) -> list[Plate]:
    """Lay parts in rows, the deepest first, on as few plates as that takes; what is too large lies alone.

    Args:
        parts: as they lie.
        printer: whose plate it is.
    """
    width, depth, _ = printer.plate_mm
    plates: list[Plate] = []
    left = front = row = 0.0
    for part in sorted(parts, key=lambda part: (-part.lying.size[1], part.name)):
        wide, deep, _ = part.lying.size
        if plates and left + wide > width:
            left, front, row = 0.0, front + row + APART_MM, 0.0
        if not plates or front + deep > depth or left + wide > width:
            plates.append(Plate())
            left = front = row = 0.0

        plates[-1].parts.append((part, (left + wide / 2, front + deep / 2)))
        left += wide + APART_MM
        row = max(row, deep)

    return [_center(plate, width, depth) for plate in plates]


def _center(plate: Plate, width: float, depth: float) -> Plate:
    """Move all parts of a plate, so that they lie around its middle."""
    middles = np.array([middle for _, middle in plate.parts])
    halves = np.array([part.lying.size[:2] for part, _ in plate.parts]) / 2
    low = (middles - halves).min(axis=0)
    high = (middles + halves).max(axis=0)
    moved = middles + np.array([width, depth]) / 2 - (low + high) / 2
    pairs = zip(plate.parts, moved.tolist(), strict=True)
    return Plate([(part, (x, y)) for (part, _), (x, y) in pairs])


def to_3mf(plates: Sequence[Plate], printer: Printer) -> bytes:
    """Return plates, beside each other, as a 3MF file: parts by their names, in millimetres."""
    scene = trimesh.Scene()
    for number, plate in enumerate(plates):
        beside = number * BESIDE * printer.plate_mm[0]
        for part, (x, y) in plate.parts:
            place = trimesh.transformations.translation_matrix([beside + x, y, 0.0])
            scene.add_geometry(
                part.mesh, node_name=part.name, geom_name=part.name, transform=place
            )

    return bytes(scene.export(file_type="3mf"))
