"""Read the assembled URDF into what PhysX needs: few links, each with its inertia and shapes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree
from scipy.spatial.transform import Rotation

from core.design import Tool
from core.geometry import Box, Cylinder, Pose, Sphere
from core.robot.description import assemble, merged, read_inertia, read_numbers, read_origin, read_shape
from core.scene import Color, Inertia
from core.values.robots import Robot


@dataclass(frozen=True, eq=False)
class Shape:
    """A collision or visual shape of a link; ``part`` is its link in the URDF.

    A mesh file collides as its convex hull, and is drawn in its own colours.
    """

    shape: Box | Sphere | Cylinder | Path
    pose: Pose
    part: str
    color: Color


@dataclass(frozen=True, eq=False)
class Joint:
    """How a link moves in its parent: along or about the x axis of ``in_parent``.

    At 0 the joint's frame ``in_child`` coincides with it. Limits are in metres or radians, ``effort`` in newtons or
    newton metres.
    """

    name: str
    kind: str  # revolute, or prismatic
    in_parent: Pose
    in_child: Pose
    lower: float
    upper: float
    effort: float


@dataclass(frozen=True, eq=False)
class Link:
    """Rigidly joined links: the parent's number and the joint to it (the base has neither), inertia, and shapes."""

    name: str
    parent: int | None
    joint: Joint | None
    inertia: Inertia
    collisions: tuple[Shape, ...]
    visuals: tuple[Shape, ...]


@lru_cache(maxsize=16)
def robot_links(robot: Robot, tool: Tool) -> tuple[Link, ...]:
    """List the links of the arm with a tool, parents first. Rigidly joined links become one."""
    document: Any = etree.fromstring(assemble(robot, tool, fused=True))
    links = {link.get("name"): link for link in document.findall("link")}
    joints = {joint.find("child").get("link"): joint for joint in document.findall("joint")}
    bearers = {name: _bearer(name, joints) for name in links}
    moving = [name for name in links if bearers[name][0] == name]
    order = sorted(moving, key=lambda name: _depth(name, joints))
    made = []
    for name in order:
        parts = [(part, links[part], pose) for part, (bearer, pose) in bearers.items() if bearer == name]
        collisions, visuals = (
            tuple(shape for part, element, pose in parts for shape in _shapes(part, element.findall(tag), pose))
            for tag in ("collision", "visual")
        )
        parent, joint = None, None
        if name in joints:
            bearer, pose = bearers[joints[name].find("parent").get("link")]
            parent, joint = order.index(bearer), _joint(joints[name], pose)
        inertia = _inertia([(element, pose) for _, element, pose in parts])
        made.append(Link(name, parent, joint, inertia, collisions, visuals))
    return tuple(made)


def place(links: Sequence[Link], joints: Mapping[str, float]) -> list[Pose]:
    """Compute the poses of links in the base for joint values by name; the others are at 0."""
    poses: list[Pose] = []
    for link in links:
        if link.joint is None or link.parent is None:
            poses.append(Pose())
            continue
        value = joints.get(link.joint.name, 0.0)
        along = np.array([value, 0.0, 0.0])
        moved = (
            Pose(along)
            if link.joint.kind == "prismatic"
            else Pose.from_rotation(np.zeros(3), Rotation.from_rotvec(along))
        )
        poses.append(poses[link.parent] @ link.joint.in_parent @ moved @ link.joint.in_child.inverse())
    return poses


def _depth(name: str, joints: dict[str, Any]) -> int:
    """Count the joints from the base to a link."""
    return 1 + _depth(joints[name].find("parent").get("link"), joints) if name in joints else 0


def _bearer(name: str, joints: dict[str, Any]) -> tuple[str, Pose]:
    """Find the moving link (or the base) that a link is rigidly joined to, and the link's pose in it."""
    joint = joints.get(name)
    if joint is None or joint.get("type") != "fixed":
        return name, Pose()
    bearer, pose = _bearer(joint.find("parent").get("link"), joints)
    return bearer, pose @ read_origin(joint)


def _joint(joint: Any, bearer: Pose) -> Joint:
    axis = read_numbers(joint.find("axis"), "xyz")
    turn, _ = Rotation.align_vectors([axis], [[1.0, 0.0, 0.0]])
    in_child = Pose.from_rotation(np.zeros(3), turn)
    lower, upper, effort = (float(joint.find("limit").get(name)) for name in ("lower", "upper", "effort"))
    in_parent = bearer @ read_origin(joint) @ in_child
    return Joint(joint.get("name"), joint.get("type"), in_parent, in_child, lower, upper, effort)


def _inertia(parts: list[tuple[Any, Pose]]) -> Inertia:
    """Compute the inertia of URDF links at these poses, together."""
    inertias = []
    for element, pose in parts:
        inertial = element.find("inertial")
        if inertial is not None and float(inertial.find("mass").get("value")) > 0:
            own, (mass, tensor) = pose @ read_origin(inertial), read_inertia(inertial)
            axes = own.rotation.as_matrix()
            inertias.append((mass, own.position, axes @ tensor @ axes.T))
    if not inertias:  # a base that stands for the ground
        return Inertia(1.0, Pose(), np.ones(3))
    mass, center, whole = merged(inertias)
    moments, axes = np.linalg.eigh(whole)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    return Inertia(mass, Pose.from_rotation(center, Rotation.from_matrix(axes)), moments)


def _shapes(part: str, elements: list[Any], pose: Pose) -> Iterator[Shape]:
    for element in elements:
        at = pose @ read_origin(element)
        color = element.find("material/color")
        r, g, b, a = (0.9, 0.9, 0.9, 1.0) if color is None else read_numbers(color, "rgba")
        yield Shape(read_shape(element.find("geometry")[0]), at, part, (r, g, b, a))
