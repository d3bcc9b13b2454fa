"""Find what rolls on a line: engines keep its contact points, which stay behind, and their force turns it on."""

from __future__ import annotations

from core.geometry import Capsule, Cylinder
from core.scene import Body


def rollers(body: Body) -> tuple[Capsule | Cylinder, ...]:
    """Return the shapes on which a free body rolls along a line: capsules and lying cylinders, if it has no others."""
    shapes = [
        (part.shape, abs((body.pose @ part.pose).rotation.as_matrix()[2, 2]))
        for part in body.collisions
    ]
    found = tuple(
        s
        for s, up in shapes
        if isinstance(s, Capsule) or (isinstance(s, Cylinder) and up < 0.5)
    )
    return found if len(found) == len(shapes) and not body.fixed else ()
