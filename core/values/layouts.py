"""Draw the numbers of a layout: what a task's variation leaves to chance, and in which ranges."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from core.geometry import Pose, Triple, Vector

Ranges = Mapping[str, tuple[float, float]]
"""The lowest and the highest value of each number that is drawn, by a name such as ``cube.x``."""

Sets = Mapping[str, Sequence[float]]
"""Values of numbers that are drawn together: those of one place belong to one layout."""

NONE = "none"  # the variation in which nothing is drawn: the paper's layouts


@dataclass(frozen=True)
class Draw:
    """The numbers of the layout of a seed. A number that has no range keeps its nominal value."""

    ranges: Ranges
    seed: int
    sets: Sets = field(default_factory=dict)

    @property
    def count(self) -> int:
        """How many sets of values there are; 0: none, and each seed has a layout of its own."""
        return max(map(len, self.sets.values()), default=0)

    def __call__(self, name: str, nominal: float) -> float:
        """Return a number, uniform in its range. It depends on the seed and its name alone.

        Of a number that is drawn with others, the value of the seed's set; after the last set comes the first.
        """
        if name in self.sets:
            values = self.sets[name]
            return values[self.seed % len(values)]
        if name not in self.ranges:
            return nominal
        rng = np.random.default_rng([self.seed, zlib.crc32(name.encode())])
        return float(rng.uniform(*self.ranges[name]))

    def position(self, name: str, nominal: Vector) -> Triple:
        """Return a position (3,) in metres, from the numbers NAME.x, NAME.y and NAME.z."""
        return tuple(
            self(f"{name}.{axis}", value)
            for axis, value in zip("xyz", nominal, strict=True)
        )

    def pose(self, name: str, nominal: Vector = (0.0, 0.0, 0.0)) -> Pose:
        """Return an upright pose, from NAME.x, NAME.y, NAME.z and NAME.yaw."""
        return Pose.xyz_rpy(
            self.position(name, nominal), (0.0, 0.0, self(f"{name}.yaw", 0.0))
        )


def around(
    name: str, position: Sequence[float], metres: float, radians: float = 0.0
) -> Ranges:
    """Ranges for a body that stands near ``position`` (x, y, ...): up to so many metres and radians away."""
    x, y, *_ = position
    ranges = {
        f"{name}.x": (x - metres, x + metres),
        f"{name}.y": (y - metres, y + metres),
    }

    return ranges | ({f"{name}.yaw": (-radians, radians)} if radians else {})


def within(name: str, **ranges: tuple[float, float]) -> Ranges:
    """Ranges of a body's numbers, such as ``x``, ``yaw`` and ``mass``.

    ``within("cube", mass=(0.1, 0.3))`` are those of the number ``cube.mass``.
    """
    return {f"{name}.{number}": span for number, span in ranges.items()}
