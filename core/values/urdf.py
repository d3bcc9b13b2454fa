"""Read a robot's URDF defensively: links and joints as data.

The text may be wrong in any way: it is parsed without DTD, entities and network, and every number is checked.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
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
MAX_PARTS = 500  # links, joints, and shapes of a link
MAX_NUMBER = 1e6  # of any unit; keeps products finite
NAME = re.compile(r"[A-Za-z0-9_.-]{1,64}")
_KINDS = (*MOVING, "fixed", "floating", "planar")
PACKAGE_PATHS = ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH")


def read_xml(data: bytes, file: Path) -> Element:
    """Parse XML that lies at ``file``, without DTD and entities.

    Raises:
        UserError: it is too large, or no plain XML.
    """
    if len(data) > MAX_BYTES:
        raise UserError(
            f"{file} has {len(data) / 1e6:.0f} MB; at most {MAX_BYTES / 1e6:.0f} MB are read"
        )
    try:
        return fromstring(data, forbid_dtd=True)
    except ParseError as error:
        raise UserError(f"{file} is malformed XML: {error}") from error
    except (
        DefusedXmlException,
        ValueError,
        LookupError,
    ) as error:  # an encoding that does not exist
        raise UserError(
            f"{file} must be plain XML without DOCTYPE and entities ({type(error).__name__})"
        ) from error


def read_description(
    data: bytes,
    file: Path,
    without: Collection[str] = (),
    taken: Collection[str] | None = None,
) -> Description:
    """Read a URDF that lies at ``file``, without the links that ``without`` names and all that they bear.

    Args:
        data: the text.
        file: where it lies; meshes are found from there.
        without: links that are left out.
        taken: names that are refused, as are odd ones. None: the text is a robot's, where any name goes, and meshes are
            looked for when they are needed.

    Raises:
        UserError: it is no URDF, or something in it is wrong; says what, where, and how to mend it.
    """
    root = read_xml(data, file)
    if root.tag != "robot":
        raise UserError(
            f"{file} is no URDF: its root is <{shorten(root.tag)[1:-1]}> instead of <robot>"
        )
    try:
        return read_tree(root, file, without, taken)
    except UserError as error:
        raise type(error)(f"{file}: {error}") from error


def read_tree(
    root: Element,
    file: Path,
    without: Collection[str] = (),
    taken: Collection[str] | None = None,
) -> Description:
    """Read links and joints, the children of ``root``; see `read_description`."""
    colors = {
        m.get("name", ""): _color(m)
        for m in root.iter("material")
        if m.find("color") is not None
    }
    links, joints = (_unique(root, tag, taken) for tag in ("link", "joint"))
    bearers: dict[
        str, tuple[Element, str]
    ] = {}  # of each link: the joint, and the link that it hangs on
    for joint in joints.values():
        parent, child = (_end(joint, tag, links) for tag in ("parent", "child"))
        if child in bearers:
            raise UserError(
                f"link {child!r} hangs on two joints, so that links form a loop; a URDF is a tree"
            )
        bearers[child] = joint, parent
    for name in without:
        if name not in links:
            raise choices("link", name, links)
    kept = [name for name in links if not {*_chain(name, bearers)} & {*without}]
    roots = sorted({*kept} - bearers.keys())
    if len(roots) != 1:
        found = (
            f"{len(roots)} links have no parent: {', '.join(roots[:5])}"
            if roots
            else "no link is left"
        )
        raise UserError(
            f"{found}; an arm has one base, join the others to it with fixed joints"
        )
    base = file if taken is not None else None
    return Description(
        str(root.get("name") or file.stem),
        {name: _link(links[name], name, colors, base) for name in kept},
        {
            child: _joint(joint, parent, child)
            for child, (joint, parent) in bearers.items()
            if child in kept
        },
    )


def _unique(
    root: Element, tag: str, taken: Collection[str] | None
) -> dict[str, Element]:
    """Find the elements of a kind by name."""
    found: dict[str, Element] = {}
    for element in root.findall(tag):
        name = element.get("name")
        if name is None:
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
        found[name] = element
    if len(found) > MAX_PARTS:
        raise UserError(f"there are {len(found)} {tag}s; at most {MAX_PARTS} are read")
    return found


def _end(joint: Element, tag: str, links: Mapping[str, Element]) -> str:
    end, where = joint.find(tag), f"joint {joint.get('name')!r}"
    name = None if end is None else end.get("link")
    if name is None:
        raise UserError(f'{where} names no {tag}; add <{tag} link="..."/>')
    if name not in links:
        raise choices("link", name, links, where)
    return name


def _chain(link: str, bearers: Mapping[str, tuple[Element, str]]) -> list[str]:
    chain = [link]
    while chain[-1] in bearers:
        above = bearers[chain[-1]][1]
        if above in chain:
            raise UserError(
                f"links form a loop: {' -> '.join([above, *chain[chain.index(above) :][::-1]])}; a URDF is a tree"
            )
        chain.append(above)
    return chain


def _link(
    element: Element, name: str, colors: Mapping[str, Color], file: Path | None
) -> RobotLink:
    where = f"link {name!r}"
    collisions, visuals = (
        tuple(_shapes(element, tag, where, colors, file))
        for tag in ("collision", "visual")
    )
    inertial, where = element.find("inertial"), f"{where}: inertial"
    if inertial is None:
        return RobotLink(name, Inertial(), collisions, visuals)
    origin, mass = (
        _origin(inertial, where),
        _number(_child(inertial, "mass", where), "value", where),
    )
    if mass < 0:
        raise UserError(f"{where}: mass is {mass:g} kg; it can't be negative")
    given = inertial.find("inertia")
    moments: Any = (
        (0.0,) * 6
        if given is None
        else tuple(_number(given, n, where, 0.0) for n in MOMENTS)
    )
    return RobotLink(
        name, Inertial(mass, origin.xyz, moments, origin.rpy), collisions, visuals
    )


def _shapes(
    link: Element, tag: str, where: str, colors: Mapping[str, Color], file: Path | None
) -> Iterator[RobotShape]:
    elements = link.findall(tag)
    if len(elements) > MAX_PARTS:
        raise UserError(
            f"{where} has {len(elements)} <{tag}> elements; at most {MAX_PARTS} are read"
        )
    where = f"{where}: {tag}"
    for element in elements:
        geometry, material, color = (
            _child(element, "geometry", where),
            element.find("material"),
            None,
        )
        if len(geometry) != 1:
            kinds = "box, sphere, cylinder or mesh"
            raise UserError(
                f"{where}: <geometry> needs one shape: {kinds}; it has {len(geometry)}"
            )
        if material is not None:
            named = colors.get(material.get("name", ""))
            color = named if material.find("color") is None else _color(material)
        shape, scale = _geometry(geometry[0], where, file)
        yield RobotShape(shape, _origin(element, where), color, scale)


def _geometry(
    element: Element, where: str, file: Path | None
) -> tuple[Box | Sphere | Cylinder | Path, Scale]:
    inside = f"{where}: {element.tag}"

    def sizes(name: str, count: int = 1) -> Sequence[float]:
        values = _numbers(element, name, count, inside)
        if min(values) <= 0:
            raise UserError(
                f"{where}: {name} is {min(values):g}; it must be greater than 0"
            )
        return values

    match element.tag:
        case "box":
            x, y, z = sizes("size", 3)
            return Box((x, y, z)), ONE
        case "sphere":
            return Sphere(*sizes("radius")), ONE
        case "cylinder":
            return Cylinder(*sizes("radius"), *sizes("length")), ONE
        case "mesh":
            x, y, z = _numbers(element, "scale", 3, inside, ONE)
            if 0.0 in (x, y, z):
                raise UserError(
                    f"{where}: mesh scale is {x:g} {y:g} {z:g}; no factor can be 0"
                )
            name = element.get("filename") or ""
            return Path(name) if file is None else find_mesh(name, file, where), (
                x,
                y,
                z,
            )
    raise UserError(
        f"{where}: <{shorten(element.tag)[1:-1]}> is no shape of a URDF: use box, sphere, cylinder or mesh"
    )


def find_mesh(name: str, file: Path, where: str) -> Path:
    """Find a mesh as a URDF names it: absolute, relative to the URDF, ``file://``, or ``package://``.

    A package is a folder of its name that holds the URDF or lies beside or above it, or one in ROS_PACKAGE_PATH, or in
    a ``share`` of AMENT_PREFIX_PATH.

    Raises:
        UserError: the name or the package can't be resolved, or there is no such file.
    """
    scheme, _, rest = name.partition("://") if "://" in name else ("", "", name)
    if not rest or "\0" in rest or len(rest) > 4096:
        raise UserError(f"{where}: mesh has no filename that can be read")
    if scheme not in ("", "file", "package"):
        raise UserError(
            f"{where}: mesh {shorten(name)}: {scheme}:// is not read; give a path, or package://"
        )
    found = file.parent / (unquote(rest) if scheme else rest)
    if scheme == "package":
        package, _, inner = rest.partition("/")
        above = file.resolve().parents
        roots = [
            Path(root)
            for path in PACKAGE_PATHS
            for root in os.environ.get(path, "").split(os.pathsep)
            if root
        ]
        places = [*above, *roots, *(root / "share" for root in roots)]
        folders = [*above, *(folder / package for folder in places), *roots]
        home = next(
            (
                folder
                for folder in folders
                if folder.name == package and folder.is_dir()
            ),
            None,
        )
        if home is None:
            mend = (
                f"put it there, or add the folder that holds it to {PACKAGE_PATHS[0]}"
            )
            raise UserError(
                f"{where}: package {shorten(package)} is neither beside nor above the URDF; {mend}"
            )
        found = home / inner
    try:
        there = found.is_file()
    except OSError:  # a name that is too long
        there = False
    if not there:
        raise UserError(
            f"{where}: there is no mesh file {visible(str(found))} (named {shorten(name, 200)})"
        )
    return found.resolve()


def _joint(element: Element, parent: str, child: str) -> RobotJoint:
    name = element.get("name", "")
    where, kind = f"joint {name!r}", element.get("type", "")
    if kind not in _KINDS:
        raise choices("type", kind, _KINDS, where)

    def numbers(tag: str, **defaults: float | None) -> list[Any]:
        part = element.find(tag)
        written = (
            {}
            if part is None
            else {
                n: _number(part, n, f"{where}: {tag}")
                for n in defaults
                if n in part.attrib
            }
        )
        return [*(defaults | written).values()]

    about, follows = element.find("axis"), element.find("mimic")
    x, y, z = (
        (1.0, 0.0, 0.0)
        if about is None
        else _numbers(about, "xyz", 3, f"{where}: axis")
    )
    if kind in MOVING and math.hypot(x, y, z) < 1e-6:
        raise UserError(f"{where}: its axis has length 0")
    limits = Limits(*numbers("limit", **dict.fromkeys(Limits._fields)))
    damping, friction = numbers("dynamics", damping=0.0, friction=0.0)
    factors = numbers("mimic", multiplier=1.0, offset=0.0)
    mimic = None if follows is None else Mimic(follows.get("joint", ""), *factors)
    spring = (
        None
        if element.find("spring") is None
        else tuple(numbers("spring", stiffness=0.0, rest=0.0))
    )
    origin = _origin(element, where)
    return RobotJoint(
        name,
        kind,
        parent,
        child,
        origin,
        (x, y, z),
        limits,
        mimic,
        damping,
        friction,
        spring,
    )


def _child(element: Element, tag: str, where: str) -> Element:
    child = element.find(tag)
    if child is None:
        raise UserError(f"{where} has no <{tag}>")
    return child


def _origin(element: Element, where: str) -> Origin:
    origin = element.find("origin")
    if origin is None:
        return Origin()
    (x, y, z), (roll, pitch, yaw) = (
        _numbers(origin, n, 3, f"{where}: origin", ZERO) for n in ("xyz", "rpy")
    )
    return Origin((x, y, z), (roll, pitch, yaw))


def _color(material: Element) -> Color:
    where = f"material {shorten(material.get('name', ''))}"
    red, green, blue, opacity = np.clip(
        _numbers(_child(material, "color", where), "rgba", 4, where), 0.0, 1.0
    )
    return float(red), float(green), float(blue), float(opacity)


def _number(
    element: Element, name: str, where: str, default: float | None = None
) -> float:
    return _numbers(element, name, 1, where, None if default is None else (default,))[0]


def _numbers(
    element: Element,
    name: str,
    count: int,
    where: str,
    default: tuple[float, ...] | None = None,
) -> tuple[float, ...]:
    text = element.get(name)
    if text is None:
        if default is None:
            raise UserError(f"{where}: {name} is missing")
        return default
    try:
        values = tuple(
            float(word) for word in text.split() if text.isascii() and "_" not in text
        )
    except ValueError:
        values = ()
    if len(values) != count or not all(
        math.isfinite(v) and abs(v) <= MAX_NUMBER for v in values
    ):
        wanted = "a number" if count == 1 else f"{count} numbers"
        raise UserError(
            f"{where}: {name} is {shorten(text)}; expected {wanted}, finite and at most {MAX_NUMBER:g}"
        )
    return values
