"""Make tools' shapes of those that URDF has, with meshes as files."""

from __future__ import annotations

from pathlib import Path

from core.geometry import Mesh, Pose, Primitive, Shape
from core.support.scratch import scratch, write_once
from core.values.descriptions import Origin, RobotShape, rounded_shape


def urdf_shapes(shape: Shape, pose: Pose) -> list[RobotShape]:
    """Make one of our shapes of those that URDF has: a box, a cylinder, a sphere or the file of a mesh.

    URDF has no capsules, so that one becomes a cylinder with a ball at each end. Lengths are rounded to picometres.

    Args:
        shape: in its own frame.
        pose: of this frame in that of the link.

    For example, a capsule gives three shapes::

        body, lower_end, upper_end = urdf_shapes(Capsule(0.01, 0.2), Pose())
    """
    shapes = []
    for part, place in shape.urdf_parts():
        there = pose if place is None else pose @ place
        written: Primitive | Path
        if isinstance(part, Primitive):
            written = rounded_shape(part)
        else:
            written = _write_mesh(part.triangles)

        shapes.append(RobotShape(written, Origin.from_pose(there)))

    return shapes


def _write_mesh(mesh: Mesh) -> Path:
    """Write a mesh to a file of `scratch`; meshes with the same content share it."""
    file = scratch() / f"{mesh.content}.obj"
    write_once(file, lambda: str(mesh.to_trimesh().export(file_type="obj", digits=12)))

    return file
