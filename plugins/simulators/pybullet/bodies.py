"""A scene's body as a URDF file of one link: the one way to give PyBullet many shapes and an exact inertia."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from lxml import etree

from core.geometry import Box, Cylinder, Mesh, Pose, Shape, Sphere
from core.scene import Body, Inertia


def _text(values: Any) -> str:
    return " ".join(f"{value:.12g}" for value in values)


def _origin(parent: Any, pose: Pose) -> None:
    etree.SubElement(parent, "origin", xyz=_text(pose.position), rpy=_text(pose.rpy))


def body_urdf(body: Body, inertia: Inertia | None, folder: Path) -> str:
    """The collision parts and the inertia (None: fixed, no mass); mesh files go to ``folder``."""
    robot = etree.Element("robot", name="body")
    link = etree.SubElement(robot, "link", name="body")
    element = etree.SubElement(link, "inertial")
    _origin(element, inertia.frame if inertia else Pose())
    etree.SubElement(element, "mass", value=f"{body.mass:.12g}")
    ixx, iyy, izz = (f"{moment:.12g}" for moment in (inertia.moments if inertia else (0.0, 0.0, 0.0)))
    etree.SubElement(element, "inertia", ixx=ixx, iyy=iyy, izz=izz, ixy="0", ixz="0", iyz="0")
    for part in body.collisions:
        element = etree.SubElement(link, "collision")
        _origin(element, part.pose)
        geometry = etree.SubElement(element, "geometry")
        geometry.append(_geometry(part.shape, folder))
    etree.indent(robot)  # PyBullet's reader does not take long lines
    return etree.tostring(robot, encoding="unicode")


def _geometry(shape: Shape, folder: Path) -> Any:
    match shape:
        case Box(size=size):
            return etree.Element("box", size=_text(size))
        case Sphere(radius=radius):
            return etree.Element("sphere", radius=f"{radius:.12g}")
        case Cylinder(radius=radius, length=length):
            return etree.Element("cylinder", radius=f"{radius:.12g}", length=f"{length:.12g}")
        case Mesh():
            return etree.Element("mesh", filename=str(mesh_file(shape, folder)))


def mesh_file(mesh: Mesh, folder: Path) -> Path:
    """An OBJ file of the mesh in ``folder``, to be felt."""
    return _once(folder, str(mesh.to_trimesh().export(file_type="obj")))


def facets_file(shape: Shape, folder: Path) -> Path:
    """An OBJ file of the shape in ``folder``, to be seen: edges of less than 30 degrees are shaded as if round."""
    smooth = trimesh.graph.smooth_shade(shape.to_trimesh(), angle=np.radians(30.0))
    return _once(folder, str(smooth.export(file_type="obj", include_normals=True)))


def _once(folder: Path, text: str) -> Path:
    file = folder / f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.obj"
    if not file.exists():
        file.write_text(text)
    return file
