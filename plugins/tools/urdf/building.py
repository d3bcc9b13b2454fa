"""Build a tool from URDF: read links and joints as a robot's are, then hang each box from the one that it touches.

A model wrote the text, so it is untrusted: DTD and entities are refused, and length and number of elements limited.
"""

from __future__ import annotations

import html
import math
import re
from collections import Counter
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Literal, NamedTuple
from xml.etree.ElementTree import Element, SubElement

from core.design import Component, DesignError, Tool, ToolJoint
from core.designs.rules import MAX_COMPONENTS
from core.errors import UserError
from core.geometry import Box, Pose
from core.imports.documents import read_xml
from core.imports.urdf import read_tree
from core.interfaces import Robot
from core.robot.solids import Solid, signed_distance, solid_geometry
from core.scene import Color
from core.support.inputs import check
from core.support.text import shorten
from core.values.descriptions import RobotJoint, RobotLink
from plugins.tools.components import (
    Angle,
    default_mass,
    parents_first,
    robot_names,
)
from plugins.tools.refusals import ToolReason

MAX_CHARACTERS = 1_000_000
MAX_LINKS = 2 * MAX_COMPONENTS  # some are only frames
# `core.robot` names a joint after its link, with "_joint" added.
MAX_NAME = {"link": 64, "joint": 70}
MAX_COUNT = {
    "visual": MAX_COMPONENTS,
    "collision": MAX_COMPONENTS,
    "link": MAX_LINKS,
    "joint": MAX_LINKS,
}
DEFAULT_COLOR: Color = (0.2, 0.45, 0.8, 1.0)

_MOVES: dict[str, Literal["hinge", "slider"]] = {
    "revolute": "hinge",
    "prismatic": "slider",
}
_NAME = re.compile(r"[A-Za-z0-9_.-]+")
_ANGLE = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,3})?")
_CDATA = re.compile(r"<!\[CDATA\[(.*?)\]\]>", re.DOTALL)
# Numbers with a comma and a space between them, or three with commas alone; else a comma may be a decimal point.
_VECTOR = re.compile(
    r"""\b(?:size|xyz|rpy|rgba)\s*=\s*(["'])(?:(?:[^"',]++,\s++)++[^"',]++|(?:[^"',\s]++,){2}[^"',\s]++)\1"""
)
_DECLARATION = re.compile(r"\A\s*<\?xml[^>]*\?>")
# What an element may have several of.
_MANY = ("link", "joint", "material", "collision", "visual")
_MIN_OPACITY = 0.2  # what collides must be visible


class _Shape(NamedTuple):
    """A box in the frame of its link."""

    box: Box
    pose: Pose
    color: Color


class _Holder(NamedTuple):
    """A component or a mount that may bear others: its box (None: a mount), and its link's frame in its own."""

    name: str
    box: Box | None
    frame: Pose


# What a link's children may hang from; and the pose of a link without boxes in the last link that has some.
_Holders = tuple[list[_Holder], Pose | None]


def build_tool(
    text: str,
    gripper: bool,
    robot: Robot,
    *,
    masses: bool = True,
    loose: bool = False,
) -> Tool:
    """Build the tool whose links and joints are in a text.

    Args:
        text: the links and joints, perhaps within a ``<robot>``.
        gripper: whether the tool hangs from the fingers.
        robot: what bears it.
        masses: read the links' masses; else they are the usual ones.
        loose: joints may move.

    Raises:
        DesignError: they are not boxes on joints that lead to a mount, fixed ones or, if ``loose``, hinges and sliders.
    """
    mounts = Tool(gripper=gripper).mounts
    reserved = robot_names(robot)
    root = _parse(text)
    names = _check(root, reserved, " or ".join(mounts))

    if not masses:
        for link in root.iterfind("link"):
            for inertial in link.findall("inertial"):
                link.remove(inertial)

    weighed = {link.get("name") for link in root.iterfind("link[inertial]")}
    aliases = {alias: mount for alias, mount in robot.aliases if mount in mounts}

    for end in root.iterfind("joint/parent"):
        link_name = end.get("link", "")
        end.set("link", aliases.get(link_name, link_name))

    _add_mounts(root, mounts)

    try:
        tree = read_tree(root)
    except UserError as error:
        raise DesignError(str(error)) from error

    _check_turns(root)

    components: list[Component] = []
    holders: dict[str, _Holders] = {
        mount: ([_Holder(mount, None, Pose())], None) for mount in mounts
    }
    taken = {*names, *reserved}

    parents = {name: tree.joints[name].parent for name in names}

    for name in parents_first(parents, mounts, "link"):
        held = tree.links[name]
        joint = tree.joints[name]
        shapes = _boxes(held)
        mass = held.inertial.mass

        if name not in weighed:
            mass = default_mass(math.fsum(shape.box.volume for shape in shapes))

        moving = _moving(joint, loose)
        boxes, holders[name] = _hang(
            name, shapes, mass, joint.origin.pose, moving, holders[parents[name]], taken
        )
        components += boxes

    return Tool(tuple(components), gripper)


def _add_mounts(root: Element, mounts: tuple[str, ...]) -> None:
    """Add links for the mounts; all hang from the first: a description has one base."""
    first, *others = mounts
    SubElement(root, "link", name=first)

    for name in others:
        SubElement(root, "link", name=name)
        joint = SubElement(root, "joint", name=f"to {name}", type="fixed")
        SubElement(joint, "parent", link=first)
        SubElement(joint, "child", link=name)


def _parse(text: str) -> Element:
    """Parse the text; the children of what is returned are the tool's elements."""
    if len(text) > MAX_CHARACTERS:
        raise DesignError.because(
            ToolReason.FIELD_LENGTH,
            field="tool_urdf",
            count=len(text),
            most=MAX_CHARACTERS,
        )

    block = _DECLARATION.sub("", _unescape(text))

    try:
        root = read_xml(
            f"<robot>{block}\n</robot>".encode(errors="surrogatepass"),
            Path("tool_urdf"),
        )
    except UserError as error:
        raise DesignError(str(error)) from error

    if len(root) == 1 and root[0].tag == "robot":
        return root[0]

    return root


def _unescape(text: str) -> str:
    """Undo what was escaped once too often, or set apart: ``&lt;link name=...``, ``<link name=\\"...``, CDATA.

    Commas between the numbers of a vector are left out, too.
    """
    if "&lt;link" in text or "=&quot;" in text:
        text = html.unescape(text)

    text = _CDATA.sub(r"\1", text).replace('\\"', '"')
    return _VECTOR.sub(lambda found: found[0].replace(",", " "), text)


def _check(
    root: Element,
    reserved: frozenset[str],
    mounts: str,
) -> list[str]:
    """Refuse what can't be in a tool, before anything is compared with all others; list the names of the links."""
    links = []

    for element in root:
        tag = element.tag
        if tag not in ("link", "joint", "material"):
            raise DesignError.because(ToolReason.TAG, tag=shorten(tag)[1:-1])

        name = element.get("name", "")
        if tag == "link":
            links.append(name)

        if tag in MAX_NAME:
            _check_name(tag, name, reserved)

    for tag, most in MAX_COUNT.items():
        found = sum(1 for _ in root.iter(tag))
        if found > most:
            raise DesignError.because(
                ToolReason.TAG_COUNT, count=found, tag=tag, most=most
            )

    for element in root.iter():
        tags = Counter(child.tag for child in element if child.tag not in _MANY)
        for tag, found in tags.items():
            if found > 1:
                raise DesignError.because(
                    ToolReason.TAG_TWICE, within=element.tag, count=found, tag=tag
                )

    held = {child.get("link") for child in root.iterfind("joint/child")}

    for name in links:
        if name not in held:
            raise DesignError.because(ToolReason.LINK_LOOSE, name=name, mounts=mounts)

    return links


def _check_turns(root: Element) -> None:
    """Refuse angles that look like degrees."""
    for element in root:
        where = f"{element.tag} {element.get('name', '')!r}: rpy"
        for origin in element.iter("origin"):
            for angle in _ANGLE.findall(origin.get("rpy", "")):
                check(Angle, float(angle), where, DesignError)


def _check_name(
    tag: str,
    name: str,
    reserved: frozenset[str],
) -> None:
    """Refuse the name of a link or joint that a robot's description could not hold, or that is the robot's."""
    most = MAX_NAME[tag]
    if not _NAME.fullmatch(name) or len(name) > most:
        raise DesignError.because(
            ToolReason.LINK_NAME, tag=tag, name=shorten(name), most=most
        )

    if name in reserved:
        raise DesignError.because(ToolReason.LINK_OF_ROBOT, tag=tag, name=name)


def _boxes(link: RobotLink) -> list[_Shape]:
    """Return a link's collision boxes, where there are none its visual ones.

    Where there are as many of both, collision boxes have the colours of the visual ones.
    """
    collisions = link.collisions or link.visuals
    painted = collisions

    if len(link.visuals) == len(collisions):
        painted = link.visuals

    boxes = []

    for shape, looks in zip(collisions, painted, strict=True):
        if not isinstance(shape.shape, Box):
            found = type(shape.shape).__name__.lower()
            if isinstance(shape.shape, Path):
                found = "mesh"

            raise DesignError.because(
                ToolReason.LINK_SHAPE, name=link.name, found=found
            )

        *rgb, opacity = looks.color or DEFAULT_COLOR
        color = (*rgb, max(opacity, _MIN_OPACITY))
        boxes.append(_Shape(shape.shape, shape.origin.pose, color))

    return boxes


def _moving(joint: RobotJoint, loose: bool) -> ToolJoint | None:
    """Return how a joint moves, with its axis in its own frame."""
    where = f"joint {joint.name!r}"
    if joint.kind == "fixed":
        return None

    if not (loose and joint.kind in _MOVES):
        wanted = 'tools are rigid: use type "fixed"'
        if loose:
            wanted = 'use type "fixed", "revolute" or "prismatic"'

        raise DesignError.because(
            ToolReason.JOINT_TYPE, where=where, given=shorten(joint.kind), wanted=wanted
        )

    lower, upper, *_ = joint.limits
    if lower is None or upper is None:
        raise DesignError.because(ToolReason.JOINT_LIMIT, where=where)

    stiffness, rest = joint.spring or (0.0, 0.0)
    numbers = {
        "damping": joint.damping,
        "friction": joint.friction,
        "stiffness": stiffness,
        "rest": rest,
    }

    try:
        return ToolJoint(
            _MOVES[joint.kind], joint.axis, lower, upper, (0.0, 0.0, 0.0), **numbers
        )
    except DesignError as error:
        raise error.placed(f"{where}: ") from error


def _hang(
    name: str,
    shapes: list[_Shape],
    mass: float,
    pose: Pose,
    moving: ToolJoint | None,
    holders: _Holders,
    taken: set[str],
) -> tuple[list[Component], _Holders]:
    """Make a link's components, and what its children may hang from.

    The first box hangs from the closest box of the parent link, each further box from the closest one before it. A
    link without boxes is only a frame: its children hang from the boxes of its parent.

    Args:
        name: the link's.
        shapes: its boxes.
        mass: what they weigh together, kg.
        pose: the link's frame in its parent's.
        moving: how its joint moves, with the axis in the link's frame; None: not at all.
        holders: what its parent's children may hang from.
        taken: names that no component may get; those of its boxes are added.
    """
    parents, frame = holders
    base = pose if frame is None else frame @ pose

    if not shapes and moving is not None:
        raise DesignError.because(ToolReason.LINK_EMPTY, name=name)

    if not shapes:
        return [], (parents, base)

    volume = math.fsum(shape.box.volume for shape in shapes)
    components: list[Component] = []

    bearers: list[_Holder] = []

    for box, place, color in shapes:
        # All of the mass, to the last bit, where there is one box.
        share = mass * (box.volume / volume)

        if bearers:
            parent, there = _nearest(bearers, box, place)
            free = _free_name(name, taken)
            part = Component(free, parent, there, box, share, color)
        else:
            parent, there = _nearest(parents, box, base @ place)
            joint = None

            if moving is not None:
                joint = _in_box(moving, place)

            part = Component(name, parent, there, box, share, color, joint)

        components.append(part)
        bearers.append(_Holder(part.name, box, place.inverse()))

    return components, (bearers, None)


def _in_box(joint: ToolJoint, place: Pose) -> ToolJoint:
    """Return a link's joint in the frame of a box, which lies at ``place`` in the link."""
    inverse = place.inverse()
    axis = tuple(inverse.rotation.apply(joint.axis).tolist())
    return replace(joint, axis=axis, origin=tuple(inverse.position.tolist()))


def _nearest(
    holders: list[_Holder],
    box: Box,
    pose: Pose,
) -> tuple[str, Pose]:
    """Choose the one closest to a box at a pose in their link's frame, the first of equal ones.

    Return its name, and the pose in its own frame.
    """

    def gap_to(holder: _Holder) -> float:
        if holder.box is None:
            return 0.0

        moved = Solid("", solid_geometry(box), holder.frame @ pose)
        still = Solid("", solid_geometry(holder.box), Pose())

        return max(0.0, signed_distance(moved, still))

    nearest = min(holders, key=gap_to)

    return nearest.name, nearest.frame @ pose


def _free_name(name: str, taken: set[str]) -> str:
    """Take the first name that is not ``taken``, of the form ``name_2``."""
    numbered = (f"{name[:58]}_{number}" for number in count(2))
    free = next(text for text in numbered if text not in taken)
    taken.add(free)

    return free
