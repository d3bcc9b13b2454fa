"""Build a tool from URDF: read links and joints as a robot's are, then hang each box from the one that it touches.

A model wrote the text, so it is untrusted: DTD and entities are refused, and length and number of elements limited.
"""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Literal, NamedTuple
from xml.etree.ElementTree import Element, SubElement

from core.design import Component, DesignError, Tool, ToolJoint
from core.designs.rules import MAX_COMPONENTS
from core.errors import UserError
from core.geometry import Box, Pose
from core.interfaces import Robot
from core.robot.solids import gap
from core.scene import Color
from core.support.text import shorten
from core.values.descriptions import RobotJoint, RobotLink
from core.values.urdf import read_tree, read_xml
from plugins.tools.components import default_mass, parents_first, robot_names

MAX_CHARACTERS = 1_000_000
MAX_LINKS = 2 * MAX_COMPONENTS  # some are only frames
MAX_NAME = {
    "link": 64,
    "joint": 70,
}  # `core.robot` names a joint after its link, with "_joint" added
DEFAULT_COLOR: Color = (0.2, 0.45, 0.8, 1.0)

_MOVES: dict[str, Literal["hinge", "slider"]] = {
    "revolute": "hinge",
    "prismatic": "slider",
}
_NAME = re.compile(r"[A-Za-z0-9_.-]+")
_DECLARATION = re.compile(r"\s*<\?xml[^>]*\?>")
_MANY = (
    "link",
    "joint",
    "material",
    "collision",
    "visual",
)  # what an element may have several of
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
    text: str, gripper: bool, robot: Robot, *, masses: bool = True, loose: bool = False
) -> Tool:
    """The tool whose links and joints are in ``text``, for ``robot``; ``masses``: read those too.

    Raises:
        DesignError: they are not boxes on joints that lead to a mount, fixed ones or, if ``loose``, hinges and sliders.
    """
    mounts = Tool(gripper=gripper).mounts
    aliases = dict(robot.aliases)
    root = _parse(text)
    names = _check(root, robot_names(robot), " or ".join(mounts))
    bare = {
        link.get("name")
        for link in root.iterfind("link")
        if link.find("inertial") is None or not masses
    }
    for link in root.iterfind("link") if not masses else ():
        link[:] = [element for element in link if element.tag != "inertial"]
    for name in (
        *mounts,
        *(alias for alias, mount in aliases.items() if mount in mounts),
    ):
        SubElement(root, "link", name=name)
        if (
            name != mounts[0]
        ):  # the others hang from the first one here: a description has one base
            joint = SubElement(root, "joint", name=f"to {name}", type="fixed")
            SubElement(joint, "parent", link=mounts[0])
            SubElement(joint, "child", link=name)
    try:
        tree = read_tree(root, Path("tool_urdf"))
    except UserError as error:
        raise DesignError(str(error)) from error
    components: list[Component] = []
    holders: dict[str, _Holders] = {
        mount: ([_Holder(mount, None, Pose())], None) for mount in mounts
    }
    taken = {*names, *robot_names(robot)}
    parents = {
        name: aliases.get(tree.joints[name].parent, tree.joints[name].parent)
        for name in names
    }
    for name in parents_first(parents, mounts, "link"):
        shapes = _boxes(tree.links[name])
        mass = tree.links[name].inertial.mass
        if name in bare:
            mass = (
                default_mass(math.fsum(shape.box.volume for shape in shapes))
                if shapes
                else Component.mass
            )
        moving = _moving(tree.joints[name], loose)
        pose = tree.joints[name].origin.pose
        boxes, holders[name] = _hang(
            name, shapes, mass, pose, moving, holders[parents[name]], taken
        )
        components += boxes
    return Tool(tuple(components), gripper)


def _parse(text: str) -> Element:
    """Parse the text; the children of what is returned are the tool's elements."""
    if len(text) > MAX_CHARACTERS:
        raise DesignError(
            f"tool_urdf is {len(text)} characters long; at most {MAX_CHARACTERS} are allowed"
        )
    declaration = _DECLARATION.match(text)
    block = text[declaration.end() :] if declaration else text
    try:
        root = read_xml(
            f"<robot>{block}\n</robot>".encode(errors="surrogatepass"),
            Path("tool_urdf"),
        )
    except UserError as error:
        raise DesignError(str(error)) from error
    return root[0] if len(root) == 1 and root[0].tag == "robot" else root


def _check(root: Element, own: frozenset[str], mounts: str) -> list[str]:
    """Refuse what can't be in a tool, before anything is compared with all others; list the names of the links."""
    names: dict[str, list[str]] = {"link": [], "joint": [], "material": []}
    for element in root:
        if (tag := element.tag) not in names:
            raise DesignError(
                f"<{shorten(tag)[1:-1]}> is not allowed; use <link>, <joint> and <material>"
            )
        name = element.get("name", "")
        names[tag].append(name)
        if tag in MAX_NAME and (not _NAME.fullmatch(name) or len(name) > MAX_NAME[tag]):
            raise DesignError(
                f"{tag} name {shorten(name)} is not 1 to {MAX_NAME[tag]} letters, digits, '_', '.' or '-'"
            )
        if tag in MAX_NAME and name in own:
            raise DesignError(
                f"{tag} {name!r} is the robot's own; the block holds only the tool's links and joints"
            )
    limits = {
        "visual": MAX_COMPONENTS,
        "collision": MAX_COMPONENTS,
        "link": MAX_LINKS,
        "joint": MAX_LINKS,
    }
    for tag, most in limits.items():
        if (count := sum(1 for _ in root.iter(tag))) > most:
            raise DesignError(
                f"the tool has {count} <{tag}> elements; at most {most} are allowed"
            )
    for element in root.iter():
        tags = [child.tag for child in element if child.tag not in _MANY]
        if twice := next(
            (tag for number, tag in enumerate(tags) if tag in tags[:number]), None
        ):
            raise DesignError(
                f"a <{element.tag}> has {tags.count(twice)} <{twice}> elements; give one"
            )
    held = {child.get("link") for child in root.iterfind("joint/child")}
    for name in names["link"]:
        if name not in held:
            raise DesignError(
                f"no joint holds link {name!r}; hang it from {mounts} or another link"
            )
    return names["link"]


def _boxes(link: RobotLink) -> list[_Shape]:
    """Return a link's collision boxes, where there are none its visual ones.

    Where there are as many of both, collision boxes have the colours of the visual ones.
    """
    collisions = link.collisions or link.visuals
    visuals = link.visuals
    painted = visuals if len(visuals) == len(collisions) else collisions
    made = []
    for shape, looks in zip(collisions, painted, strict=True):
        if not isinstance(shape.shape, Box):
            found = (
                "mesh"
                if isinstance(shape.shape, Path)
                else type(shape.shape).__name__.lower()
            )
            raise DesignError(
                f'link {link.name!r}: boxes only; expected <box size="x y z"/>, found <{found}>'
            )
        red, green, blue, opacity = looks.color or DEFAULT_COLOR
        made.append(
            _Shape(
                shape.shape,
                shape.origin.pose,
                (red, green, blue, max(opacity, _MIN_OPACITY)),
            )
        )
    return made


def _moving(joint: RobotJoint, loose: bool) -> ToolJoint | None:
    """Return how a joint moves, with its axis in its own frame."""
    where = f"joint {joint.name!r}"
    if joint.kind == "fixed":
        return None
    if not (loose and joint.kind in _MOVES):
        wanted = (
            'use type "fixed", "revolute" or "prismatic"'
            if loose
            else 'tools are rigid: use type "fixed"'
        )
        raise DesignError(f"{where} is of type {shorten(joint.kind)}; {wanted}")
    lower, upper, *_ = joint.limits
    if lower is None or upper is None:
        raise DesignError(f'{where} needs <limit lower="..." upper="..."/>')
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
        raise DesignError(f"{where}: {error}") from error


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
    """
    parents, frame = holders
    base = pose if frame is None else frame @ pose
    if not shapes and moving is not None:
        raise DesignError(
            f"link {name!r} hangs on a joint that moves, and has no box; give it one"
        )
    if not shapes:
        return [], (parents, base)
    volume = math.fsum(shape.box.volume for shape in shapes)
    components: list[Component] = []
    own: list[_Holder] = []
    for box, place, color in shapes:
        parent, there = _nearest(own or parents, box, place if own else base @ place)
        own_mass = mass * (
            box.volume / volume
        )  # all of it, to the last bit, where there is one box
        part = Component(
            _free_name(name, taken) if own else name,
            parent,
            there,
            box,
            own_mass,
            color,
        )
        if moving is not None and not own:
            inverse = place.inverse()
            (x, y, z), (ax, ay, az) = (
                inverse.position.tolist(),
                inverse.rotation.apply(moving.axis).tolist(),
            )
            part = replace(
                part, joint=replace(moving, axis=(ax, ay, az), origin=(x, y, z))
            )
        components.append(part)
        own.append(_Holder(part.name, box, place.inverse()))
    return components, (own, None)


def _nearest(holders: list[_Holder], box: Box, pose: Pose) -> tuple[str, Pose]:
    """Choose the one closest to a box at a pose in their link's frame, the first of equal ones.

    Return its name, and the pose in its own frame.
    """
    best = holders[0]
    least = math.inf
    for holder in holders if len(holders) > 1 else ():
        distance = (
            gap(box, holder.frame @ pose, holder.box, Pose())
            if holder.box is not None
            else 0.0
        )
        if distance < least:
            best = holder
            least = distance
        if distance == 0:
            break
    return best.name, best.frame @ pose


def _free_name(name: str, taken: set[str]) -> str:
    number = 2
    while (free := f"{name[:58]}_{number}") in taken:
        number += 1
    taken.add(free)
    return free
