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
from core.geometry import Array, Box, Cylinder, Pose, Sphere
from core.robot.description import assemble
from core.scene import Color, Inertia


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
def robot(tool: Tool) -> tuple[Link, ...]:
    """List the links of the arm with a tool, parents first. Rigidly joined links become one."""
    document: Any = etree.fromstring(assemble(tool, fused=True))
    texts = {link.get("name"): etree.tostring(link) for link in document.findall("link")}
    joints = b"".join(etree.tostring(joint) for joint in document.findall("joint"))
    skeleton = _skeleton(joints, tuple(texts))
    return tuple(
        _link(name, skeleton, b"".join(texts[part] for part in skeleton.parts(name))) for name in skeleton.order
    )


@dataclass(frozen=True, eq=False)
class _Skeleton:
    """The structure of the links.

    ``joints`` are by the child's name; ``bearers`` give the moving link (or the base) that each link is rigidly joined
    to, with its pose there; ``order`` lists the moving ones, parents first.
    """

    joints: dict[str, Any]
    bearers: dict[str, tuple[str, Pose]]
    order: tuple[str, ...]

    def parts(self, name: str) -> list[str]:
        return [part for part, (bearer, _) in self.bearers.items() if bearer == name]


@lru_cache(maxsize=4)
def _skeleton(joints: bytes, names: tuple[str, ...]) -> _Skeleton:
    """Read the structure from the joints and the names of the links; mostly the same for all tools."""
    elements = {joint.find("child").get("link"): joint for joint in _elements(joints)}
    bearers = {name: _bearer(name, elements) for name in names}
    moving = [name for name in names if bearers[name][0] == name]
    return _Skeleton(elements, bearers, tuple(sorted(moving, key=lambda name: _depth(name, elements))))


def _elements(text: bytes) -> list[Any]:
    return list(etree.fromstring(b"<robot>" + text + b"</robot>"))


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
    return bearer, pose @ _origin(joint)


@lru_cache(maxsize=64)
def _link(name: str, skeleton: _Skeleton, links: bytes) -> Link:
    """Merge a moving link with those rigidly joined to it. Most results are the same for all tools."""
    joints, bearers = skeleton.joints, skeleton.bearers
    parts = [(element.get("name"), element, bearers[element.get("name")][1]) for element in _elements(links)]
    inertia = _inertia([(element, pose) for _, element, pose in parts])
    collisions, visuals = (
        tuple(shape for part, element, pose in parts for shape in _shapes(part, element.findall(tag), pose))
        for tag in ("collision", "visual")
    )
    if name not in joints:
        return Link(name, None, None, inertia, collisions, visuals)
    parent, pose = bearers[joints[name].find("parent").get("link")]
    return Link(name, skeleton.order.index(parent), _joint(joints[name], pose), inertia, collisions, visuals)


def _joint(joint: Any, bearer: Pose) -> Joint:
    axis = _numbers(joint.find("axis"), "xyz")
    turn, _ = Rotation.align_vectors([axis], [[1.0, 0.0, 0.0]])
    in_child = Pose.from_rotation(np.zeros(3), turn)
    lower, upper, effort = (float(joint.find("limit").get(name)) for name in ("lower", "upper", "effort"))
    in_parent = bearer @ _origin(joint) @ in_child
    return Joint(joint.get("name"), joint.get("type"), in_parent, in_child, lower, upper, effort)


def _inertia(parts: list[tuple[Any, Pose]]) -> Inertia:
    """Compute the inertia of URDF links at these poses, together."""
    masses, centers, tensors = [], [], []
    for element, pose in parts:
        inertial = element.find("inertial")
        mass = float(inertial.find("mass").get("value"))
        if mass > 0:
            own = pose @ _origin(inertial)
            axes = own.rotation.as_matrix()
            names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
            xx, xy, xz, yy, yz, zz = (float(inertial.find("inertia").get(name)) for name in names)
            masses.append(mass)
            centers.append(own.position)
            tensors.append(axes @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ axes.T)
    center: Array = np.average(centers, axis=0, weights=masses)
    whole = np.zeros((3, 3))
    for mass, at, tensor in zip(masses, centers, tensors, strict=True):
        arm = at - center
        whole += tensor + mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    moments, axes = np.linalg.eigh(whole)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    return Inertia(sum(masses), Pose.from_rotation(center, Rotation.from_matrix(axes)), moments)


def _shapes(part: str, elements: list[Any], pose: Pose) -> Iterator[Shape]:
    for element in elements:
        at = pose @ _origin(element)
        color = element.find("material/color")
        r, g, b, a = (0.9, 0.9, 0.9, 1.0) if color is None else _numbers(color, "rgba")
        yield Shape(_geometry(element.find("geometry")[0]), at, part, (r, g, b, a))


def _geometry(element: Any) -> Box | Sphere | Cylinder | Path:
    match element.tag:
        case "box":
            x, y, z = _numbers(element, "size")
            return Box((x, y, z))
        case "sphere":
            return Sphere(float(element.get("radius")))
        case "cylinder":
            return Cylinder(float(element.get("radius")), float(element.get("length")))
        case _:
            return Path(element.get("filename"))


def _origin(element: Any) -> Pose:
    origin = element.find("origin")
    return Pose() if origin is None else Pose.xyz_rpy(_numbers(origin, "xyz"), _numbers(origin, "rpy"))


def _numbers(element: Any, name: str) -> Array:
    return np.array([float(number) for number in element.get(name, "0 0 0").split()])
