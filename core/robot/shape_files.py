"""Write shapes as URDF has them: primitives, and meshes as files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from core.geometry import Capsule, Cylinder, Mesh, Pose, Shape, Sphere
from core.support.scratch import scratch, write_once
from core.values.descriptions import Primitive, rounded_shape


def urdf_shapes(shape: Shape) -> Iterator[tuple[Pose | None, Primitive | Path]]:
    """Yield URDF's shapes that make up one of ours, with their poses; a mesh is a file of `scratch`."""
    match shape:
        case Capsule(radius, length):  # URDF has none
            yield None, rounded_shape(Cylinder(radius, length))
            for end in (-length / 2, length / 2):
                yield Pose(np.array([0.0, 0.0, end])), rounded_shape(Sphere(radius))
        case Mesh():
            file = scratch() / f"{shape.content}.obj"
            write_once(
                file, lambda: str(shape.to_trimesh().export(file_type="obj", digits=12))
            )
            yield None, file
        case _:
            yield None, rounded_shape(shape)
