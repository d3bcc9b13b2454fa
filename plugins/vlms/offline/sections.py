"""How thick the parts of a tool must be: from what they carry, how far away that is, and what they are made of.

A force F moves the place where it acts by F times the leverage over E I. The leverage is the integral of r^2 along all
bars between there and what holds them, r being the distance from that place: L^3 / 3 for one bar of length L.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from core.designs.stiffness import second_moment
from core.geometry import Array
from core.interfaces import Material

SAG_M = 0.008
"""By how much a load may move the place where it acts."""

_THICKNESS_STEP_M = 0.0005  # between two thicknesses that are tried


def measure_leverage(bars: Sequence[tuple[Array, Array]], place: Array) -> float:
    """Measure the leverage of a force on bars, m^3.

    Args:
        bars: where each begins and ends, (3,).
        place: where the force acts, (3,).
    """
    leverage = 0.0
    for start, stop in bars:
        length = float(np.linalg.norm(stop - start))
        a = start - place
        b = stop - place
        leverage += length * float(a @ a + a @ b + b @ b) / 3

    return leverage


def find_thickness(
    load: float,
    leverage: float,
    material: Material,
    *,
    least: float,
    most: float,
    wide: float | None = None,
) -> float:
    """Find the least thickness, metres, with which bars are stiff enough.

    Args:
        load: the force on them, newtons.
        leverage: of that force, m^3.
        material: of the bars.
        least: the thickness.
        most: the thickness, also where that is not stiff enough.
        wide: the bars' other side; None: their section is a square.
    """
    needed = load * leverage / (material.young_pa * SAG_M)
    thick = np.arange(least, most, _THICKNESS_STEP_M)
    other = thick if wide is None else np.full_like(thick, wide)
    moments = second_moment(
        np.maximum(thick, other), np.minimum(thick, other), material
    )
    stiff = thick[moments >= needed]
    return float(stiff[0]) if len(stiff) else most
