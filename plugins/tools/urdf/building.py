"""Build a tool from URDF elements: read links and joints, then hang each box from the component that it touches."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal
from xml.etree.ElementTree import Element

import numpy as np

from core.design import Component, DesignError, Tool, ToolJoint
from core.designs.components import robot_names
from core.designs.rules import MAX_COMPONENTS, MAX_DENSITY, MIN_DENSITY
from core.geometry import Box, Capsule, Cylinder, Pose, Shape, Sphere
from core.interfaces import Robot
from core.robot.solids import gap as gap_between
from core.scene import Color
from core.support.text import shorten
from plugins.tools.urdf.parsing import attribute, only_child, read_numbers, read_origin

MAX_LINKS = 2 * MAX_COMPONENTS  # some are only frames
MAX_NAME = {"link": 64, "joint": 70}  # `core.robot` names a joint after its link, with "_joint" added
DEFAULT_COLOR: Color = (0.2, 0.45, 0.8, 1.0)

# How each shape is written, and how many numbers each of its attributes has.
SHAPES = {
    "box": ('box size="x y z"', {"size": 3}),
    "cylinder": ('cylinder radius="r" length="l"', {"radius": 1, "length": 1}),
    "sphere": ('sphere radius="r"', {"radius": 1}),
    "capsule": ('capsule radius="r" length="l"', {"radius": 1, "length": 1}),
}

_MOVES: dict[str, Literal["hinge", "slider"]] = {"revolute": "hinge", "prismatic": "slider"}
_NAME = re.compile(r"[A-Za-z0-9_.-]+")
_MIN_OPACITY = 0.2  # what collides must be visible
_LINK_KG = 0.005
_SAME_M = 0.0005
_SAME_RAD = 0.01


@dataclass(frozen=True)
class _PlacedShape:
    """A shape in the frame of its link."""

    shape: Shape
    pose: Pose
    color: Color


@dataclass(frozen=True)
class _ComponentLink:
    name: str
    shapes: tuple[_PlacedShape, ...]
    mass: float


@dataclass(frozen=True)
class _ComponentJoint:
    parent: str
    child: str
    pose: Pose
    moving: ToolJoint | None = None  # its axis in the link's frame


# What a link's children can hang from, components or a mount: for each its name, its shape (None: a mount), and the
# pose of the link's frame in its own frame.
_Parents = list[tuple[str, Shape | None, Pose]]
# The same, and the pose of a link without shapes in the frame of the last link with shapes; None: it has its own.
_Holders = tuple[_Parents, Pose | None]


def _nearest(parents: _Parents, shape: Shape, pose: Pose) -> tuple[str, Pose]:
    """The component closest to ``shape``, the first of equal ones, and the shape's pose in that component's frame.

    ``pose`` is the pose of the shape in the link's frame.
    """
    closest, least = parents[0], math.inf
    for parent in parents if len(parents) > 1 else ():
        _, own, frame = parent
        gap = gap_between(shape, frame @ pose, own, Pose()) if own else 0.0
        if gap < least:
            closest, least = parent, gap
        if gap == 0:
            break
    name, _, frame = closest
    return name, frame @ pose


def _check_name(name: str | None, what: str, taken: Mapping[str, object] | set[str], own: frozenset[str]) -> str:
    if name is None:
        raise DesignError(f"a {what} has no name")
    if not _NAME.fullmatch(name) or len(name) > MAX_NAME[what]:
        raise DesignError(f"{what} name {shorten(name)} is not 1 to {MAX_NAME[what]} letters, digits, '_', '.' or '-'")
    if name in own:
        raise DesignError(f"{what} {name!r} is the robot's own; the block holds only the tool's links and joints")
    if name in taken:
        raise DesignError(f"two {what}s are named {name!r}; each needs a name of its own")
    return name


def build_tool(
    root: Element,
    gripper: bool,
    robot: Robot | None = None,
    shapes: tuple[str, ...] = ("box",),
    *,
    masses: bool = True,
    loose: bool = False,
) -> Tool:
    """The tool whose links and joints are the children of ``root``, for ``robot``; ``masses``: read those too.

    Raises:
        DesignError: they are not ``shapes`` on joints that lead to a mount, fixed ones or, if ``loose``, hinges and
            sliders.
    """
    _check_counts(root)
    mounts = Tool(gripper=gripper).mounts
    own, aliases = robot_names(robot), dict(robot.aliases) if robot is not None else {}
    materials = _read_materials(root)
    links: dict[str, _ComponentLink] = {}
    joints: dict[str, _ComponentJoint] = {}  # by child
    joint_names: set[str] = set()
    for element in root:
        if element.tag == "link":
            name = _check_name(element.get("name"), "link", links, own)
            links[name] = _read_link(element, name, materials, shapes, masses)
        elif element.tag == "joint":
            joint_names.add(_check_name(element.get("name"), "joint", joint_names, own))
            joint = _read_joint(element, f"joint {element.get('name')!r}", aliases, loose)
            if joint.child in joints:
                raise DesignError(f"link {joint.child!r} is the child of two joints; a link has one parent")
            joints[joint.child] = joint
        elif element.tag != "material":
            raise DesignError(f"<{shorten(element.tag)[1:-1]}> is not allowed; use <link>, <joint> and <material>")
    _check_joints(joints, links, mounts)
    components: list[Component] = []
    holders: dict[str, _Holders] = {mount: ([(mount, None, Pose())], None) for mount in mounts}
    taken = {*links, *own}
    for name, joint in _from_mounts(links, joints, mounts):
        boxes, holders[name] = _hang(links[name], holders[joint.parent], joint.pose, taken)
        components += boxes if joint.moving is None else [_moving(name, boxes, joint.moving, links), *boxes[1:]]
    return Tool(tuple(components), gripper)


def _check_counts(root: Element) -> None:
    """Refuse too many links and shapes, before anything compares them with one another."""
    counts = {tag: sum(1 for _ in root.iter(tag)) for tag in ("link", "joint", "visual", "collision")}
    if (boxes := max(counts["visual"], counts["collision"])) > MAX_COMPONENTS:
        raise DesignError(f"the tool has {boxes} boxes; at most {MAX_COMPONENTS} are allowed")
    for tag in ("link", "joint"):
        if counts[tag] > MAX_LINKS:
            raise DesignError(f"the tool has {counts[tag]} {tag}s; at most {MAX_LINKS} are allowed")


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


def _read_link(
    element: Element, name: str, materials: Mapping[str, Color], allowed: tuple[str, ...], masses: bool
) -> _ComponentLink:
    where = f"link {name!r}"
    visuals = [_read_shape(shape, f"{where}: visual", materials, allowed) for shape in element.findall("visual")]
    collisions = [
        _read_shape(shape, f"{where}: collision", materials, allowed) for shape in element.findall("collision")
    ]
    boxes = _match(visuals, collisions, where) if visuals and collisions else collisions or visuals
    inertial = only_child(element, "inertial", where) if masses else None
    volume = math.fsum(placed.shape.volume for placed in boxes)
    mass = min(max(_LINK_KG, MIN_DENSITY * volume), MAX_DENSITY * volume) if boxes else _LINK_KG
    if inertial is not None:
        value = attribute(only_child(inertial, "mass", where), "mass", "value", f"{where}: inertial")
        (mass,) = read_numbers(value, 1, f"{where}: mass")
    return _ComponentLink(name, tuple(boxes), mass)


def _read_shape(element: Element, where: str, materials: Mapping[str, Color], allowed: tuple[str, ...]) -> _PlacedShape:
    geometry = only_child(element, "geometry", where)
    shapes = [] if geometry is None else list(geometry)
    if len(shapes) != 1 or shapes[0].tag not in allowed:
        found = ", ".join(f"<{shorten(shape.tag)[1:-1]}>" for shape in shapes[:3]) or "nothing"
        wanted = " or ".join(f"<{SHAPES[name][0]}/>" for name in allowed)
        only = "boxes only; " if allowed == ("box",) else ""
        raise DesignError(f"{where}: {only}expected one <geometry>{wanted}, found {found}")
    name, sizes = shapes[0].tag, list[float]()
    for key, count in SHAPES[name][1].items():
        text = attribute(shapes[0], name, key, where)
        sizes += read_numbers(text, count, f"{where}: {name} {key}")
        if min(sizes) <= 0:
            what = "sides" if name == "box" else "sizes"
            raise DesignError(f"{where}: {name} {key} is {shorten(text)}; {what} must be positive, in metres")
    kinds: dict[str, Callable[..., Shape]] = {"cylinder": Cylinder, "sphere": Sphere, "capsule": Capsule}
    shape: Shape = Box((sizes[0], sizes[1], sizes[2])) if name == "box" else kinds[name](*sizes)
    color, material = DEFAULT_COLOR, only_child(element, "material", where)
    if material is not None:
        inline, named = only_child(material, "color", where), materials.get(material.get("name", ""), DEFAULT_COLOR)
        color = named if inline is None else _read_color(inline, where)
    return _PlacedShape(shape, read_origin(element, where), color)


def _match(visuals: list[_PlacedShape], collisions: list[_PlacedShape], where: str) -> list[_PlacedShape]:
    """The collision boxes, each in the colour of the visual box at the same place."""
    sizes, positions = np.array([v.shape.bounds[1] for v in visuals]), np.array([v.pose.position for v in visuals])
    quaternions = np.array([v.pose.quaternion for v in visuals])
    free = np.ones(len(visuals), dtype=bool)
    matched = []
    for collision in collisions:
        chords = [np.linalg.norm(quaternions - sign * collision.pose.quaternion, axis=1) for sign in (1, -1)]
        same = free & (np.abs(sizes - collision.shape.bounds[1]).max(axis=1) <= _SAME_M)
        same &= np.array([type(visual.shape) is type(collision.shape) for visual in visuals])
        same &= np.linalg.norm(positions - collision.pose.position, axis=1) <= _SAME_M
        same &= 4 * np.arcsin(np.minimum(*chords) / 2) <= _SAME_RAD
        if same.any():
            twin = int(np.argmax(same))
            free[twin] = False
            matched.append(_PlacedShape(collision.shape, collision.pose, visuals[twin].color))
    if free.any() or len(matched) < len(collisions):
        raise DesignError(f"{where}: its visual and collision boxes differ; give both the same origins and sizes")
    return matched


def _read_joint(element: Element, where: str, aliases: Mapping[str, str], loose: bool) -> _ComponentJoint:
    moves = element.get("type", "")
    if moves != "fixed" and not (loose and moves in _MOVES):
        wanted = 'use type "fixed", "revolute" or "prismatic"' if loose else 'tools are rigid: use type "fixed"'
        raise DesignError(f"{where} is of type {shorten(moves)}; {wanted}")
    parent = attribute(only_child(element, "parent", where), "parent", "link", where)
    child = attribute(only_child(element, "child", where), "child", "link", where)
    moving = _read_moving(element, where) if moves != "fixed" else None
    return _ComponentJoint(aliases.get(parent, parent), child, read_origin(element, where), moving)


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


def _moving(name: str, boxes: Sequence[Component], joint: ToolJoint, links: Mapping[str, _ComponentLink]) -> Component:
    """The first box of a link, with the link's joint in the box's own frame."""
    if not boxes:
        raise DesignError(f"link {name!r} hangs on a joint that moves, and has no box; give it one")
    own = links[name].shapes[0].pose.inverse()
    (x, y, z), (ax, ay, az) = own.position.tolist(), own.rotation.apply(joint.axis).tolist()
    return replace(boxes[0], joint=replace(joint, axis=(ax, ay, az), origin=(x, y, z)))


def _check_joints(
    joints: Mapping[str, _ComponentJoint], links: Mapping[str, _ComponentLink], mounts: tuple[str, ...]
) -> None:
    for joint in joints.values():
        if joint.child not in links:
            raise DesignError(f"a joint's child is {shorten(joint.child)}, which is not a link of the tool")
        if joint.parent not in links and joint.parent not in mounts:
            raise DesignError(
                f"link {joint.child!r} hangs from {shorten(joint.parent)}, which is neither a link of the tool "
                f"nor its mount ({' or '.join(mounts)})"
            )


def _from_mounts(
    links: Mapping[str, _ComponentLink], joints: Mapping[str, _ComponentJoint], mounts: tuple[str, ...]
) -> Iterator[tuple[str, _ComponentJoint]]:
    """Yield links with the joint that bears them, parents first, otherwise in the order of the text."""
    done = set(mounts)
    for start in links:
        chain: dict[str, _ComponentJoint] = {}
        name = start
        while name not in done:
            if name in chain:
                raise DesignError(f"joints lead from {name!r} in a circle; hang the tool from {' or '.join(mounts)}")
            if name not in joints:
                raise DesignError(f"no joint holds link {name!r}; hang it from {' or '.join(mounts)} or another link")
            chain[name] = joints[name]
            name = joints[name].parent
        for name, joint in reversed(chain.items()):
            done.add(name)
            yield name, joint


def _hang(link: _ComponentLink, holders: _Holders, pose: Pose, taken: set[str]) -> tuple[list[Component], _Holders]:
    """A link's components, and what holds its children. ``pose`` is the pose of the link in its parent link.

    The first box hangs from the closest box of the parent link, each further box from the closest one before it. A
    link without boxes is only a frame: its children hang from the boxes of its parent.
    """
    parents, frame = holders
    pose = pose if frame is None else frame @ pose
    if not link.shapes:
        return [], (parents, pose)
    volume = math.fsum(placed.shape.volume for placed in link.shapes)
    components: list[Component] = []
    own: _Parents = []
    for placed in link.shapes:
        name = _free_name(link.name, taken) if own else link.name
        parent, at = _nearest(own or parents, placed.shape, placed.pose if own else pose @ placed.pose)
        share = placed.shape.volume / volume if volume > 0 else 1 / len(link.shapes)
        components.append(Component(name, parent, at, placed.shape, link.mass * share, placed.color))
        own.append((name, placed.shape, placed.pose.inverse()))
    return components, (own, None)


def _free_name(name: str, taken: set[str]) -> str:
    number = 2
    while (free := f"{name[:58]}_{number}") in taken:
        number += 1
    taken.add(free)
    return free
