"""Write a body as a URDF file of one link: the only way to give PyBullet many shapes and an exact inertia."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from core.geometry import Mesh, Pose, Shape
from core.robot.writing import write
from core.scene import Body
from core.support.scratch import write_once
from core.values.descriptions import (
    Description,
    Inertial,
    Origin,
    Primitive,
    RobotLink,
    RobotShape,
    rounded,
    rounded_shape,
)
from plugins.simulators.inertia import Inertia, inertia_of
from plugins.simulators.pybullet.engine import Client
from plugins.simulators.rolling import rollers

DIGITS = ".12g"  # of numbers in files
# The least arm of rolling friction of what rolls on a line, metres: it crept otherwise.
_LEAST_ROLLING = 2e-4


@dataclass(frozen=True, eq=False)
class PreparedBody:
    """A body ready to be placed in one world after another; its inertia and file, slow to make, are made once.

    ``offset`` is its frame in PyBullet's, which is that of the centre of mass; None if they are the same.
    """

    name: str
    file: Path
    fixed: bool
    position: list[float]
    orientation: list[float]  # x, y, z, w
    dynamics: dict[str, float]
    offset: Pose | None

    @classmethod
    def of(cls, body: Body, folder: Path) -> PreparedBody:
        """Prepare a body; its files are written to ``folder``."""
        inertia = None if body.fixed else inertia_of(body)
        link = RobotLink("body", inertial(inertia), collisions_of(body, folder))
        return cls(
            body.name,
            text_file(folder, write(Description("body", {"body": link})), "urdf"),
            body.fixed,
            body.pose.position.tolist(),
            list(body.pose.rotation.as_quat()),
            dynamics_of(body, _LEAST_ROLLING if rollers(body) else 0.0),
            offset_of(inertia),
        )

    def place(self, client: Client) -> int:
        """Place the body in a world and return its number there."""
        flags = client.URDF_USE_INERTIA_FROM_FILE | client.URDF_USE_IMPLICIT_CYLINDER
        number = client.loadURDF(
            str(self.file),
            self.position,
            self.orientation,
            useFixedBase=self.fixed,
            flags=flags,
        )
        client.changeDynamics(number, -1, **self.dynamics)
        return int(number)


def dynamics_of(body: Body, least_rolling: float = 0.0) -> dict[str, float]:
    """Map PyBullet's settings of a link to a body's."""
    # PyBullet multiplies the two bodies' friction, where ours is the geometric mean; and rolling friction by the
    # other's lateral one, which is mostly 0.5.
    rolling = max(body.rolling_friction, least_rolling)
    friction = {
        "lateralFriction": np.sqrt(body.friction),
        "rollingFriction": rolling / np.sqrt(0.5),
    }
    return {
        **friction,
        "restitution": body.restitution,
        "linearDamping": 0.0,
        "angularDamping": 0.0,
    }


def offset_of(inertia: Inertia | None) -> Pose | None:
    """Return a body's frame in that of its centre of mass; None if they are the same."""
    if inertia is None or inertia.frame == Pose():
        return None
    return inertia.frame.inverse()


def collisions_of(
    body: Body, folder: Path, frame: Pose | None = None
) -> tuple[RobotShape, ...]:
    """Make the collision parts of a link whose frame in the body's is the inverse of ``frame``."""
    shapes = []
    for part in body.collisions:
        shape: Primitive | Path
        if isinstance(part.shape, Mesh):  # its file goes to ``folder``
            text = str(part.shape.to_trimesh().export(file_type="obj"))
            shape = text_file(folder, text, "obj")
        else:
            shape = rounded_shape(part.shape, DIGITS)
        pose = part.pose if frame is None else frame @ part.pose
        shapes.append(RobotShape(shape, Origin.from_pose(pose, DIGITS)))
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
    smooth = trimesh.graph.smooth_shade(shape.to_trimesh(), angle=np.radians(30.0))
    text = str(smooth.export(file_type="obj", include_normals=True))
    return text_file(folder, text, "obj")


def text_file(folder: Path, text: str, suffix: str) -> Path:
    """Return a file in ``folder`` that holds ``text``, writing it if it is not there yet."""
    name = hashlib.sha256(text.encode()).hexdigest()[:16]
    return write_once(folder / f"{name}.{suffix}", lambda: text)
