"""Make tools' shapes of those that URDF has, with meshes as files."""

from __future__ import annotations

import numpy as np

from core.geometry import Capsule, Cylinder, Mesh, Pose, Shape, Sphere
from core.support.scratch import scratch, write_once
from core.values.descriptions import Origin, RobotShape, rounded_shape


def urdf_shapes(shape: Shape, pose: Pose) -> list[RobotShape]:
    """Make one of our shapes of those that URDF has; a mesh becomes a file of `scratch`."""
    origin = Origin.from_pose(pose)

    match shape:
        case Capsule(radius, length):
            shapes = [RobotShape(rounded_shape(Cylinder(radius, length)), origin)]
            ball = rounded_shape(Sphere(radius))
            for end in (-length / 2, length / 2):
                place = pose @ Pose(np.array([0.0, 0.0, end]))
                shapes.append(RobotShape(ball, Origin.from_pose(place)))

            return shapes
        case Mesh():
            file = scratch() / f"{shape.content}.obj"
            write_once(
                file, lambda: str(shape.to_trimesh().export(file_type="obj", digits=12))
            )
            return [RobotShape(file, origin)]
        case _:
            return [RobotShape(rounded_shape(shape), origin)]
