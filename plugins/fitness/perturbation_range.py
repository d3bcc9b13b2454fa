"""Say by how much scenes and tools may be perturbed: as little as a bench differs from its model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field, FiniteFloat

Length = Annotated[FiniteFloat, Field(ge=0)]
Fraction = Annotated[float, Field(ge=0, lt=1)]


@dataclass(unsafe_hash=True)
class PerturbationRange:
    """The greatest perturbations of a scene; each is drawn uniformly between minus and plus this number.

    ``position``: metres, along x and along y. ``yaw``: radians, about the vertical. ``mass`` and ``friction``:
    fractions of the nominal value. The defaults are 5 mm and 3 degrees, as bodies are placed by hand or located by a
    camera; a tenth of the mass; and a fifth of the friction, which is known least. ``size``: a fraction of all lengths
    of the tool, whose own friction changes then too.
    """

    position: Length = 0.005
    yaw: Length = 0.05
    mass: Fraction = 0.1
    friction: Fraction = 0.2
    size: Fraction = 0.0
