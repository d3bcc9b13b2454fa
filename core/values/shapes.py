"""Change the size of shapes."""

from __future__ import annotations

import numpy as np

from core.geometry import Array, Box, Capsule, Compound, Cylinder, Mesh, Shape, Sphere, Vector


def resized(shape: Shape | Compound, size: Vector) -> Shape | Compound:
    """Return a shape of the same kind with a bounding box of these side lengths; radii are means of two or three."""
    x, y, z = (float(side) for side in size)
    match shape:
        case Box():
            return Box((x, y, z))
        case Sphere():
            return Sphere((x + y + z) / 6)
        case Cylinder():
            return Cylinder((x + y) / 4, z)
        case Capsule():
            return Capsule((x + y) / 4, max(z - (x + y) / 2, 1e-6))
        case Mesh():
            return _stretched(shape, *shape.bounds, np.array([x, y, z]))
        case Compound(surface, parts):
            around = *surface.bounds, np.array([x, y, z])
            return Compound(_stretched(surface, *around), tuple(_stretched(part, *around) for part in parts))


def _stretched(mesh: Mesh, middle: Array, before: Array, after: Array) -> Mesh:
    return Mesh((mesh.vertices - middle) * (after / before) + middle, mesh.faces)
