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
from core.scratch import write_once
from plugins.simulators.pybullet.engine import pybullet as p


@dataclass(frozen=True, eq=False)
class PreparedBody:
    """A body ready to be placed in one world after another; its inertia and file, slow to make, are made once.

    ``offset`` is its frame in PyBullet's, which is that of the centre of mass; None if they are the same.
    """

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
        # PyBullet multiplies the two bodies' friction, where ours is the geometric mean; and rolling friction by the
        # other's lateral one, which is mostly 0.5.
        friction = {"lateralFriction": np.sqrt(body.friction), "rollingFriction": body.rolling_friction / np.sqrt(0.5)}
        dynamics = {**friction, "restitution": body.restitution, "linearDamping": 0.0, "angularDamping": 0.0}
        same = inertia is None or inertia.frame == Pose()
        return cls(
            text_file(folder, body_urdf(body, inertia, folder), "urdf"),
            body.fixed,
            body.pose.position.tolist(),
            list(body.pose.rotation.as_quat()),
            dynamics,
            None if inertia is None or same else inertia.frame.inverse(),
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


def _text(values: Any) -> str:
    return " ".join(f"{value:.12g}" for value in values)


def _origin(parent: Any, pose: Pose) -> None:
    etree.SubElement(parent, "origin", xyz=_text(pose.position), rpy=_text(pose.rpy))


def body_urdf(body: Body, inertia: Inertia | None, folder: Path) -> str:
    """Write the collision parts and the inertia (None: fixed, no mass) as URDF; mesh files go to ``folder``."""
    robot = etree.Element("robot", name="body")
    link = etree.SubElement(robot, "link", name="body")
    link.append(inertial(inertia or Inertia(0.0, Pose(), np.zeros(3))))
    for part in body.collisions:
        element = etree.SubElement(link, "collision")
        _origin(element, part.pose)
        geometry = etree.SubElement(element, "geometry")
        geometry.append(_geometry(part.shape, folder))
    etree.indent(robot)  # PyBullet can't read long lines
    return etree.tostring(robot, encoding="unicode")


def inertial(inertia: Inertia) -> Any:
    """Make a link's inertia as a URDF element."""
    element = etree.Element("inertial")
    _origin(element, inertia.frame)
    etree.SubElement(element, "mass", value=f"{inertia.mass:.12g}")
    ixx, iyy, izz = (f"{moment:.12g}" for moment in inertia.moments)
    etree.SubElement(element, "inertia", ixx=ixx, iyy=iyy, izz=izz, ixy="0", ixz="0", iyz="0")
    return element


def _geometry(shape: Shape, folder: Path) -> Any:
    match shape:
        case Box(size=size):
            return etree.Element("box", size=_text(size))
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
