"""Say by how much scenes and tools may be perturbed: as little as a bench differs from its model."""

from __future__ import annotations

import math
from dataclasses import dataclass

from core.errors import UsageError


@dataclass(unsafe_hash=True)
class PerturbationRange:
    """The greatest perturbations of a scene; each is drawn uniformly between minus and plus this number.

    ``position``: metres, along x and along y. ``yaw``: radians, about the vertical. ``mass`` and ``friction``:
    fractions of the nominal value. The defaults are 5 mm and 3 degrees, as bodies are placed by hand or located by a
    camera; a tenth of the mass; and a fifth of the friction, which is known least. ``size``: a fraction of all lengths
    of the tool, whose own friction changes then too.

    Raises:
        UsageError: a number is negative or not finite, or a fraction is 1 or more.
    """

    position: float = 0.005
    yaw: float = 0.05
    mass: float = 0.1
    friction: float = 0.2
    size: float = 0.0

    def __post_init__(self) -> None:
        for name, most in (
            ("position", math.inf),
            ("yaw", math.inf),
            ("mass", 1.0),
            ("friction", 1.0),
            ("size", 1.0),
        ):
            value = getattr(self, name)
            if not 0 <= value < most:
                less = f" and less than {most:g}" if most < math.inf else ", and finite"
                raise UsageError(
                    f"perturbation.{name} must be 0 or greater{less}, got {value}"
                )
