"""Build a tool from URDF elements: read links and joints, then hang each box from the component that it touches."""

from __future__ import annotations

import math
import re
from collections.abc import Container, Mapping
from dataclasses import replace
from typing import Literal, NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from core.design import Component, DesignError, Tool, ToolJoint
from core.designs.rules import MAX_COMPONENTS
from core.geometry import Box, Pose
from core.interfaces import Robot
from core.robot.solids import gap
from core.scene import Color
from core.support.text import shorten
from plugins.tools.components import default_mass, parents_first, robot_names
from plugins.tools.urdf.parsing import attribute, only_child, read_numbers, read_origin

MAX_LINKS = 2 * MAX_COMPONENTS  # some are only frames
MAX_NAME = {"link": 64, "joint": 70}  # `core.robot` names a joint after its link, with "_joint" added
DEFAULT_COLOR: Color = (0.2, 0.45, 0.8, 1.0)

_MOVES: dict[str, Literal["hinge", "slider"]] = {"revolute": "hinge", "prismatic": "slider"}
_NAME = re.compile(r"[A-Za-z0-9_.-]+")
_MIN_OPACITY = 0.2  # what collides must be visible


class _Shape(NamedTuple):
    """A box in the frame of its link."""

    box: Box
    pose: Pose
    color: Color


class _Link(NamedTuple):
    shapes: list[_Shape]
    mass: float


class _Joint(NamedTuple):
    parent: str
    child: str
    pose: Pose
    moving: ToolJoint | None  # its axis in the child's frame


class _Holder(NamedTuple):
    """A component or a mount that may bear others: its box (None: a mount), and its link's frame in its own."""

    name: str
    box: Box | None
    frame: Pose


# What a link's children may hang from; and the pose of a link without boxes in the last link that has some.
_Holders = tuple[list[_Holder], Pose | None]


def build_tool(root: Element, gripper: bool, robot: Robot, *, masses: bool = True, loose: bool = False) -> Tool:
    """The tool whose links and joints are the children of ``root``, for ``robot``; ``masses``: read those too.

    Raises:
        DesignError: they are not boxes on joints that lead to a mount, fixed ones or, if ``loose``, hinges and sliders.
    """
    _check_counts(root)
    mounts = Tool(gripper=gripper).mounts
    own, aliases = robot_names(robot), dict(robot.aliases)
    materials = _read_materials(root)
    links: dict[str, _Link] = {}
    joints: dict[str, _Joint] = {}  # by child
    joint_names: set[str] = set()
    for element in root:
        if element.tag == "link":
            name = _check_name(element.get("name"), "link", links, own)
            links[name] = _read_link(element, f"link {name!r}", materials, masses)
        elif element.tag == "joint":
            joint_names.add(_check_name(element.get("name"), "joint", joint_names, own))
            joint = _read_joint(element, f"joint {element.get('name')!r}", aliases, loose)
            if joint.child in joints:
                raise DesignError(f"link {joint.child!r} is the child of two joints; a link has one parent")
            joints[joint.child] = joint
        elif element.tag != "material":
            raise DesignError(f"<{shorten(element.tag)[1:-1]}> is not allowed; use <link>, <joint> and <material>")
    for name in joints.keys() - links.keys():
        raise DesignError(f"a joint's child is {shorten(name)}, which is not a link of the tool")
    for name in links.keys() - joints.keys():
        raise DesignError(f"no joint holds link {name!r}; hang it from {' or '.join(mounts)} or another link")
    components: list[Component] = []
    holders: dict[str, _Holders] = {mount: ([_Holder(mount, None, Pose())], None) for mount in mounts}
    taken = {*links, *own}
    for name in parents_first({name: joints[name].parent for name in links}, mounts, "link"):
        boxes, holders[name] = _hang(name, links[name], joints[name], holders[joints[name].parent], taken)
        components += boxes
    return Tool(tuple(components), gripper)


def _check_name(name: str | None, what: str, taken: Container[str], own: frozenset[str]) -> str:
    if name is None:
        raise DesignError(f"a {what} has no name")
    if not _NAME.fullmatch(name) or len(name) > MAX_NAME[what]:
        raise DesignError(f"{what} name {shorten(name)} is not 1 to {MAX_NAME[what]} letters, digits, '_', '.' or '-'")
    if name in own:
        raise DesignError(f"{what} {name!r} is the robot's own; the block holds only the tool's links and joints")
    if name in taken:
        raise DesignError(f"two {what}s are named {name!r}; each needs a name of its own")
    return name


def _check_counts(root: Element) -> None:
    """Refuse too many links and shapes, before anything compares them with one another."""
    for tag, what, most in (
        ("visual", "boxe", MAX_COMPONENTS),
        ("collision", "boxe", MAX_COMPONENTS),
        ("link", "link", MAX_LINKS),
        ("joint", "joint", MAX_LINKS),
    ):
        if (count := sum(1 for _ in root.iter(tag))) > most:
            raise DesignError(f"the tool has {count} {what}s; at most {most} are allowed")


def _read_materials(root: Element) -> dict[str, Color]:
    """Colours by material name; in URDF a colour given anywhere holds for all uses of the name."""
    colors: dict[str, Color] = {}
    for material in root.iter("material"):
        name, color = material.get("name"), material.find("color")
        if name and color is not None:
            colors.setdefault(name, _read_color(color, f"material {shorten(name)}"))
    return colors


def _read_color(element: Element, where: str) -> Color:
    rgba = read_numbers(attribute(element, "color", "rgba", where), 4, f"{where}: color rgba")
    red, green, blue, opacity = np.clip(rgba, (0.0, 0.0, 0.0, _MIN_OPACITY), 1.0)
    return float(red), float(green), float(blue), float(opacity)


def _read_link(element: Element, where: str, materials: Mapping[str, Color], masses: bool) -> _Link:
    """Read a link: its collision boxes, where there are none its visual ones.

    Where there are as many of both, collision boxes have the colours of the visual ones.
    """
    visuals, shapes = (
        [_read_shape(shape, f"{where}: {tag}", materials) for shape in element.findall(tag)]
        for tag in ("visual", "collision")
    )
    if len(visuals) == len(shapes):
        shapes = [shape._replace(color=visual.color) for shape, visual in zip(shapes, visuals, strict=True)]
    shapes = shapes or visuals
    mass = default_mass(math.fsum(shape.box.volume for shape in shapes)) if shapes else Component.mass
    inertial = only_child(element, "inertial", where) if masses else None
    if inertial is not None:
        value = attribute(only_child(inertial, "mass", where), "mass", "value", f"{where}: inertial")
        (mass,) = read_numbers(value, 1, f"{where}: mass")
    return _Link(shapes, mass)


def _read_shape(element: Element, where: str, materials: Mapping[str, Color]) -> _Shape:
    geometry = only_child(element, "geometry", where)
    shapes = [] if geometry is None else list(geometry)
    if len(shapes) != 1 or shapes[0].tag != "box":
        found = ", ".join(f"<{shorten(shape.tag)[1:-1]}>" for shape in shapes[:3]) or "nothing"
        raise DesignError(f'{where}: boxes only; expected one <geometry><box size="x y z"/>, found {found}')
    text = attribute(shapes[0], "box", "size", where)
    x, y, z = read_numbers(text, 3, f"{where}: box size")
    if min(x, y, z) <= 0:
        raise DesignError(f"{where}: box size is {shorten(text)}; sides must be positive, in metres")
    color, material = DEFAULT_COLOR, only_child(element, "material", where)
    if material is not None:
        inline, named = only_child(material, "color", where), materials.get(material.get("name", ""), DEFAULT_COLOR)
        color = named if inline is None else _read_color(inline, where)
    return _Shape(Box((x, y, z)), read_origin(element, where), color)


def _read_joint(element: Element, where: str, aliases: Mapping[str, str], loose: bool) -> _Joint:
    moves = element.get("type", "")
    if moves != "fixed" and not (loose and moves in _MOVES):
        wanted = 'use type "fixed", "revolute" or "prismatic"' if loose else 'tools are rigid: use type "fixed"'
        raise DesignError(f"{where} is of type {shorten(moves)}; {wanted}")
    parent = attribute(only_child(element, "parent", where), "parent", "link", where)
    child = attribute(only_child(element, "child", where), "child", "link", where)
    moving = _read_moving(element, where) if moves != "fixed" else None
    return _Joint(aliases.get(parent, parent), child, read_origin(element, where), moving)


def _read_moving(element: Element, where: str) -> ToolJoint:
    """Read how a joint moves; its axis is in its own frame."""
    axis, limit = only_child(element, "axis", where), only_child(element, "limit", where)
    way = "1 0 0" if axis is None else attribute(axis, "axis", "xyz", where)
    x, y, z = read_numbers(way, 3, f"{where}: axis")
    texts = {name: attribute(limit, "limit", name, where) for name in ("lower", "upper")}
    for tag, names in (("dynamics", ("damping", "friction")), ("spring", ("stiffness", "rest"))):
        found = only_child(element, tag, where)
        texts |= {name: "0" if found is None else found.get(name, "0") for name in names}
    numbers = {name: read_numbers(text, 1, f"{where}: {name}")[0] for name, text in texts.items()}
    try:
        return ToolJoint(_MOVES[element.get("type", "")], (x, y, z), origin=(0.0, 0.0, 0.0), **numbers)
    except DesignError as error:
        raise DesignError(f"{where}: {error}") from error


def _hang(
    name: str, link: _Link, joint: _Joint, holders: _Holders, taken: set[str]
) -> tuple[list[Component], _Holders]:
    """Make a link's components, and what its children may hang from.

    The first box hangs from the closest box of the parent link, each further box from the closest one before it. A
    link without boxes is only a frame: its children hang from the boxes of its parent.
    """
    parents, frame = holders
    base = joint.pose if frame is None else frame @ joint.pose
    if not link.shapes and joint.moving is not None:
        raise DesignError(f"link {name!r} hangs on a joint that moves, and has no box; give it one")
    if not link.shapes:
        return [], (parents, base)
    volume = math.fsum(shape.box.volume for shape in link.shapes)
    components: list[Component] = []
    own: list[_Holder] = []
    for box, pose, color in link.shapes:
        parent, place = _nearest(own or parents, box, pose if own else base @ pose)
        share = box.volume / volume if volume > 0 else 1 / len(link.shapes)
        part = Component(_free_name(name, taken) if own else name, parent, place, box, link.mass * share, color)
        if joint.moving is not None and not own:
            inverse = pose.inverse()
            (x, y, z), (ax, ay, az) = inverse.position.tolist(), inverse.rotation.apply(joint.moving.axis).tolist()
            part = replace(part, joint=replace(joint.moving, axis=(ax, ay, az), origin=(x, y, z)))
        components.append(part)
        own.append(_Holder(part.name, box, pose.inverse()))
    return components, (own, None)


def _nearest(holders: list[_Holder], box: Box, pose: Pose) -> tuple[str, Pose]:
    """Choose the one closest to a box at a pose in their link's frame, the first of equal ones.

    Return its name, and the pose in its own frame.
    """
    best, least = holders[0], math.inf
    for holder in holders if len(holders) > 1 else ():
        distance = gap(box, holder.frame @ pose, holder.box, Pose()) if holder.box is not None else 0.0
        if distance < least:
            best, least = holder, distance
        if distance == 0:
            break
    return best.name, best.frame @ pose


def _free_name(name: str, taken: set[str]) -> str:
    number = 2
    while (free := f"{name[:58]}_{number}") in taken:
        number += 1
    taken.add(free)
    return free
