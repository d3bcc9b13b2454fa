"""Read a robot's URDF defensively: links and joints as data.

The text may be wrong in any way: it is parsed without DTD, entities and network, and every number is checked.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any
from urllib.parse import unquote
from xml.etree.ElementTree import Element, ParseError

import numpy as np
from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import fromstring

from core.errors import UserError, choices
from core.geometry import Box, Color, Cylinder, Sphere
from core.support.text import shorten, visible
from core.values.descriptions import (
    MOMENTS,
    MOVING,
    ONE,
    ZERO,
    Description,
    Inertial,
    Limits,
    Mimic,
    Origin,
    RobotJoint,
    RobotLink,
    RobotShape,
    Scale,
)

MAX_BYTES = 10_000_000
_MAX_ELEMENTS = 50_000
MAX_NUMBER = 1e6  # of any unit; keeps products finite
NAME = re.compile(r"[A-Za-z0-9_.-]{1,64}")
_KINDS = (*MOVING, "fixed", "floating", "planar")
_NO_MOMENTS = dict.fromkeys(MOMENTS, 0.0)
_PACKAGE_PATHS = ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH")


def read_xml(data: bytes, file: Path) -> Element:
    """Parse XML that lies at ``file``, without DTD and entities.

    Raises:
        UserError: it is no plain XML, or has too many elements.
    """
    try:
        root = fromstring(data, forbid_dtd=True)
    except ParseError as error:
        raise UserError(f"{file} is malformed XML: {error}") from error
    except (DefusedXmlException, ValueError, LookupError) as error:
        # Of the last two kinds is an encoding that does not exist.
        raise UserError(
            f"{file} must be plain XML without DOCTYPE and entities ({type(error).__name__})"
        ) from error

    count = sum(1 for _ in root.iter())
    if count > _MAX_ELEMENTS:
        raise UserError(
            f"{file} has {count} elements; at most {_MAX_ELEMENTS} are read"
        )

    return root


def read_description(
    data: bytes, file: Path, taken: Collection[str] | None = None
) -> Description:
    """Read a URDF that lies at ``file``.

    Args:
        data: the text.
        file: where it lies; meshes are found from there.
        taken: names that are refused, as are odd ones. None: the text is a robot's, where any name goes, and meshes are
            looked for when they are needed.

    Raises:
        UserError: it is no URDF, or something in it is wrong; says what, where, and how to mend it.
    """
    root = read_xml(data, file)
    if root.tag != "robot":
        tag = shorten(root.tag)[1:-1]
        raise UserError(f"{file} is no URDF: its root is <{tag}> instead of <robot>")

    try:
        return read_tree(root, file, taken)
    except UserError as error:
        raise type(error)(f"{file}: {error}") from error


def read_tree(
    root: Element, file: Path, taken: Collection[str] | None = None
) -> Description:
    """Read links and joints, the children of ``root``; see `read_description`."""
    links = _find_named(root, "link", taken)
    joints: dict[str, _Part] = {}  # by child, as their parents
    parents: dict[str, list[str]] = {}
    for joint in _find_named(root, "joint", taken).values():
        parent = _find_end(joint, "parent", links)
        child = _find_end(joint, "child", links)
        if child in joints:
            raise UserError(
                f"link {child!r} hangs on two joints, so that links form a loop; a URDF is a tree"
            )

        joints[child] = joint
        parents[child] = [parent]

    try:
        TopologicalSorter(parents).prepare()
    except CycleError as error:
        loop = " -> ".join(error.args[1])
        raise UserError(f"links form a loop: {loop}; a URDF is a tree") from error

    roots = sorted(links.keys() - joints.keys())
    if len(roots) != 1:
        found = ", ".join(roots[:5]) or "no link is left"
        raise UserError(
            f"{len(roots)} links have no parent: {found}; an arm has one base, join the others to it with fixed joints"
        )

    colors = {}
    for element in root.iter("material"):
        if element.find("color") is not None:
            colors[element.get("name", "")] = _read_color(element)

    where = file if taken is not None else None
    return Description(
        str(root.get("name") or file.stem),
        {name: _read_link(link, name, colors, where) for name, link in links.items()},
        {
            child: _read_joint(joint, parents[child][0], child)
            for child, joint in joints.items()
        },
    )


@dataclass(frozen=True)
class _Part:
    """An element of a description, and where it stands, for messages."""

    element: Element
    where: str

    def find(self, tag: str) -> _Part | None:
        child = self.element.find(tag)
        return None if child is None else _Part(child, f"{self.where}: {tag}")

    def need(self, tag: str) -> _Part:
        child = self.find(tag)
        if child is None:
            raise UserError(f"{self.where} has no <{tag}>")
        return child

    def numbers(
        self, name: str, count: int, default: tuple[float, ...] | None = None
    ) -> Any:
        """Read an attribute of so many numbers.

        Raises:
            UserError: it is not there and has no ``default``, or is something else.
        """
        text = self.element.get(name)
        if text is None:
            if default is None:
                raise UserError(f"{self.where}: {name} is missing")
            return default

        try:
            values = tuple(map(float, text.split()))
        except ValueError:
            values = ()

        plain = text.isascii() and "_" not in text
        finite = all(abs(value) <= MAX_NUMBER for value in values)  # nan is not
        if not (plain and finite and len(values) == count):
            wanted = "a number" if count == 1 else f"{count} numbers"
            raise UserError(
                f"{self.where}: {name} is {shorten(text)}; expected {wanted}, finite and at most {MAX_NUMBER:g}"
            )

        return values

    def positive(self, name: str, count: int = 1) -> Any:
        """Read an attribute of so many lengths."""
        values = self.numbers(name, count)
        if min(values) <= 0:
            raise UserError(
                f"{self.where}: {name} is {min(values):g}; it must be greater than 0"
            )
        return values

    def number(self, name: str, *default: float) -> float:
        return float(self.numbers(name, 1, default or None)[0])

    def fields(self, tag: str, **fields: Any) -> dict[str, Any]:
        """Read the numbers that a child has of these, which have their defaults."""
        child = self.find(tag)
        if child is not None:
            for name in fields.keys() & child.element.attrib.keys():
                fields[name] = child.number(name)
        return fields

    def origin(self) -> Origin:
        origin = self.find("origin")
        if origin is None:
            return Origin()
        return Origin(origin.numbers("xyz", 3, ZERO), origin.numbers("rpy", 3, ZERO))


def _find_named(
    root: Element, tag: str, taken: Collection[str] | None
) -> dict[str, _Part]:
    """Find the elements of a kind by name."""
    found: dict[str, _Part] = {}
    for element in root.findall(tag):
        name = element.get("name")
        if not name:
            raise UserError(f"a <{tag}> has no name")
        if taken is not None and not NAME.fullmatch(name):
            raise UserError(
                f"{tag} name {shorten(name)} is not 1 to 64 letters, digits, '_', '.' or '-'; rename it"
            )

        if name in (taken or ()):
            raise UserError(
                f"{tag} {name!r} has a name that the program needs itself; rename it"
            )

        if name in found:
            raise UserError(
                f"two {tag}s are named {name!r}; each needs a name of its own"
            )

        found[name] = _Part(element, f"{tag} {name!r}")

    return found


def _find_end(joint: _Part, tag: str, links: Collection[str]) -> str:
    """Find the link at an end of a joint."""
    end = joint.element.find(tag)
    if end is None or "link" not in end.attrib:
        raise UserError(f'{joint.where} names no {tag}; add <{tag} link="..."/>')
    name = end.attrib["link"]
    if name not in links:
        raise choices("link", name, links, joint.where)
    return name


def _read_link(
    link: _Part, name: str, colors: Mapping[str, Color], file: Path | None
) -> RobotLink:
    collisions = _read_shapes(link, "collision", colors, file)
    visuals = _read_shapes(link, "visual", colors, file)
    inertial = link.find("inertial")
    if inertial is None:
        return RobotLink(name, Inertial(), collisions, visuals)
    origin = inertial.origin()
    mass = inertial.need("mass").number("value")
    if mass < 0:
        raise UserError(f"{inertial.where}: mass is {mass:g} kg; it can't be negative")

    moments: Any = tuple(inertial.fields("inertia", **_NO_MOMENTS).values())
    weight = Inertial(mass, origin.xyz, moments, origin.rpy)
    return RobotLink(name, weight, collisions, visuals)


def _read_shapes(
    link: _Part, tag: str, colors: Mapping[str, Color], file: Path | None
) -> tuple[RobotShape, ...]:
    shapes = []
    for element in link.element.findall(tag):
        part = _Part(element, f"{link.where}: {tag}")
        geometry = part.need("geometry").element
        if len(geometry) != 1:
            raise UserError(
                f"{part.where}: <geometry> needs one shape: box, sphere, cylinder or mesh; it has {len(geometry)}"
            )

        shape, scale = _read_geometry(part, geometry[0], file)

        color = None
        material = element.find("material")
        if material is not None:
            color = colors.get(material.get("name", ""))
            if material.find("color") is not None:
                color = _read_color(material)

        shapes.append(RobotShape(shape, part.origin(), color, scale))

    return tuple(shapes)


def _read_geometry(
    part: _Part, element: Element, file: Path | None
) -> tuple[Box | Sphere | Cylinder | Path, Scale]:
    where = part.where
    shape = _Part(element, f"{where}: {element.tag}")

    match element.tag:
        case "box":
            return Box(shape.positive("size", 3)), ONE
        case "sphere":
            return Sphere(*shape.positive("radius")), ONE
        case "cylinder":
            radius = shape.positive("radius")
            return Cylinder(*radius, *shape.positive("length")), ONE
        case "mesh":
            scale = shape.numbers("scale", 3, ONE)
            if 0.0 in scale:
                given = shorten(element.attrib["scale"])
                raise UserError(f"{where}: mesh scale is {given}; no factor can be 0")

            name = element.get("filename") or ""
            return Path(name) if file is None else find_mesh(name, file, where), scale

    tag = shorten(element.tag)[1:-1]
    raise UserError(
        f"{where}: <{tag}> is no shape of a URDF: use box, sphere, cylinder or mesh"
    )


def find_mesh(name: str, file: Path, where: str) -> Path:
    """Find a mesh as a URDF names it: absolute, relative to the URDF, ``file://``, or ``package://``.

    A package is a folder of its name that holds the URDF or lies beside or above it, or one in ROS_PACKAGE_PATH, or in
    a ``share`` of AMENT_PREFIX_PATH.

    Raises:
        UserError: the name can't be resolved, or there is no such file.
    """
    scheme, _, path = name.rpartition("://")
    if not path:
        raise UserError(f"{where}: mesh has no filename that can be read")
    if scheme not in ("", "file", "package"):
        raise UserError(
            f"{where}: mesh {shorten(name)}: {scheme}:// is not read; give a path, or package://"
        )

    mend = ""
    folders = [file.parent]
    if scheme:
        path = unquote(path)
    package = path.partition("/")[0]
    if scheme == "package":
        folders = [*file.resolve().parents, *_package_folders()]
        mend = (
            f"; package {shorten(package)} must lie beside or above the URDF, or in a folder of "
            f"{_PACKAGE_PATHS[0]}"
        )

    # Not those of `Path`, which raise an error for a name that is too long.
    for folder in folders:
        if os.path.isfile(folder / path):  # noqa: PTH113
            return (folder / path).resolve()

    holding = [f for f in folders if os.path.isdir(f / package)]  # noqa: PTH112
    wanted = visible(str((holding or folders)[0] / path))
    raise UserError(
        f"{where}: there is no mesh file {wanted} (named {shorten(name, 200)}){mend}"
    )


def _package_folders() -> Iterator[Path]:
    """Yield the folders outside the URDF's own in which packages may lie."""
    for variable in _PACKAGE_PATHS:
        for name in filter(None, os.environ.get(variable, "").split(os.pathsep)):
            root = Path(name)
            yield from (root, root / "share", root.parent)


def _read_joint(joint: _Part, parent: str, child: str) -> RobotJoint:
    kind = joint.element.get("type", "")
    if kind not in _KINDS:
        raise choices("type", kind, _KINDS, joint.where)

    axis = joint.find("axis")
    direction = RobotJoint.axis
    if axis is not None:
        direction = axis.numbers("xyz", 3)
    if kind in MOVING and math.hypot(*direction) < 1e-6:
        raise UserError(f"{joint.where}: its axis has length 0")

    mimic = joint.element.find("mimic")
    factors = joint.fields("mimic", multiplier=1.0, offset=0.0)
    spring = joint.fields("spring", stiffness=0.0, rest=0.0)
    return RobotJoint(
        joint.element.get("name", ""),
        kind,
        parent,
        child,
        joint.origin(),
        direction,
        Limits(**joint.fields("limit", **Limits()._asdict())),
        None if mimic is None else Mimic(mimic.get("joint", ""), **factors),
        **joint.fields("dynamics", damping=0.0, friction=0.0),
        spring=tuple(spring.values()) if joint.find("spring") else None,
    )


def _read_color(material: Element) -> Color:
    part = _Part(material, f"material {shorten(material.get('name', ''))}")
    rgba = part.need("color").numbers("rgba", 4)
    red, green, blue, opacity = np.clip(rgba, 0.0, 1.0).tolist()
    return red, green, blue, opacity
