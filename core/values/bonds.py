"""Define bonds: points at which bodies are held until the force is too much. Plugins import them from `core.scene`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from core.errors import refuse
from core.geometry import Vector

MAX_BREAKS_N = 1e4  # N, of any bond in a scene


@dataclass(frozen=True)
class Bond:
    """A point of a body that is held to another body, or to the world, until the force there is more than ``breaks_n``.

    It holds as both are at the start, in all directions, and lets them turn about the point; several bonds hold a body
    altogether. It ends with the first step of the engine in which the force is more, for good. The two bodies collide
    like any others.

    A lid that is glued to a jar at one point::

        Bond("glue", "lid", breaks_n=15.0, parent="jar", origin=(0.03, 0.0, 0.0))

    Attributes:
        name: of the bond.
        body: the name of a body that can move.
        breaks_n: the force that it bears, N.
        parent: the name of what the body is held to; None: the world.
        origin: (3,) the point, in the body's frame, m.

    Raises:
        ValueError: says which of these can't be.
    """

    name: str
    body: str
    breaks_n: float
    parent: str | None = None
    origin: Vector = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        problems = {
            f"breaks_n must be above 0 and at most {MAX_BREAKS_N:g}, got {self.breaks_n}": (
                not 0 < self.breaks_n <= MAX_BREAKS_N
            ),
            "its origin needs three numbers": not np.isfinite(self.origin).all(),
            "it holds a body to itself; name another parent": self.body == self.parent,
        }
        refuse(f"bond {self.name!r}: ", problems)
