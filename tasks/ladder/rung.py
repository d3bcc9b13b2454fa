"""One scene of a family: with the design that is known to solve it, and a simpler one that must not."""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

NOISES_M = (0.002, 0.005, 0.01, 0.02)
"""How far off places are seen at levels 1 to 4; from there on the last one stays."""

SURE = 3.0
"""Standard deviations of what is seen for which a reference leaves room."""

Entry = dict[str, Any]
"""An object of a scene file or of a designs file."""


@dataclass(frozen=True)
class Rung:
    """What a family draws for one level and seed.

    Attributes:
        scene: as a scene file says it, without its name and noise.
        reference: a design that solves it.
        simpler: a design that ignores what the level makes hard, and fails.
    """

    scene: Mapping[str, Any]
    reference: Mapping[str, Any]
    simpler: Mapping[str, Any]


class Family(Protocol):
    """A module of this folder: it draws a rung. ``noise_m`` is how far off places are seen, m."""

    def __call__(self, level: int, noise_m: float, rng: random.Random) -> Rung: ...


def spread(noise_m: float) -> float:
    """Return how far layouts move what is handled, to each side, m.

    It is more than the noise, so that a plan must look: where things hardly move, one that doesn't look never errs.
    """
    return round(max(0.02, 2.5 * noise_m), 4)


def noise_at(level: int) -> float:
    """Return how far off places are seen at a level, m (standard deviation of x and y)."""
    return NOISES_M[min(level, len(NOISES_M)) - 1]
