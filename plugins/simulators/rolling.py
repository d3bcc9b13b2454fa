"""Find what rolls on a line: engines keep its contact points, which stay behind, and their force turns it on."""

from __future__ import annotations

from core.geometry import Capsule, Cylinder
from core.scene import Body


def rollers(body: Body) -> tuple[Capsule | Cylinder, ...]:
    """Return the shapes on which a free body rolls along a line: capsules and lying cylinders, if it has no others."""
    if body.fixed:
        return ()

    found: list[Capsule | Cylinder] = []
    for part in body.collisions:
        turn = (body.pose @ part.pose).rotation_matrix
        lies = abs(turn[2, 2]) < 0.5
        shape = part.shape
        if not isinstance(shape, Capsule | Cylinder):
            return ()
        if isinstance(shape, Cylinder) and not lies:
            return ()
        found.append(shape)

    return tuple(found)
