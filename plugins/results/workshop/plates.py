"""Arrange parts on a printer's plates, and write them as 3MF files. Lengths are millimetres."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import compress

import numpy as np
import trimesh
from trimesh.path.packing import rectangles_single

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

    parts: list[tuple[PrintedPart, tuple[float, float]]]


def arrange(parts: Sequence[PrintedPart], printer: Printer) -> list[Plate]:
    """Lay parts beside each other on as few plates as that takes; what is too large lies alone.

    Args:
        parts: as they lie.
        printer: whose plate it is.
    """
    room = np.array(printer.plate_mm[:2])
    waiting = list(parts)
    plates = []
    while waiting:
        sizes = np.array([part.lying.size[:2] for part in waiting]) + APART_MM
        bounds, fits = rectangles_single(sizes, room + APART_MM, rotate=False)
        if not fits.any():
            fits[0] = True
            bounds = np.array([[[0.0, 0.0], sizes[0]]])

        middle = (bounds.min(axis=(0, 1)) + bounds.max(axis=(0, 1))) / 2
        middles = bounds.mean(axis=1) + room / 2 - middle
        chosen = list(compress(waiting, fits))
        pairs = zip(chosen, middles.tolist(), strict=True)
        plates.append(Plate([(part, (x, y)) for part, (x, y) in pairs]))
        waiting = [part for part in waiting if part not in chosen]

    return plates


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
