"""Describe a body as the link of a URDF file: the only way to give PyBullet many shapes and an exact inertia."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np

from core.geometry import Box, Capsule, Cylinder, Pose, Primitive, Shape, Sphere
from core.scene import Body
from core.support.scratch import write_once
from core.values.descriptions import (
    Inertial,
    Origin,
    RobotShape,
    rounded,
    rounded_shape,
)
from plugins.simulators.inertia import Inertia
from plugins.simulators.mesh_files import mesh_file
from plugins.simulators.rolling import rollers

_NATIVES = (Box, Sphere, Cylinder, Capsule)  # others are meshes
DIGITS = ".12g"  # of numbers in files
# The least arm of rolling friction of what rolls on a line, metres: it crept otherwise.
_LEAST_ROLLING = 2e-4


def dynamics_of(body: Body, jointed: bool) -> dict[str, float]:
    """Map PyBullet's settings of a link to a body's; ``jointed``: others hang from it, or it from others."""
    arm = body.rolling_friction
    if not jointed and rollers(body):
        arm = max(arm, _LEAST_ROLLING)

    # PyBullet multiplies the two bodies' friction, where ours is the geometric mean; and rolling friction by the
    # other's lateral one, which is mostly 0.5.
    rolling = arm / np.sqrt(0.5)
    return {
        "lateralFriction": np.sqrt(body.friction),
        "rollingFriction": rolling,
        "spinningFriction": rolling,
        "restitution": body.restitution,
        "linearDamping": 0.0,
        "angularDamping": 0.0,
    }


def collisions_of(body: Body, folder: Path, place: Pose) -> tuple[RobotShape, ...]:
    """Describe the collision parts of a body at a place in its link; meshes are written to ``folder``."""
    shapes = []
    for part in body.collisions:
        shape: Primitive | Path
        if isinstance(part.shape, _NATIVES):
            shape = rounded_shape(part.shape, DIGITS)
        else:
            shape = mesh_file(part.shape.triangles, folder)

        origin = Origin.from_pose(place @ part.pose, DIGITS)
        shapes.append(RobotShape(shape, origin))

    return tuple(shapes)


def inertial(inertia: Inertia | None) -> Inertial:
    """Make a link's inertia; None: fixed, without mass."""
    if inertia is None:
        return Inertial()

    origin = Origin.from_pose(inertia.frame, DIGITS)
    xx, yy, zz = (rounded(moment, DIGITS) for moment in inertia.moments)
    moments = (xx, 0.0, 0.0, yy, 0.0, zz)
    return Inertial(rounded(inertia.mass, DIGITS), origin.xyz, moments, origin.rpy)


def facets_file(shape: Shape, folder: Path) -> Path:
    """Write the shape to ``folder`` as an OBJ file, for drawing: edges of less than 30 degrees are shaded smoothly."""
    import trimesh  # which takes half a second

    smooth = trimesh.graph.smooth_shade(shape.to_trimesh(), angle=np.radians(30.0))
    text = str(smooth.export(file_type="obj", include_normals=True))
    return text_file(folder, text, "obj")


def text_file(folder: Path, text: str, suffix: str) -> Path:
    """Return a file in ``folder`` that holds ``text``, writing it if it is not there yet."""
    name = hashlib.sha256(text.encode()).hexdigest()[:16]
    return write_once(folder / f"{name}.{suffix}", lambda: text)
