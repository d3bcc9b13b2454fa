"""Write descriptions as URDF text."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from lxml import etree

from core.geometry import Primitive
from core.values.descriptions import (
    MOMENTS,
    ONE,
    Description,
    Limits,
    Origin,
    RobotJoint,
    RobotLink,
    RobotShape,
)

MeshPath = Callable[[Path], str]


def write(
    description: Description, *, visuals: bool = True, mesh_path: MeshPath = str
) -> str:
    """Write a description as URDF text.

    Args:
        description: links and joints.
        visuals: include the visual shapes.
        mesh_path: maps a mesh's absolute path to the text that is written.
    """
    root = _element("robot", name=description.name)

    for link in description.links.values():
        root.append(_link_element(link, visuals, mesh_path))

    root.extend(map(_joint_element, description.joints.values()))

    return _to_text(root)


def write_part(link: RobotLink, joint: RobotJoint, mesh_path: MeshPath) -> str:
    """Write a link and the joint that bears it as text, without a root element."""
    return _to_text(_link_element(link, True, mesh_path)) + _to_text(
        _joint_element(joint)
    )


def _to_text(element: Any) -> str:
    """Write an element and what is in it, a line each."""
    etree.indent(element, "  ")
    return str(etree.tostring(element, encoding="unicode")) + "\n"


def _link_element(link: RobotLink, visuals: bool, mesh_path: MeshPath) -> Any:
    """Write a link, with its visual shapes or without."""
    # Each link has an inertia: engines would guess one.
    inertia = link.inertial
    inertial = _element(
        "inertial",
        _origin_element(Origin(inertia.center, inertia.rpy)),
        _element("mass", value=inertia.mass),
        _element("inertia", **dict(zip(MOMENTS, inertia.moments, strict=True))),
    )
    element = _element("link", inertial, name=link.name)

    colors = list(dict.fromkeys(shape.color for shape in link.visuals))
    for shape in link.visuals if visuals else ():
        part = _shape_element("visual", shape, mesh_path)
        if shape.color is not None:
            name = f"{link.name}_color{colors.index(shape.color) or ''}"
            color = _element("color", rgba=shape.color)
            part.append(_element("material", color, name=name))

        element.append(part)

    for shape in link.collisions:
        element.append(_shape_element("collision", shape, mesh_path))

    return element


def _shape_element(tag: str, shape: RobotShape, mesh_path: MeshPath) -> Any:
    """Write a shape that is drawn or that collides, as ``tag`` says."""
    solid = shape.shape
    if isinstance(solid, Path):
        scale = None if shape.scale == ONE else shape.scale
        body = _element("mesh", filename=mesh_path(solid), scale=scale)
    else:
        # They and their lengths are named as in URDF; others are files by now.
        assert isinstance(solid, Primitive)
        body = _element(solid.kind, **solid.sizes)

    origin = _origin_element(shape.origin)
    return _element(tag, origin, _element("geometry", body))


def _joint_element(joint: RobotJoint) -> Any:
    """Write a joint. URDF has no springs; other readers skip our ``<spring>``."""
    element = _element(
        "joint",
        _element("parent", link=joint.parent),
        _element("child", link=joint.child),
        _origin_element(joint.origin),
        name=joint.name,
        type=joint.kind,
    )
    if joint.kind == "fixed":
        return element

    element.append(_element("axis", xyz=joint.axis))
    if joint.limits != Limits():
        element.append(_element("limit", **joint.limits._asdict()))

    element.append(_element("dynamics", damping=joint.damping, friction=joint.friction))
    if joint.mimic is not None:
        element.append(_element("mimic", **joint.mimic._asdict()))
    if joint.spring is not None:
        stiffness, rest = joint.spring
        element.append(_element("spring", stiffness=stiffness, rest=rest))

    return element


def _origin_element(origin: Origin) -> Any:
    return _element("origin", xyz=origin.xyz, rpy=origin.rpy)


def _element(tag: str, /, *children: Any, **values: Any) -> Any:
    """Make an element of texts, numbers and tuples of numbers; what is None is left out."""
    element = etree.Element(tag)

    for name, value in values.items():
        if value is not None:
            element.set(name, _attribute(value))

    element.extend(children)
    return element


def _attribute(value: str | float | tuple[float, ...]) -> str:
    """Write a text, or numbers so that they are read to the last bit."""
    if isinstance(value, str):
        return value
    if isinstance(value, tuple):
        return " ".join(map(_attribute, value))

    text = f"{value:.15g}"
    return text if float(text) == value else repr(float(value))
