"""Tubes, cups, mugs and bottles of a scene file, as the convex shapes that collide."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from core.errors import refuse
from core.geometry import Box, Cylinder, Mesh, Pose, Shape

HANDLE_M = 0.03  # of a mug that does not say
_SIDES = 20  # of a round wall
# Corners so far out that a wall has the volume of a round one.
_OUT = math.sqrt(2 * math.pi / _SIDES / math.sin(2 * math.pi / _SIDES))
_THICK = 0.2  # of the radius: a handle
_TALL = 0.6  # of the length

# The triangles of a part of a wall: its corners are below and above, outside and inside, first and last.
_WEDGE = np.array(
    [
        *([0, 1, 5], [0, 5, 4]),  # outside
        *([2, 7, 3], [2, 6, 7]),  # inside
        *([0, 2, 3], [0, 3, 1]),  # below
        *([4, 5, 7], [4, 7, 6]),  # above
        *([0, 4, 6], [0, 6, 2]),  # first
        *([1, 3, 7], [1, 7, 5]),  # last
    ]
)

Placed = tuple[Shape, Pose]


@dataclass(frozen=True)
class Vessel:
    """A round wall along z, centred on its frame; a floor, a square handle toward x and a neck, where they are above 0.

    With a ``bottom`` the wall slopes, as that of a bowl or a funnel does.

    Attributes:
        radius: outside, m.
        length: along z, m.
        wall: how thick the wall is, m.
        floor: how thick the floor is, m.
        handle: how far the handle stands out, m.
        neck: the neck's radius outside, m.
        neck_length: of the neck, m; below it is a shoulder, half as high as it is wide.
        bottom: the radius outside at the lower end, m; 0: as ``radius``.

    Raises:
        ValueError: nothing is left inside.
    """

    radius: float
    length: float
    wall: float
    floor: float = 0.0
    handle: float = 0.0
    neck: float = 0.0
    neck_length: float = 0.0
    bottom: float = 0.0

    def __post_init__(self) -> None:
        problems = {
            "the wall must be thinner than the radius": self.wall >= self.radius,
            "the wall must be thinner than the radius at the bottom": (
                0 < self.bottom <= self.wall
            ),
            "the floor must be thinner than the length": self.floor >= self.length,
            "the neck must be wider than the wall, and narrower than the body": (
                self.neck > 0 and not self.wall < self.neck <= self.radius
            ),
            "the neck and shoulder must be shorter than the rest": (
                self.neck > 0 and self._top - self.floor <= self.neck_length
            ),
        }
        refuse("", problems)

    @property
    def _top(self) -> float:
        """Where the wide part of the wall ends, m from below."""
        if not self.neck:
            return self.length

        shoulder = (self.radius - self.neck) / 2
        return self.length - self.neck_length - shoulder

    def parts(self) -> Iterator[Placed]:
        """Yield its convex parts."""
        lowest = self.bottom or self.radius
        share = self.floor / self._top
        floor_radius = lowest + share * (self.radius - lowest)
        yield from self._wall(self.floor, self._top, floor_radius, self.radius)
        if self.neck:
            bottom = self.length - self.neck_length
            yield from self._wall(self._top, bottom, self.radius, self.neck)
            yield from self._wall(bottom, self.length, self.neck, self.neck)
        if self.floor:
            disc = Cylinder(lowest, self.floor)
            yield disc, _shift(0.0, (self.floor - self.length) / 2)
        if self.handle:
            yield from self._handle()

    def _wall(
        self, bottom: float, top: float, below: float, above: float
    ) -> Iterator[Placed]:
        """Yield the parts of a wall from ``bottom`` to ``top``, m, whose radius outside is ``below`` and ``above``."""
        angles = np.linspace(0, 2 * np.pi, _SIDES + 1)
        ways = _OUT * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        corners = np.zeros((2, 2, 2, 3))
        corners[0, ..., 2] = bottom - self.length / 2
        corners[1, ..., 2] = top - self.length / 2
        for number in range(_SIDES):
            pair = ways[number : number + 2]
            for end, radius in enumerate((below, above)):
                corners[end, 0, :, :2] = radius * pair
                corners[end, 1, :, :2] = (radius - self.wall) * pair

            yield Mesh(corners.reshape(-1, 3), _WEDGE), Pose()

    def _handle(self) -> Iterator[Placed]:
        height = _TALL * self.length / 2
        thick = min(_THICK * self.radius, self.handle / 2, height)
        for end in (-height, height):
            bar = Box((self.handle, thick, thick))
            yield bar, _shift(self.radius + self.handle / 2, end)

        grip = Box((thick, thick, 2 * height - thick))
        yield grip, _shift(self.radius + self.handle - thick / 2, 0.0)


@lru_cache(maxsize=64)  # a scene is built again and again with other numbers
def shape_vessel(vessel: Vessel) -> tuple[Placed, ...]:
    """Return the convex parts of a vessel."""
    return tuple(vessel.parts())


def _shift(x: float, z: float) -> Pose:
    return Pose(np.array([x, 0.0, z]))
