"""Friction and restitution of a contact as every engine has to have them.

Our friction is the geometric mean of the two bodies', our restitution the product. PhysX takes arithmetic means, and
SAPIEN leaves no other choice. So a shape is there several times, once for each kind of surface that it can meet: a
copy touches only the copy of the other that is meant for it, and both have the coefficients of that very pair.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from core.scene import Body
from plugins.simulators.sapien.engine import physx

# As many surfaces as this are kinds of their own. Where there are more, coefficients of friction within a ratio share a
# kind; then friction is off by 1.2 % at most.
_FEW = 4
_ALIKE = 1.5

_HIGH_BITS = 16  # shapes whose last word differs in its upper half never touch each other


@dataclass(frozen=True)
class Surface:
    """What is felt of a body where something touches it."""

    friction: float
    restitution: float = 0.0

    @classmethod
    def of(cls, body: Body) -> Surface:
        return cls(body.friction, body.restitution)


class Surfaces:
    """The surfaces of a world, by kind: those of what moves, and those of what is fixed."""

    def __init__(self, moving: Iterable[Surface], fixed: Iterable[Surface]) -> None:
        moving = {*moving}
        self._kinds = _kinds({*moving, *fixed})
        self._all = sorted({*self._kinds.values()})
        self._moving = sorted({self._kinds[surface] for surface in moving})
        self._typical = {kind: _typical([s for s, k in self._kinds.items() if k == kind]) for kind in self._all}
        self._materials: dict[tuple[Surface, int], Any] = {}

    def copies(
        self, surface: Surface, make: Callable[[Any], Any], *, fixed: bool = False, apart: int = 0
    ) -> Iterator[Any]:
        """Shapes that ``make`` makes of a material, one for each kind of surface that this one can meet.

        Shapes whose ``apart`` have a bit in common don't touch each other.
        """
        own = self._kinds[surface]
        for other in self._moving if fixed else self._all:
            shape = make(self._material(surface, other))
            low, high = sorted((own, other))
            pair = 1 + low * len(self._all) + high
            # Of a pair, what is of the one kind touches what is of the other: the first word of one, the second of the
            # other must have a bit in common.
            is_, meets = (1, 1) if own == other else (1, 2) if own == low else (2, 1)
            shape.set_collision_groups([is_, meets, apart, pair << _HIGH_BITS])
            yield shape

    def _material(self, surface: Surface, other: int) -> Any:
        """That of ``surface`` where it meets a surface of kind ``other``."""
        key = (surface, other)
        if key not in self._materials:
            one, two = self._typical[self._kinds[surface]], self._typical[other]
            friction = math.sqrt(one.friction * two.friction)
            if friction > 0:  # a surface's share of what a pair has more than the typical one of its kinds
                friction *= 2 * math.sqrt(surface.friction / one.friction) - 1
            self._materials[key] = physx.PhysxMaterial(friction, friction, one.restitution * two.restitution)
        return self._materials[key]


def _kinds(surfaces: set[Surface]) -> dict[Surface, int]:
    """Each surface's kind: one restitution, and one friction or a narrow range."""
    ratio = 1.0 if len(surfaces) <= _FEW else _ALIKE
    kinds: dict[Surface, int] = {}
    first, kind = Surface(-1.0), -1
    for surface in sorted(surfaces, key=lambda s: (s.restitution, s.friction)):
        if surface.restitution != first.restitution or surface.friction > ratio * first.friction:
            first, kind = surface, kind + 1
        kinds[surface] = kind
    return kinds


def _typical(surfaces: list[Surface]) -> Surface:
    """The middle of a kind."""
    frictions = [surface.friction for surface in surfaces]
    return Surface(math.sqrt(min(frictions) * max(frictions)), surfaces[0].restitution)
