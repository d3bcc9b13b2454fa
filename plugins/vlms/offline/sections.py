"""How thick the parts of a tool must be: from what they carry, how far away that is, and what they are made of.

A force F moves the place where it acts by F times the leverage over E I. The leverage is the integral of r^2 along all
bars between there and what holds them, r being the distance from that place: L^3 / 3 for one bar of length L. It
stresses a section of thickness t at that distance with F r t / 2 I.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from core.designs.stiffness import second_moment
from core.geometry import Array
from core.interfaces import Material

BLOW = 4.0
"""What is moved strikes a tool so many times as hard as it loads it; engines measured two to four times."""

SAG_M = 0.016
"""By how much a blow may move the place where it acts."""

SAFETY = 2.3
"""The material's strength over the stress of a blow, at least; an export asks for 2."""

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
    lever: float,
    leverage: float,
    material: Material,
    *,
    least: float,
    most: float,
    wide: float | None = None,
) -> float:
    """Find the least thickness, metres, with which bars are stiff and strong enough.

    Args:
        load: the force on them, newtons; they bear a blow of it.
        lever: how far that acts from the farthest section, metres.
        leverage: of that force, m^3.
        material: of the bars; one without a strength does not break.
        least: the thickness.
        most: the thickness, also where that is not enough.
        wide: the bars' other side; None: their section is a square.
    """
    thick = np.arange(least, most, _THICKNESS_STEP_M)
    other = thick if wide is None else np.full_like(thick, wide)
    thinner = np.minimum(thick, other)
    moments = second_moment(np.maximum(thick, other), thinner, material)

    blow = BLOW * load
    enough = blow * leverage <= SAG_M * material.young_pa * moments
    if material.strength_pa is not None:
        stresses = blow * lever * thinner / (2 * moments)
        enough &= SAFETY * stresses <= material.strength_pa

    found = thick[enough]
    return float(found[0]) if len(found) else most
