"""Mount a tool on an arm's description, and write descriptions as URDF text."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Component, Tool, ToolJoint
from core.geometry import Array, Box, Capsule, Cylinder, Pose, Sphere, mass_properties
from core.robot.shape_files import urdf_shapes
from core.values.descriptions import (
    MOMENTS,
    ONE,
    PICOMETRES,
    Description,
    Inertial,
    Limits,
    Origin,
    RobotJoint,
    RobotLink,
    RobotShape,
    Weight,
    rounded,
)
from core.values.robots import Robot

MeshPath = Callable[[Path], str]
BASE = "world_base"  # the root link of an arm that does not stand at the world's origin
RESERVED = (
    RIGID_MOUNT,
    *GRIPPER_MOUNTS,
    BASE,
    f"{RIGID_MOUNT}_joint",
    f"{BASE}_joint",
)  # names of links and joints


@lru_cache(maxsize=16)
def beyond(robot: Robot, tool: Tool) -> frozenset[str]:
    """Name the links that the arm's last joint moves, with those of the tool, as `assembled` for engines."""
    arm = assembled(robot, tool, fused=True)
    last = arm.named[robot.arm_joints[-1]].child
    return frozenset(name for name in arm.links if last in arm.above(name))


def assembled(
    robot: Robot, tool: Tool | None = None, *, fused: bool = False
) -> Description:
    """Mount a tool on the arm.

    A rigid tool replaces the gripper; with a gripper tool the gripper stays. The mount is `core.design.RIGID_MOUNT`, a
    link without mass; the fingers are named as the mounts of a gripper tool. The root is the base, or, if that does not
    stand at the world's origin, `BASE`.

    Args:
        robot: the arm.
        tool: the mounted tool; without components the bare flange, or with ``gripper`` the bare gripper. None: the bare
            gripper, or the bare flange of an arm without one.
        fused: merge the tool's components into the link that bears them (for engines: fewer links, the same physics)
            instead of giving each a link of its own (for people).
    """
    tool = tool if tool is not None else Tool(gripper=robot.gripper is not None)
    arm, gripper, bearer, mount = (
        robot.description,
        robot.gripper,
        robot.mount_link,
        robot.mount,
    )
    if gripper is not None and tool.gripper:
        arm = arm.renamed(dict(zip(gripper.links, GRIPPER_MOUNTS, strict=True)))
        bearer, mount = gripper.link, gripper.mount
    elif gripper is not None:
        arm = arm.without(gripper.link)
    parts = tool_parts(tool)
    if fused:
        parts = (
            (RobotLink(name), _joint(name, parent, pose, joint))
            for name, parent, pose, joint in tool.bearers
        )
    added = [(RobotLink(RIGID_MOUNT), _joint(RIGID_MOUNT, bearer, mount)), *parts]
    if robot.base != Pose():
        added.append(
            (
                RobotLink(BASE),
                RobotJoint(
                    joint_name(BASE), "fixed", BASE, arm.root, Origin.of(robot.base)
                ),
            )
        )
    links = [*arm.links.values(), *(link for link, _ in added)]
    links = [_fused(link, tool) for link in links] if fused else links
    joints = [*arm.joints.values(), *(joint for _, joint in added)]
    return Description(
        arm.name,
        {link.name: link for link in links},
        {joint.child: joint for joint in joints},
    )


def tool_parts(tool: Tool) -> Iterator[tuple[RobotLink, RobotJoint]]:
    """Yield the links of a tool's components, and the joints that bear them."""
    links = {component.name: component.link for component in tool.components}
    for component in tool.components:
        own = component.link.inverse()
        center, tensor = mass_properties(component.shape, component.mass)
        pose = component.pose @ component.link if component.joint else component.pose
        pose = (
            links[component.parent].inverse() @ pose
            if component.parent in links
            else pose
        )
        collisions, visuals = _shapes(component, own)
        inertial = Inertial.of(component.mass, own.apply(center), tensor)
        yield (
            RobotLink(component.name, inertial, collisions, visuals),
            _joint(component.name, component.parent, pose, component.joint),
        )


def joint_name(link: str) -> str:
    """Name the joint that bears a component, or another link that is ours."""
    return f"{link}_joint"


def _joint(
    name: str, parent: str, pose: Pose, moving: ToolJoint | None = None
) -> RobotJoint:
    """Make the joint that bears a link of a tool, or a frame."""
    origin = Origin.of(pose)
    if moving is None:
        return RobotJoint(joint_name(name), "fixed", parent, name, origin)
    numbers = (
        moving.lower,
        moving.upper,
        moving.damping,
        moving.friction,
        moving.stiffness,
        moving.rest,
        *moving.axis,
    )
    lower, upper, damping, friction, stiffness, rest, *axis = (
        rounded(number, PICOMETRES) for number in numbers
    )
    kind, (x, y, z) = {"hinge": "revolute", "slider": "prismatic"}[moving.kind], axis
    limits, spring = (
        Limits(lower, upper, 0.0, 1000.0),
        (stiffness, rest) if moving.stiffness else None,
    )
    return RobotJoint(
        joint_name(name),
        kind,
        parent,
        name,
        origin,
        (x, y, z),
        limits,
        None,
        damping,
        friction,
        spring,
    )


def _shapes(
    component: Component, pose: Pose
) -> tuple[tuple[RobotShape, ...], tuple[RobotShape, ...]]:
    """Make the collision and the visual shapes of a component at a pose in its link."""
    collisions, visuals = (
        tuple(
            RobotShape(shape, Origin.of(pose @ inside if inside else pose), color)
            for whole in shapes
            for inside, shape in urdf_shapes(whole)
        )
        for shapes, color in (
            (component.shape.convex_parts(), None),
            ((component.shape.drawn,), component.color),
        )
    )
    return collisions, visuals


def merged(parts: Sequence[Weight]) -> Weight:
    """Merge the inertias of rigidly joined parts, all in one frame."""
    masses, centers, _ = zip(*parts, strict=True)
    center: Array = np.average(centers, axis=0, weights=masses)
    tensor = np.zeros((3, 3))
    for mass, at, own in parts:
        arm = at - center
        tensor += own + mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return sum(masses), center, tensor


def _fused(link: RobotLink, tool: Tool) -> RobotLink:
    """Merge the components that a link bears into it: many shapes, one inertia."""
    parts = [
        (c, tool.borne[c.name][1])
        for c in tool.components
        if tool.borne[c.name][0] == link.name
    ]
    if not parts:
        return link
    weights = [link.inertial.placed()] if link.inertial.mass > 0 else []
    collisions, visuals = list(link.collisions), list(link.visuals)
    for component, pose in parts:
        turn, (center, tensor) = (
            pose.rotation.as_matrix(),
            mass_properties(component.shape, component.mass),
        )
        weights.append((component.mass, pose.apply(center), turn @ tensor @ turn.T))
        own = _shapes(component, pose)
        collisions += own[0]
        visuals += own[1]
    return RobotLink(
        link.name, Inertial.of(*merged(weights)), tuple(collisions), tuple(visuals)
    )


def assemble(
    robot: Robot,
    tool: Tool | None = None,
    *,
    fused: bool = False,
    visuals: bool = True,
    mesh_path: MeshPath = str,
) -> str:
    """Write the arm with a tool mounted as URDF text; see `assembled` and `write`."""
    return write(
        assembled(robot, tool, fused=fused), visuals=visuals, mesh_path=mesh_path
    )


def write(
    description: Description, *, visuals: bool = True, mesh_path: MeshPath = str
) -> str:
    """Write a description as URDF text.

    Args:
        description: links and joints.
        visuals: include the visual shapes.
        mesh_path: maps a mesh's absolute path to the text that is written.
    """
    root = etree.Element("robot", name=description.name)
    root.extend(
        _link_element(link, visuals, mesh_path) for link in description.links.values()
    )
    root.extend(map(_joint_element, description.joints.values()))
    return _to_text(root)


def tool_urdf(tool: Tool, *, mesh_path: MeshPath = str) -> str:
    """Write the tool's links and joints as text, without a root element.

    A capsule, which URDF lacks, is a cylinder and two spheres. ``mesh_path`` maps a mesh's absolute path to the text
    that is written.
    """
    return "".join(
        _to_text(element)
        for link, joint in tool_parts(tool)
        for element in (_link_element(link, True, mesh_path), _joint_element(joint))
    )


def _to_text(element: Any) -> str:
    etree.indent(element, "  ")
    return str(etree.tostring(element, encoding="unicode")) + "\n"


def _link_element(link: RobotLink, visuals: bool, mesh_path: MeshPath) -> Any:
    element, own = etree.Element("link", name=link.name), link.inertial
    inertial = etree.SubElement(
        element, "inertial"
    )  # of each link: engines would guess one
    _origin(inertial, Origin(own.center, own.rpy))
    etree.SubElement(inertial, "mass", value=_number(own.mass))
    etree.SubElement(
        inertial, "inertia", dict(zip(MOMENTS, map(_number, own.moments), strict=True))
    )
    colors = list(dict.fromkeys(shape.color for shape in link.visuals))
    for tag, shapes in (
        ("visual", link.visuals if visuals else ()),
        ("collision", link.collisions),
    ):
        for shape in shapes:
            part = etree.SubElement(element, tag)
            _origin(part, shape.origin)
            etree.SubElement(part, "geometry").append(_geometry(shape, mesh_path))
            if shape.color is not None and tag == "visual":
                name = f"{link.name}_color{colors.index(shape.color) or ''}"
                material = etree.SubElement(part, "material", name=name)
                etree.SubElement(material, "color", rgba=_numbers(shape.color))
    return element


def _geometry(shape: RobotShape, mesh_path: MeshPath) -> Any:
    match shape.shape:
        case Box(size):
            return etree.Element("box", size=_numbers(size))
        case Sphere(radius):
            return etree.Element("sphere", radius=_number(radius))
        case Cylinder(radius, length):
            return etree.Element(
                "cylinder", radius=_number(radius), length=_number(length)
            )
        case Capsule(radius, length):
            return etree.Element(
                "capsule", radius=_number(radius), length=_number(length)
            )
        case Path() as file:
            scale = {"scale": _numbers(shape.scale)} if shape.scale != ONE else {}
            return etree.Element("mesh", {"filename": mesh_path(file)} | scale)


def _joint_element(joint: RobotJoint) -> Any:
    """Write a joint. URDF has no springs; other readers skip our ``<spring>``."""
    element = etree.Element("joint", name=joint.name, type=joint.kind)
    etree.SubElement(element, "parent", link=joint.parent)
    etree.SubElement(element, "child", link=joint.child)
    _origin(element, joint.origin)
    if joint.kind == "fixed":
        return element
    etree.SubElement(element, "axis", xyz=_numbers(joint.axis))
    if limits := {
        name: _number(value)
        for name, value in joint.limits._asdict().items()
        if value is not None
    }:
        etree.SubElement(element, "limit", limits)
    etree.SubElement(
        element,
        "dynamics",
        damping=_number(joint.damping),
        friction=_number(joint.friction),
    )
    if joint.mimic is not None:
        name, multiplier, offset = joint.mimic
        etree.SubElement(
            element,
            "mimic",
            joint=name,
            multiplier=_number(multiplier),
            offset=_number(offset),
        )
    if joint.spring is not None:
        stiffness, rest = map(_number, joint.spring)
        etree.SubElement(element, "spring", stiffness=stiffness, rest=rest)
    return element


def _origin(parent: Any, origin: Origin) -> None:
    etree.SubElement(
        parent, "origin", xyz=_numbers(origin.xyz), rpy=_numbers(origin.rpy)
    )


def _numbers(values: Iterable[float]) -> str:
    return " ".join(map(_number, values))


def _number(value: float) -> str:
    """Write a number so that it is read to the last bit."""
    text = f"{value:.15g}"
    return text if float(text) == value else repr(float(value))
