"""Write a description anew with what every engine reads alike: convex hulls, whole inertias, limits of all joints.

Covered by `tests/core/robot/test_reading.py`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from core.errors import UserError
from core.geometry import Array, Box, Cylinder, Pose, Sphere
from core.robot.description import merged, to_text
from core.robot.meshes import hull_file, visual_file
from core.robot.urdf import Description, Joint, Link, Shape

_ROUNDED = 0.01  # of the largest moment: an inertia that is off by less was rounded
_BASE_KG, _BASE_INERTIA = 1.0, 0.01 * np.eye(3)  # of a base without: it does not move, but engines want a mass


@dataclass(frozen=True)
class Drive:
    """A joint that moves: ``revolute`` or ``prismatic``, and its limits in radians or metres, N m or N, and 1/s."""

    kind: str
    lower: float
    upper: float
    effort: float
    velocity: float


def rigid_parts(description: Description, heads: Iterable[str]) -> dict[str, tuple[str, Pose]]:
    """Map each link to the link in ``heads`` (or the root) that it is rigidly joined to, and its pose in that one."""
    found: dict[str, tuple[str, Pose]] = {}
    heads = {*heads, description.root}
    for name in description.links:
        at, link = Pose(), name
        while link not in heads:
            joint = description.joints[link]
            at, link = joint.pose @ at, joint.parent
        found[name] = link, at
    return found


def write_plain(
    description: Description, drives: Mapping[str, Drive], flange: str, detached: Iterable[str] = ()
) -> str:
    """Write a description as URDF text. Links that are rigidly joined become one, under the name of the first.

    Args:
        description: of the robot.
        drives: the joints that move, by name; all others are fixed.
        flange: a link that stays, as a frame.
        detached: links that are not always there, and so stay apart from what bears them.

    Raises:
        UserError: a link that moves lacks mass or a physical inertia, or a mesh can't be used.
    """
    heads = [name for name, joint in description.joints.items() if joint.name in drives or name in detached]
    parts = rigid_parts(description, heads)
    root = etree.Element("robot", name=description.name)
    for head in (description.root, *heads):
        _write_link(root, head, [(description.links[name], at) for name, (of, at) in parts.items() if of == head])
    for head in heads:
        joint = description.joints[head]
        parent, at = parts[joint.parent]
        _write_joint(root, joint, parent, head, at @ joint.pose, drives.get(joint.name))
    if flange not in (description.root, *heads):
        etree.SubElement(root, "link", name=flange)
        _write_joint(root, description.joints[flange], parts[flange][0], flange, parts[flange][1], None)
    return to_text(root)


def _write_joint(root: Any, joint: Joint, parent: str, child: str, pose: Pose, drive: Drive | None) -> None:
    element = etree.SubElement(root, "joint", name=joint.name, type=drive.kind if drive else "fixed")
    etree.SubElement(element, "parent", link=parent)
    etree.SubElement(element, "child", link=child)
    _write_origin(element, pose)
    if drive is not None:
        etree.SubElement(element, "axis", xyz=_numbers(joint.axis))
        limits = ("lower", "upper", "effort", "velocity")
        etree.SubElement(element, "limit", {name: _numbers([getattr(drive, name)]) for name in limits})


def _inertia(head: str, parts: list[tuple[Link, Pose]]) -> tuple[float, Array, Array]:
    """Merge the inertias of rigidly joined links, in the frame of the first one.

    Raises:
        UserError: there is no mass, or no body could have these moments.
    """
    where = f"link {head!r}" + (f" with what is fixed to it ({len(parts) - 1} more)" if len(parts) > 1 else "")
    heavy = [(link, at, at.rotation.as_matrix()) for link, at in parts if link.mass > 0]
    if not heavy:
        raise UserError(f"{where} moves, but has no mass; give it <inertial> with mass and inertia")
    mass, center, tensor = merged([(k.mass, at.apply(k.center), r @ k.inertia @ r.T) for k, at, r in heavy])
    moments = np.linalg.eigvalsh(tensor)
    if not moments[0] > 0:
        raise UserError(f"{where} has {mass:g} kg, but an inertia that is not positive; give ixx, iyy and izz, kg m^2")
    lacking = float(moments[2] - moments[0] - moments[1])
    if lacking > _ROUNDED * moments[2]:
        shown = ", ".join(f"{moment:.3g}" for moment in moments)
        rule = "of no body is one larger than the two others together"
        raise UserError(f"{where} has moments of inertia {shown} kg m^2; {rule}: look at its units and signs")
    return mass, center, tensor + max(0.0, lacking * 1.001) * np.eye(3)


def _write_link(root: Any, head: str, parts: list[tuple[Link, Pose]]) -> None:
    """Write rigidly joined links, at poses in the frame of the first, as one. A base needs no inertia of its own."""
    element = etree.SubElement(root, "link", name=head)
    try:
        mass, center, tensor = _inertia(head, parts)
    except UserError:
        if len(root) > 1:
            raise
        solid = any(link.collisions for link, _ in parts)  # without, it is only a frame
        mass, center, tensor = solid * _BASE_KG, np.zeros(3), solid * _BASE_INERTIA
    inertial = etree.SubElement(element, "inertial")
    _write_origin(inertial, Pose(center))
    etree.SubElement(inertial, "mass", value=_numbers([mass]))
    names = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    etree.SubElement(inertial, "inertia", {name: _numbers([tensor[at]]) for name, at in names.items()})
    for link, at in parts:
        for tag, shapes in (("visual", link.visuals or link.collisions), ("collision", link.collisions)):
            for shape in shapes:
                part = etree.SubElement(element, tag)
                _write_origin(part, at @ shape.pose)
                _write_shape(etree.SubElement(part, "geometry"), shape, drawn=tag == "visual")
                if tag == "visual":
                    etree.SubElement(etree.SubElement(part, "material", name=""), "color", rgba=_numbers(shape.color))


def _write_shape(geometry: Any, shape: Shape, *, drawn: bool) -> None:
    match shape.shape:
        case Box(size):
            etree.SubElement(geometry, "box", size=_numbers(size))
        case Sphere(radius):
            etree.SubElement(geometry, "sphere", radius=_numbers([radius]))
        case Cylinder(radius, length):
            etree.SubElement(geometry, "cylinder", radius=_numbers([radius]), length=_numbers([length]))
        case Path() as mesh:
            file = visual_file(mesh, shape.color, shape.scale) if drawn else hull_file(mesh, shape.scale)
            etree.SubElement(geometry, "mesh", filename=str(file))


def _write_origin(parent: Any, pose: Pose) -> None:
    etree.SubElement(parent, "origin", xyz=_numbers(pose.position), rpy=_numbers(pose.rpy))


def _numbers(values: Iterable[float]) -> str:
    return " ".join(f"{float(value) + 0.0:.15g}" for value in values)
