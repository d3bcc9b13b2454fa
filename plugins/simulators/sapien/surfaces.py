"""Give contacts the same friction and restitution as in the other engines.

Our friction is the geometric mean of the two bodies', our restitution the product. PhysX takes arithmetic means, and
SAPIEN can't change that. So each shape is added several times, once for each kind of surface that it can meet. A copy
touches only its counterpart on the other body, and both have the coefficients of that pair.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

from core.scene import Body
from plugins.simulators.sapien.engine import physx

# Up to this many surfaces are kinds of their own. If there are more, coefficients of friction within a ratio share a
# kind; then friction is off by 1.2 % at most.
_FEW = 4
_ALIKE = 1.5

# Shapes whose last word differs in its upper half never touch each other.
_HIGH_BITS = 16


@dataclass(frozen=True)
class Surface:
    """The contact properties of a body."""

    friction: float
    restitution: float = 0.0

    @classmethod
    def of(cls, body: Body) -> Surface:
        return cls(body.friction, body.restitution)


class Apart(NamedTuple):
    """What a shape doesn't touch: shapes of the same ``mechanism`` that share a bit of ``bits``; the robot's is 0."""

    mechanism: int = 0
    bits: int = 0


TOGETHER = Apart()
"""There is no such shape."""


class Copy(NamedTuple):
    """A shape's copy: its material, and the words that say which others it touches."""

    material: Any
    groups: list[int]


class Surfaces:
    """The surfaces of a world by kind.

    Args:
        moving: those of the robot and of free bodies.
        fixed: those of fixed bodies, which don't meet each other.
    """

    def __init__(self, moving: Iterable[Surface], fixed: Iterable[Surface]) -> None:
        moving = {*moving}
        self._kinds = _sort({*moving, *fixed})
        self._moving = sorted({self._kinds[surface] for surface in moving})

        members: dict[int, list[Surface]] = {}
        for surface, kind in self._kinds.items():
            members.setdefault(kind, []).append(surface)

        self._typical = {kind: _typical(alike) for kind, alike in members.items()}

    def copies(
        self, surface: Surface, apart: Apart, *, fixed: bool = False
    ) -> Iterator[Copy]:
        """Yield a shape's copies, one for each kind of surface that this one can meet; see `attach`."""
        kind = self._kinds[surface]

        for other in self._moving if fixed else self._typical:
            low, high = sorted((kind, other))
            pair = 1 + low * len(self._typical) + high
            # Two shapes touch if the first word of one has a bit in common with the second word of the other.
            is_ = 1 if kind == low else 2
            meets = 1 if kind == high else 2
            last = pair << _HIGH_BITS | apart.mechanism
            groups = [is_, meets, apart.bits, last]
            yield Copy(self._material(surface, other), groups)

    def _material(self, surface: Surface, other: int) -> Any:
        """Make the material of ``surface`` for contacts with a surface of kind ``other``."""
        mine = self._typical[self._kinds[surface]]
        theirs = self._typical[other]
        friction = math.sqrt(mine.friction * theirs.friction)
        if friction > 0:
            # This surface's deviation from the typical one of its kind.
            friction *= 2 * math.sqrt(surface.friction / mine.friction) - 1

        restitution = mine.restitution * theirs.restitution
        return physx.PhysxMaterial(friction, friction, restitution)


def _sort(surfaces: set[Surface]) -> dict[Surface, int]:
    """Assign kinds to surfaces, from 0: each has one restitution, and one friction or a narrow range."""
    ratio = 1.0 if len(surfaces) <= _FEW else _ALIKE
    kinds: dict[Surface, int] = {}
    first = Surface(-1.0)
    kind = -1

    for surface in sorted(surfaces, key=lambda s: (s.restitution, s.friction)):
        rougher = surface.friction > ratio * first.friction
        if rougher or surface.restitution != first.restitution:
            first = surface
            kind += 1

        kinds[surface] = kind

    return kinds


def _typical(surfaces: list[Surface]) -> Surface:
    """Compute the middle of a kind."""
    frictions = [surface.friction for surface in surfaces]
    return Surface(math.sqrt(min(frictions) * max(frictions)), surfaces[0].restitution)
