"""Write a body as a URDF file of one link: the only way to give PyBullet many shapes and an exact inertia."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from lxml import etree

from core.geometry import Box, Capsule, Cylinder, Mesh, Pose, Shape, Sphere
from core.scene import Body, Inertia
from core.support.scratch import write_once
from plugins.simulators.pybullet.engine import pybullet as p

NO_INERTIA = Inertia(0.0, Pose(), np.zeros(3))  # of what is fixed


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
        inertia = None if body.fixed else body.inertia()
        return cls(
            body.name,
            text_file(folder, body_urdf(body, inertia, folder), "urdf"),
            body.fixed,
            body.pose.position.tolist(),
            list(body.pose.rotation.as_quat()),
            dynamics_of(body),
            offset_of(inertia),
        )

    def place(self, client: int) -> int:
        """Place the body in a world and return its number there."""
        number = p.loadURDF(
            str(self.file),
            basePosition=self.position,
            baseOrientation=self.orientation,
            useFixedBase=self.fixed,
            flags=p.URDF_USE_INERTIA_FROM_FILE | p.URDF_USE_IMPLICIT_CYLINDER,
            physicsClientId=client,
        )
        p.changeDynamics(number, -1, **self.dynamics, physicsClientId=client)
        return int(number)


def dynamics_of(body: Body) -> dict[str, float]:
    """Map PyBullet's settings of a link to a body's."""
    # PyBullet multiplies the two bodies' friction, where ours is the geometric mean; and rolling friction by the
    # other's lateral one, which is mostly 0.5.
    friction = {"lateralFriction": np.sqrt(body.friction), "rollingFriction": body.rolling_friction / np.sqrt(0.5)}
    return {**friction, "restitution": body.restitution, "linearDamping": 0.0, "angularDamping": 0.0}


def offset_of(inertia: Inertia | None) -> Pose | None:
    """Return a body's frame in that of its centre of mass; None if they are the same."""
    return None if inertia is None or inertia.frame == Pose() else inertia.frame.inverse()


def text(values: Any) -> str:
    """Write numbers as URDF has them."""
    return " ".join(f"{value:.12g}" for value in values)


def add_origin(parent: Any, pose: Pose) -> None:
    """Add the element that places ``parent``."""
    etree.SubElement(parent, "origin", xyz=text(pose.position), rpy=text(pose.rpy))


def body_urdf(body: Body, inertia: Inertia | None, folder: Path) -> str:
    """Write the collision parts and the inertia (None: fixed, no mass) as URDF; mesh files go to ``folder``."""
    robot = etree.Element("robot", name="body")
    link = etree.SubElement(robot, "link", name="body")
    link.append(inertial(inertia or NO_INERTIA))
    add_shapes(link, body, folder)
    return to_text(robot)


def to_text(robot: Any) -> str:
    """Write a URDF's root element as text."""
    etree.indent(robot)  # PyBullet can't read long lines
    return etree.tostring(robot, encoding="unicode")


def add_shapes(link: Any, body: Body, folder: Path, frame: Pose | None = None) -> None:
    """Add a body's collision parts to a link whose frame in the body's is the inverse of ``frame``."""
    for part in body.collisions:
        element = etree.SubElement(link, "collision")
        add_origin(element, part.pose if frame is None else frame @ part.pose)
        geometry = etree.SubElement(element, "geometry")
        geometry.append(_geometry(part.shape, folder))


def inertial(inertia: Inertia) -> Any:
    """Make a link's inertia as a URDF element."""
    element = etree.Element("inertial")
    add_origin(element, inertia.frame)
    etree.SubElement(element, "mass", value=f"{inertia.mass:.12g}")
    ixx, iyy, izz = (f"{moment:.12g}" for moment in inertia.moments)
    etree.SubElement(element, "inertia", ixx=ixx, iyy=iyy, izz=izz, ixy="0", ixz="0", iyz="0")
    return element


def _geometry(shape: Shape, folder: Path) -> Any:
    match shape:
        case Box(size=size):
            return etree.Element("box", size=text(size))
        case Sphere(radius=radius):
            return etree.Element("sphere", radius=f"{radius:.12g}")
        case Cylinder(radius=radius, length=length):
            return etree.Element("cylinder", radius=f"{radius:.12g}", length=f"{length:.12g}")
        case Capsule(radius=radius, length=length):
            return etree.Element("capsule", radius=f"{radius:.12g}", length=f"{length:.12g}")
        case Mesh():
            file = text_file(folder, str(shape.to_trimesh().export(file_type="obj")), "obj")
            return etree.Element("mesh", filename=str(file))


def facets_file(shape: Shape, folder: Path) -> Path:
    """Write the shape to ``folder`` as an OBJ file, for drawing: edges of less than 30 degrees are shaded smoothly."""
    smooth = trimesh.graph.smooth_shade(shape.to_trimesh(), angle=np.radians(30.0))
    return text_file(folder, str(smooth.export(file_type="obj", include_normals=True)), "obj")


def text_file(folder: Path, text: str, suffix: str) -> Path:
    """Return a file in ``folder`` that holds ``text``, writing it if it is not there yet."""
    return write_once(folder / f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.{suffix}", lambda: text)
