"""The arm with its tool as PhysX needs it: few links, each with its inertia and its shapes, from the assembled URDF."""

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
    """What is felt or seen on a link; ``part`` is the link of the URDF that it belongs to. A mesh file is felt as its
    convex hull, and seen in colours of its own.
    """

    shape: Box | Sphere | Cylinder | Path
    pose: Pose
    part: str
    color: Color


@dataclass(frozen=True, eq=False)
class Joint:
    """How a link moves in its parent: along or about the x axis of ``in_parent``, which is ``in_child`` where the joint
    is at 0. Limits in metres or radians, ``effort`` in newtons or newton metres.
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
    """What moves as one: the number of its parent and the joint to it (the base has neither), inertia, and shapes to be
    felt and to be seen.
    """

    name: str
    parent: int | None
    joint: Joint | None
    inertia: Inertia
    collisions: tuple[Shape, ...]
    visuals: tuple[Shape, ...]


@lru_cache(maxsize=16)
def robot(tool: Tool) -> tuple[Link, ...]:
    """The arm with a tool. Links that are joined rigidly are one; parents stand before their children."""
    document: Any = etree.fromstring(assemble(tool, fused=True))
    texts = {link.get("name"): etree.tostring(link) for link in document.findall("link")}
    joints = b"".join(etree.tostring(joint) for joint in document.findall("joint"))
    skeleton = _skeleton(joints, tuple(texts))
    return tuple(
        _link(name, skeleton, b"".join(texts[part] for part in skeleton.parts(name))) for name in skeleton.order
    )


@dataclass(frozen=True, eq=False)
class _Skeleton:
    """How links hang together: the joint to each by its child's name; the moving link (or the base) that each is joined
    to rigidly, with its pose there; and the moving ones, parents first.
    """

    joints: dict[str, Any]
    bearers: dict[str, tuple[str, Pose]]
    order: tuple[str, ...]

    def parts(self, name: str) -> list[str]:
        return [part for part, (bearer, _) in self.bearers.items() if bearer == name]


@lru_cache(maxsize=4)
def _skeleton(joints: bytes, names: tuple[str, ...]) -> _Skeleton:
    """Of a document's joints and the names of its links: the same for all tools, mostly."""
    elements = {joint.find("child").get("link"): joint for joint in _elements(joints)}
    bearers = {name: _bearer(name, elements) for name in names}
    moving = [name for name in names if bearers[name][0] == name]
    return _Skeleton(elements, bearers, tuple(sorted(moving, key=lambda name: _depth(name, elements))))


def _elements(text: bytes) -> list[Any]:
    return list(etree.fromstring(b"<robot>" + text + b"</robot>"))


def place(links: Sequence[Link], joints: Mapping[str, float]) -> list[Pose]:
    """Where links are, in the base, with joints (by name; the others are at 0) like this."""
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
    """How many joints there are from the base to a link."""
    return 1 + _depth(joints[name].find("parent").get("link"), joints) if name in joints else 0


def _bearer(name: str, joints: dict[str, Any]) -> tuple[str, Pose]:
    """The moving link (or the base) that a link is joined to rigidly, and the link's pose in it."""
    joint = joints.get(name)
    if joint is None or joint.get("type") != "fixed":
        return name, Pose()
    bearer, pose = _bearer(joint.find("parent").get("link"), joints)
    return bearer, pose @ _origin(joint)


@lru_cache(maxsize=64)
def _link(name: str, skeleton: _Skeleton, links: bytes) -> Link:
    """Of a moving link and what is joined to it. Most are the same whatever the tool."""
    joints, bearers = skeleton.joints, skeleton.bearers
    parts = [(element.get("name"), element, bearers[element.get("name")][1]) for element in _elements(links)]
    inertia = _inertia([(element, pose) for _, element, pose in parts])
    felt, seen = (
        tuple(shape for part, element, pose in parts for shape in _shapes(part, element.findall(tag), pose))
        for tag in ("collision", "visual")
    )
    if name not in joints:
        return Link(name, None, None, inertia, felt, seen)
    parent, pose = bearers[joints[name].find("parent").get("link")]
    return Link(name, skeleton.order.index(parent), _joint(joints[name], pose), inertia, felt, seen)


def _joint(joint: Any, bearer: Pose) -> Joint:
    axis = _numbers(joint.find("axis"), "xyz")
    turn, _ = Rotation.align_vectors([axis], [[1.0, 0.0, 0.0]])
    in_child = Pose.from_rotation(np.zeros(3), turn)
    lower, upper, effort = (float(joint.find("limit").get(name)) for name in ("lower", "upper", "effort"))
    in_parent = bearer @ _origin(joint) @ in_child
    return Joint(joint.get("name"), joint.get("type"), in_parent, in_child, lower, upper, effort)


def _inertia(parts: list[tuple[Any, Pose]]) -> Inertia:
    """Of URDF links together, which are at these poses."""
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
