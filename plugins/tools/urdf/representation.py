"""Tools as URDF: the block of links and joints that is merged into the Panda's own description.

What a model wrote is untrusted: the text is parsed without DTD, entities or anything external, under limits of length,
number and depth of elements, and nothing of it is passed on but names, numbers and colours.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any
from xml.etree.ElementTree import Element, ParseError, TreeBuilder

import numpy as np
from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import DefusedXMLParser
from lxml import etree

from core.design import Component, DesignError, Tool
from core.designs.rules import MAX_COMPONENT_KG, MAX_COMPONENTS, MAX_GAP_M, MAX_SIDE_M, MAX_TOOL_KG, MIN_SIDE_M
from core.geometry import Box, Pose
from core.interfaces import Brief, ToolRepresentation
from core.robot.description import FLANGE, assemble, tool_urdf
from core.robot.solids import box_gap
from core.scene import Color
from core.text import kind, shorten

MAX_CHARACTERS = 1_000_000
MAX_ELEMENTS = 10_000
MAX_DEPTH = 8
MAX_NUMBER = 1000.0  # no length, angle or mass of a tool comes near; keeps products finite
MAX_NAME = {"link": 64, "joint": 70}  # `core.robot` names a joint after its link, with "_joint" added

_NAME = re.compile(r"[A-Za-z0-9_.-]+")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_DECLARATION = re.compile(r"\s*<\?xml[^>]*\?>")
_NO_COLOR: Color = (0.2, 0.45, 0.8, 1.0)
_MIN_OPACITY = 0.2  # what collides must be seen
_LINK_KG = 0.005
_SAME_M = 0.0005
_SAME_RAD = 0.01


class UrdfTools(ToolRepresentation):
    """A tool is one field, ``tool_urdf``: URDF links and joints of boxes that hang from the mount."""

    def schema(self) -> dict[str, Any]:
        description = "URDF <link> and <joint> elements of the tool, without a root element"
        return {"tool_urdf": {"type": "string", "description": description}}

    def parse(self, data: Mapping[str, Any], *, gripper: bool) -> Tool:
        if "tool_urdf" not in data:
            raise DesignError("tool_urdf is missing; give the tool's <link> and <joint> elements")
        text = data["tool_urdf"]
        if not isinstance(text, str):
            raise DesignError(f"tool_urdf must be a text of <link> and <joint> elements, not {kind(text)}")
        return _read_tool(_parse_xml(text), Tool(gripper=gripper).mounts, gripper)

    def dump(self, tool: Tool) -> dict[str, Any]:
        return {"tool_urdf": tool_urdf(tool)}

    def instructions(self, brief: Brief) -> str:
        return _RULES.format(mount=_GRIPPER_MOUNT if brief.gripper else _RIGID_MOUNT, example=_example(brief.gripper))


# --- the text ---------------------------------------------------------------------------------------------------


class _BoundedBuilder(TreeBuilder):
    """Builds elements until there are too many, or too deep ones."""

    def __init__(self) -> None:
        super().__init__()
        self._depth = self._count = 0

    def start(self, tag: str, attributes: dict[str, str], /) -> Element:
        self._depth += 1
        self._count += 1
        if self._count > MAX_ELEMENTS:
            raise DesignError(f"tool_urdf has more than {MAX_ELEMENTS} elements; a tool needs far fewer")
        if self._depth > MAX_DEPTH:
            raise DesignError(
                f"tool_urdf nests elements more than {MAX_DEPTH} deep; links and joints stand side by side"
            )
        return super().start(tag, attributes)

    def end(self, tag: str, /) -> Element:
        self._depth -= 1
        return super().end(tag)


def _parse_xml(text: str) -> Element:
    """The root, whose children are the block's elements."""
    if len(text) > MAX_CHARACTERS:
        raise DesignError(f"tool_urdf is {len(text)} characters long; at most {MAX_CHARACTERS} are read")
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise DesignError("tool_urdf must not have a DOCTYPE or entities; write plain <link> and <joint> elements")
    declaration = _DECLARATION.match(text)
    block = text[declaration.end() :] if declaration else text
    parser = DefusedXMLParser(target=_BoundedBuilder(), forbid_dtd=True)
    try:
        parser.feed(f"<robot>\n{block}\n</robot>")
        root: Element = parser.close()
    except ParseError as error:
        line, column = error.position
        message = str(error).partition(":")[0]
        raise DesignError(
            f"tool_urdf is no well-formed XML: {message} in line {line - 1}, column {column + 1}"
        ) from error
    except DefusedXmlException as error:
        raise DesignError("tool_urdf must not have a DOCTYPE, entities or external references") from error
    except UnicodeEncodeError as error:
        raise DesignError("tool_urdf has characters that no text can hold (lone surrogates)") from error
    if len(root) == 1 and root[0].tag == "robot":
        return root[0]
    return root


def _one(element: Element, tag: str, where: str) -> Element | None:
    found = element.findall(tag)
    if len(found) > 1:
        raise DesignError(f"{where} has {len(found)} <{tag}> elements; give one")
    return found[0] if found else None


def _attribute(element: Element | None, tag: str, name: str, where: str) -> str:
    value = None if element is None else element.get(name)
    if value is None:
        raise DesignError(f'{where} needs <{tag} {name}="...">')
    return value


def _numbers(text: str, count: int, where: str) -> list[float]:
    words = text.split()
    if len(words) != count or not all(_NUMBER.fullmatch(word) for word in words):
        raise DesignError(f"{where} must be {count} plain number{'s' * (count > 1)}, not {shorten(text)}")
    numbers = [float(word) for word in words]
    if not all(abs(number) <= MAX_NUMBER for number in numbers):
        raise DesignError(
            f"{where} is {shorten(text)}; metres, radians and kilograms of a tool are far below {MAX_NUMBER:g}"
        )
    return numbers


def _origin(element: Element, where: str) -> Pose:
    origin = _one(element, "origin", where)
    if origin is None:
        return Pose()
    xyz = _numbers(origin.get("xyz", "0 0 0"), 3, f"{where}: origin xyz")
    return Pose.xyz_rpy(xyz, _numbers(origin.get("rpy", "0 0 0"), 3, f"{where}: origin rpy"))


# --- links and joints -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Placed:
    """A box in the frame of its link."""

    box: Box
    pose: Pose
    color: Color

    def is_at(self, other: _Placed) -> bool:
        return bool(
            np.abs(np.subtract(self.box.size, other.box.size)).max() <= _SAME_M
            and np.linalg.norm(self.pose.position - other.pose.position) <= _SAME_M
            and (self.pose.rotation.inv() * other.pose.rotation).magnitude() <= _SAME_RAD
        )


@dataclass(frozen=True)
class _Link:
    name: str
    boxes: tuple[_Placed, ...]
    mass: float


@dataclass(frozen=True)
class _Joint:
    parent: str
    child: str
    pose: Pose


@dataclass(frozen=True)
class _Anchor:
    """What children of a link may hang from: components (or a mount).

    Each has its name, its box, and the pose of the link's frame in its own.
    """

    choices: tuple[tuple[str, Box | None, Pose], ...]

    def nearest(self, box: Box, pose: Pose) -> tuple[str, Pose]:
        """The closest component to ``box`` (the first of equals), and the box's pose in that component's frame.

        ``pose`` is the box's in the link's frame.
        """
        gaps = [
            box_gap(box, frame @ pose, own, Pose()) if own is not None and len(self.choices) > 1 else 0.0
            for _, own, frame in self.choices
        ]
        name, _, frame = self.choices[int(np.argmin(gaps))]
        return name, frame @ pose


@lru_cache(maxsize=1)
def _robot_names() -> frozenset[str]:
    """Links and joints of the Panda with and without its hand."""
    names: set[str] = set()
    for tool in (Tool(), Tool(gripper=True)):
        robot = etree.fromstring(assemble(tool, visuals=False))
        names.update(str(element.get("name")) for tag in ("link", "joint") for element in robot.findall(tag))
    return frozenset(names)


def _check_name(name: str | None, what: str, taken: Mapping[str, object] | set[str]) -> str:
    if name is None:
        raise DesignError(f"a {what} has no name")
    if not _NAME.fullmatch(name) or len(name) > MAX_NAME[what]:
        raise DesignError(
            f"the {what} name {shorten(name)} is not 1 to {MAX_NAME[what]} letters, digits, '_', '.' or '-'"
        )
    if name in _robot_names():
        raise DesignError(f"{what} {name!r} is the robot's own; the block holds only the tool's links and joints")
    if name in taken:
        raise DesignError(f"two {what}s are named {name!r}; each needs a name of its own")
    return name


def _read_tool(root: Element, mounts: tuple[str, ...], gripper: bool) -> Tool:
    materials = _read_materials(root)
    links: dict[str, _Link] = {}
    joints: dict[str, _Joint] = {}  # by child
    joint_names: set[str] = set()
    for element in root:
        if element.tag == "link":
            name = _check_name(element.get("name"), "link", links)
            links[name] = _read_link(element, name, materials)
        elif element.tag == "joint":
            joint_names.add(_check_name(element.get("name"), "joint", joint_names))
            joint = _read_joint(element, f"joint {element.get('name')!r}")
            if joint.child in joints:
                raise DesignError(f"link {joint.child!r} is the child of two joints; a link has one parent")
            joints[joint.child] = joint
        elif element.tag != "material":
            raise DesignError(
                f"<{shorten(element.tag)[1:-1]}> has no place in a tool; only <link>, <joint> and <material> have"
            )
    _check_joints(joints, links, mounts)
    components: list[Component] = []
    anchors = {mount: _Anchor(((mount, None, Pose()),)) for mount in mounts}
    taken = {*links, *_robot_names()}
    for name, parent, pose in _from_mounts(links, joints, mounts):
        made, anchors[name] = _hang(links[name], anchors[parent], pose, taken)
        components += made
    return Tool(tuple(components), gripper)


def _read_materials(root: Element) -> dict[str, Color]:
    """Colours by material name; in URDF a colour given anywhere holds for all uses of the name."""
    colors: dict[str, Color] = {}
    for material in root.iter("material"):
        name, color = material.get("name"), material.find("color")
        if name and color is not None:
            colors.setdefault(name, _read_color(color, f"material {shorten(name)}"))
    return colors


def _read_color(element: Element, where: str) -> Color:
    numbers = _numbers(_attribute(element, "color", "rgba", where), 4, f"{where}: color rgba")
    red, green, blue, opacity = np.clip(numbers, (0.0, 0.0, 0.0, _MIN_OPACITY), 1.0)
    return float(red), float(green), float(blue), float(opacity)


def _read_link(element: Element, name: str, materials: Mapping[str, Color]) -> _Link:
    where = f"link {name!r}"
    visuals = [_read_box(shape, f"{where}: visual", materials) for shape in element.findall("visual")]
    collisions = [_read_box(shape, f"{where}: collision", materials) for shape in element.findall("collision")]
    boxes = collisions or visuals
    if visuals and collisions:
        boxes = _match(visuals, collisions, where)
    inertial = _one(element, "inertial", where)
    mass = _LINK_KG
    if inertial is not None:
        value = _attribute(_one(inertial, "mass", where), "mass", "value", f"{where}: inertial")
        (mass,) = _numbers(value, 1, f"{where}: mass")
    return _Link(name, tuple(boxes), mass)


def _read_box(element: Element, where: str, materials: Mapping[str, Color]) -> _Placed:
    geometry = _one(element, "geometry", where)
    shapes = [] if geometry is None else list(geometry)
    if len(shapes) != 1 or shapes[0].tag != "box":
        found = ", ".join(f"<{shorten(shape.tag)[1:-1]}>" for shape in shapes[:3]) or "nothing"
        raise DesignError(
            f'{where}: tools are made of boxes only; expected one <geometry><box size="x y z"/>, found {found}'
        )
    text = _attribute(shapes[0], "box", "size", where)
    x, y, z = _numbers(text, 3, f"{where}: box size")
    if min(x, y, z) <= 0:
        raise DesignError(f"{where}: box size is {shorten(text)}; sides must be positive, in metres")
    color, material = _NO_COLOR, _one(element, "material", where)
    if material is not None:
        inline, named = _one(material, "color", where), materials.get(material.get("name", ""), _NO_COLOR)
        color = named if inline is None else _read_color(inline, where)
    return _Placed(Box((x, y, z)), _origin(element, where), color)


def _match(visuals: list[_Placed], collisions: list[_Placed], where: str) -> list[_Placed]:
    """The collision boxes in the colours of the visual boxes at the same places."""
    left, matched = list(visuals), []
    for collision in collisions:
        twin = next((visual for visual in left if visual.is_at(collision)), None)
        if twin is not None:
            left.remove(twin)
            matched.append(_Placed(collision.box, collision.pose, twin.color))
    if left or len(matched) < len(collisions):
        raise DesignError(
            f"{where}: its visual and collision boxes differ; what is seen must be what collides, "
            "so give both the same origins and sizes"
        )
    return matched


def _read_joint(element: Element, where: str) -> _Joint:
    if element.get("type") != "fixed":
        raise DesignError(
            f'{where} is of type {shorten(element.get("type", ""))}; tools are rigid, so use type "fixed"'
        )
    parent = _attribute(_one(element, "parent", where), "parent", "link", where)
    child = _attribute(_one(element, "child", where), "child", "link", where)
    return _Joint(parent, child, _origin(element, where))


def _check_joints(joints: Mapping[str, _Joint], links: Mapping[str, _Link], mounts: tuple[str, ...]) -> None:
    for joint in joints.values():
        if joint.child not in links:
            raise DesignError(f"a joint's child is {shorten(joint.child)}, which is no link of the tool")
        if joint.parent not in links and joint.parent not in mounts:
            raise DesignError(
                f"link {joint.child!r} hangs from {shorten(joint.parent)}, which is neither a link of the tool "
                f"nor its mount ({' or '.join(mounts)})"
            )


def _from_mounts(
    links: Mapping[str, _Link], joints: Mapping[str, _Joint], mounts: tuple[str, ...]
) -> Iterator[tuple[str, str, Pose]]:
    """Links with their parent and pose in it: parents first, else in the order of the text."""
    done = set(mounts)
    for start in links:
        chain: dict[str, _Joint] = {}
        name = start
        while name not in done:
            if name in chain:
                raise DesignError(
                    f"the joints lead from link {name!r} round in a circle; hang the tool from {' or '.join(mounts)}"
                )
            if name not in joints:
                raise DesignError(
                    f"no joint holds link {name!r}; hang it from {' or '.join(mounts)} or from another link"
                )
            chain[name] = joints[name]
            name = joints[name].parent
        for name, joint in reversed(chain.items()):
            done.add(name)
            yield name, joint.parent, joint.pose


def _hang(link: _Link, anchor: _Anchor, pose: Pose, taken: set[str]) -> tuple[list[Component], _Anchor]:
    """A link's components, and what its children hang from. ``pose`` is the link's in its parent link.

    The first box hangs from the closest box of the parent link, further boxes from the closest one before them. A link
    without boxes is a mere frame: its children hang from its parent's boxes.
    """
    if not link.boxes:
        return [], _Anchor(tuple((name, box, frame @ pose) for name, box, frame in anchor.choices))
    volume = math.fsum(placed.box.volume for placed in link.boxes)
    components: list[Component] = []
    own: tuple[tuple[str, Box | None, Pose], ...] = ()
    for placed in link.boxes:
        name = _free_name(link.name, taken) if own else link.name
        parent, at = (
            _Anchor(own).nearest(placed.box, placed.pose) if own else anchor.nearest(placed.box, pose @ placed.pose)
        )
        share = placed.box.volume / volume if volume > 0 else 1 / len(link.boxes)
        components.append(Component(name, parent, at, placed.box, link.mass * share, placed.color))
        own = (*own, (name, placed.box, placed.pose.inverse()))
    return components, _Anchor(own)


def _free_name(name: str, taken: set[str]) -> str:
    number = 2
    while (free := f"{name[:58]}_{number}") in taken:
        number += 1
    taken.add(free)
    return free


# --- the prompt -------------------------------------------------------------------------------------------------

_RULES = f"""\
Write each tool as a block of URDF <link> and <joint> elements in `tool_urdf`. The block is merged into the Panda's URDF
before its closing tag, so it has no root element and none of the robot's own links or joints.

{{mount}}

- Boxes only: <box size="x y z"/>, full side lengths in metres, each {MIN_SIDE_M:g} to {MAX_SIDE_M:g}. No meshes,
  cylinders or spheres.
- One link per box, with a visual, a collision and an inertial element. Visual and collision have the same origin and
  the same size: what is seen is what collides. At most {MAX_COMPONENTS} boxes.
- The inertial needs <mass value="..."/> in kilograms; moments of inertia are worked out from the box. A few grams per
  box help the arm to move well; the limits are {MAX_COMPONENT_KG:g} kg for a box and {MAX_TOOL_KG:g} kg for the tool.
- Every link is the child of exactly one joint of type "fixed", and following parents leads to the mount. The joint's
  origin is the link's frame in its parent's frame; a box is centred on its own origin, so half lengths count when parts
  are to meet.
- Every box touches or overlaps its parent; a gap of more than {MAX_GAP_M * 1000:g} mm is refused.
- Names: letters, digits, '_', '.', '-'; each link and each joint has its own.
- Colours are welcome: <material name="..."><color rgba="r g b a"/></material>, numbers from 0 to 1.
- Tools of several well-placed boxes (hooks, walls, scoops, bends) tend to do better than a plain bar.

Example of one link and its joint:
{{example}}"""

_RIGID_MOUNT = f"""\
The tool is rigid and takes the place of the hand. It hangs from the link `panda_virtual` on the arm's flange, whose
axes are the world's when its roll, pitch and yaw are 0, as they are at home: x forward, y left, z up. The arm is above
it, so the tool goes toward -z. What hangs from `panda_virtual` must touch the flange, a disc of
{FLANGE.radius * 2000:g} mm diameter and {FLANGE.length * 1000:g} mm thickness centred at its origin and square to z."""

_GRIPPER_MOUNT = """\
The tool is a pair of attachments to the gripper's fingers, which open and close them: the left part hangs from the link
`panda_leftfinger`, the right part from `panda_rightfinger`; each must touch its finger. In both frames z points along
the finger to its tip at z = 0.054, and x across it (the finger is 0.022 wide). The left finger lies on the +y side of
its frame and opens toward +y, the right one lies on the -y side and opens toward -y; both inner faces are at y = 0, and
meet when the gripper is closed. At home both frames' x is the world's x, their y is the world's -y, and their z is
down."""


def _example(gripper: bool) -> str:
    mount = "panda_leftfinger" if gripper else "panda_virtual"
    joint_origin = "0 0.0075 0.07" if gripper else "0 0 -0.055"
    name, size = ("left_pad", "0.02 0.015 0.04") if gripper else ("shaft", "0.02 0.02 0.1")
    return f"""\
<link name="{name}">
  <visual>
    <origin xyz="0 0 0" rpy="0 0 0"/>
    <geometry><box size="{size}"/></geometry>
    <material name="blue"><color rgba="0.2 0.4 0.8 1"/></material>
  </visual>
  <collision>
    <origin xyz="0 0 0" rpy="0 0 0"/>
    <geometry><box size="{size}"/></geometry>
  </collision>
  <inertial>
    <mass value="0.005"/>
  </inertial>
</link>
<joint name="{name}_joint" type="fixed">
  <parent link="{mount}"/>
  <child link="{name}"/>
  <origin xyz="{joint_origin}" rpy="0 0 0"/>
</joint>"""
