"""Read URDF defensively: links and joints as data. The text may be wrong in any way, and every number is checked."""

from __future__ import annotations

import math
import os
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from graphlib import CycleError, TopologicalSorter
from itertools import chain
from pathlib import Path
from typing import Any
from urllib.parse import unquote
from xml.etree.ElementTree import Element

import numpy as np

from core.errors import Problems, UserError, choices
from core.geometry import PRIMITIVES, Color, Primitive, Triple
from core.imports.near import describe_near, find_near
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
)

MAX_NUMBER = 1e6  # of any unit; keeps products finite
_KINDS = (*MOVING, "fixed", "floating", "planar")
_NO_MOMENTS = dict.fromkeys(MOMENTS, 0.0)
_PACKAGE_PATHS = ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH")


def read_urdf(
    root: Element,
    file: Path,
    without: Collection[str] = (),
    *,
    may_lack: bool = False,
    without_mesh: str = "",
) -> tuple[Description, list[str]]:
    """Read links and joints, with the paths of all mesh files.

    Args:
        root: of the URDF.
        file: where it lies.
        without: links that are left out, with all that they bear.
        may_lack: whether meshes that are only drawn may be missing; else only those of links that collide otherwise.
        without_mesh: the words that leave out a mesh that is missing, with ``{name}`` for its name; empty: none do.

    Returns:
        links and joints; and what is not where the file says, or missing, a line each.

    Raises:
        UserError: something is wrong, or meshes are missing; names all of them.
    """
    _leave_out(root, without)
    notes = _find_meshes(root, file, may_lack, without_mesh)
    return read_tree(root, file.stem), notes


def read_tree(root: Element, name: str = "") -> Description:
    """Read links and joints, the children of ``root``. The names of meshes are their paths.

    Args:
        root: of the URDF.
        name: of the robot, if ``root`` has none.

    Raises:
        UserError: something is wrong; says what, where, and how to mend it.
    """
    if root.tag != "robot":
        tag = shorten(root.tag)[1:-1]
        raise UserError(f"it is no URDF: its root is <{tag}> instead of <robot>")

    colors = {}
    for element in root.iter("material"):
        if element.find("color") is not None:
            colors[element.get("name", "")] = _read_color(element)

    links = {}
    for link, element in _find_named(root, "link").items():
        with _inside(f"link {link!r}"):
            links[link] = _read_link(element, link, colors)

    joints: dict[str, RobotJoint] = {}  # by child
    for label, element in _find_named(root, "joint").items():
        with _inside(f"joint {label!r}"):
            joint = _read_joint(element, label, links)

        if joint.child in joints:
            raise UserError(
                f"link {joint.child!r} hangs on two joints, so that links form a loop; a URDF is a tree"
            )

        joints[joint.child] = joint

    _check_tree(links, joints)
    return Description(root.get("name") or name, links, joints)


def _leave_out(root: Element, names: Collection[str]) -> None:
    """Remove links, and all that they bear, before they are read: they may be wrong in any way.

    Raises:
        UserError: there is no such link, or nothing would be left.
    """
    links = {link.get("name", ""): link for link in root.findall("link")}
    for name in names:
        if name not in links:
            raise choices("link", name, links)

    joints = [
        (joint, _named_end(joint, "parent"), _named_end(joint, "child"))
        for joint in root.findall("joint")
    ]
    left = {*names}
    count = -1
    while count < len(left):
        count = len(left)
        left |= {child for _, parent, child in joints if parent in left}

    if left and left >= links.keys():
        raise UserError(
            f"without {', '.join(names)} nothing is left; leave out less, or the whole file"
        )

    for name in left & links.keys():
        root.remove(links[name])

    for joint, _, child in joints:
        if child in left:
            root.remove(joint)


def _named_end(joint: Element, tag: str) -> str:
    """Return the name of the link at an end of a joint; empty if it has none."""
    end = joint.find(tag)
    return "" if end is None else end.get("link", "")


def _check_tree(
    links: Mapping[str, RobotLink], joints: Mapping[str, RobotJoint]
) -> None:
    """Refuse loops, and anything but one link that hangs on no joint."""
    parents = {child: [joint.parent] for child, joint in joints.items()}
    try:
        TopologicalSorter(parents).prepare()
    except CycleError as error:
        loop = " -> ".join(error.args[1])
        raise UserError(f"links form a loop: {loop}; a URDF is a tree") from error

    roots = sorted(links.keys() - joints.keys())

    if len(roots) != 1:
        found = ", ".join(roots[:5]) or "no link is left"
        raise UserError(
            f"{len(roots)} links have no parent: {found}; a URDF has one base: join the others to it with fixed joints"
        )


@contextmanager
def _inside(where: str) -> Iterator[None]:
    """Say in the messages of errors where they are."""
    try:
        yield
    except UserError as error:
        raise type(error)(f"{where}: {error}") from error
    except ValueError as error:
        raise UserError(f"{where}: {error}") from error


def _find_named(root: Element, tag: str) -> dict[str, Element]:
    """Find the elements of a kind by name."""
    found: dict[str, Element] = {}

    for element in root.findall(tag):
        name = element.get("name")
        if not name:
            raise UserError(f"a <{tag}> has no name")

        if name in found:
            raise UserError(
                f"two {tag}s are named {name!r}; each needs a name of its own"
            )

        found[name] = element

    return found


def _need(element: Element, tag: str) -> Element:
    """Find a child that has to be there."""
    child = element.find(tag)
    if child is None:
        raise UserError(f"it has no <{tag}>")
    return child


def _read_numbers(element: Element, name: str, count: int, *default: float) -> Any:
    """Read an attribute of so many numbers.

    Raises:
        UserError: it is not there and has no ``default``, or is something else.
    """
    where = f"{element.tag}: {name}"
    text = element.get(name)
    if text is None:
        if not default:
            raise UserError(f"{where} is missing")
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
            f"{where} is {shorten(text)}; expected {wanted}, finite and at most {MAX_NUMBER:g}"
        )

    return values


def _read_fields(element: Element, tag: str, **fields: Any) -> dict[str, Any]:
    """Read the numbers that a child has of these, which have their defaults."""
    child = element.find(tag)
    if child is not None:
        for name in fields.keys() & child.attrib.keys():
            (fields[name],) = _read_numbers(child, name, 1)

    return fields


def _read_origin(element: Element) -> Origin:
    """Read where an element is; without an origin it is where its parent is."""
    origin = element.find("origin")
    if origin is None:
        return Origin()

    xyz = _read_numbers(origin, "xyz", 3, *ZERO)
    return Origin(xyz, _read_numbers(origin, "rpy", 3, *ZERO))


def _read_link(
    element: Element,
    name: str,
    colors: Mapping[str, Color],
) -> RobotLink:
    """Read a link.

    Args:
        element: the link.
        name: of the link.
        colors: those of the robot's materials, by name.
    """
    collisions = _read_shapes(element, "collision", colors)
    visuals = _read_shapes(element, "visual", colors)
    inertial = element.find("inertial")

    if inertial is None:
        return RobotLink(name, Inertial(), collisions, visuals)

    with _inside("inertial"):
        (mass,) = _read_numbers(_need(inertial, "mass"), "value", 1)
        if mass < 0:
            raise UserError(f"mass is {mass:g} kg; it can't be negative")

        origin = _read_origin(inertial)
        moments: Any = _read_fields(inertial, "inertia", **_NO_MOMENTS).values()

    weight = Inertial(mass, origin.xyz, tuple(moments), origin.rpy)
    return RobotLink(name, weight, collisions, visuals)


def _read_shapes(
    link: Element, tag: str, colors: Mapping[str, Color]
) -> tuple[RobotShape, ...]:
    """Read shapes of a link.

    Args:
        link: has the shapes.
        tag: ``collision`` or ``visual``.
        colors: those of the robot's materials, by name.
    """
    shapes = []

    for element in link.findall(tag):
        color = None
        material = element.find("material")
        if material is not None:
            color = colors.get(material.get("name", ""))
            if material.find("color") is not None:
                color = _read_color(material)

        with _inside(tag):
            shape, scale = _read_geometry(_need(element, "geometry"))
            shapes.append(RobotShape(shape, _read_origin(element), color, scale))

    return tuple(shapes)


def _read_geometry(geometry: Element) -> tuple[Primitive | Path, Triple]:
    """Read a shape, or the path of a mesh; and its scale.

    Raises:
        UserError: there is not exactly one, it is of another kind, or a number is wrong.
    """
    if len(geometry) != 1:
        raise UserError(
            f"<geometry> needs one shape: box, sphere, cylinder or mesh; it has {len(geometry)}"
        )

    (element,) = geometry
    if element.tag == "mesh":
        scale = _read_numbers(element, "scale", 3, *ONE)
        if 0.0 in scale:
            given = shorten(element.attrib["scale"])
            raise UserError(f"mesh scale is {given}; no factor can be 0")

        return Path(element.get("filename", "")), scale

    if element.tag in PRIMITIVES and PRIMITIVES[element.tag].in_urdf:
        kind = PRIMITIVES[element.tag]
        lengths = kind.lengths().items()
        numbers = [_read_numbers(element, name, count) for name, count in lengths]
        return kind.of(*chain.from_iterable(numbers)), ONE

    tag = shorten(element.tag)[1:-1]
    raise UserError(f"<{tag}> is no shape of a URDF: use box, sphere, cylinder or mesh")


def _find_meshes(
    root: Element, file: Path, may_lack: bool, without_mesh: str
) -> list[str]:
    """Put the paths of all mesh files into a URDF.

    Args:
        root: of the URDF.
        file: where it lies.
        may_lack: whether meshes that are only drawn may be missing; else only those of links that collide otherwise.
        without_mesh: the words that leave out a mesh that is missing; see `read_urdf`.

    Returns:
        what is not where the file says, or missing, a line each.

    Raises:
        UserError: names all that are needed and missing.
    """
    notes = list[str]()
    near: dict[str, Path] = {}
    wrong = Problems()
    for link in root.findall("link"):
        solid = link.findall("collision")
        drawn = link.findall("visual")
        for element in (*solid, *drawn):
            mesh = element.find("geometry/mesh")
            if mesh is None:
                continue

            where = f"link {link.get('name')!r}: {element.tag}"
            name = mesh.get("filename", "")
            try:
                found = _find_mesh(name, file, near)
                mesh.set("filename", str(found))
            except UserError as error:
                if element in drawn and (solid or may_lack):
                    notes.append(f"not drawn: {where}: {error}")
                    link.remove(element)
                else:
                    remedy = without_mesh.format(name=shorten(name)[1:-1])
                    or_leave = f", or {remedy}" if remedy else ""
                    wrong.append(UserError(f"{where}: {error}{or_leave}"))

    wrong.report()
    return notes + describe_near(near)


def _find_mesh(named: str, file: Path, near: dict[str, Path]) -> Path:
    """Find a mesh as a URDF names it: absolute, relative to the URDF, ``file://``, or ``package://``.

    A package is a folder of its name that holds the URDF or lies beside or above it, or one in ROS_PACKAGE_PATH, or in
    a ``share`` of AMENT_PREFIX_PATH. What is found elsewhere is noted in ``near``.

    Raises:
        UserError: the name can't be resolved, or there is no such file.
    """
    name = named.strip().replace("\\", "/")
    scheme, _, path = name.rpartition("://")

    if not path:
        raise UserError("mesh has no filename that can be read")

    if scheme not in ("", "file", "package"):
        raise UserError(
            f"mesh {shorten(name)}: {scheme}:// is not read; give a path, or package://"
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

    alike = find_near(name, file)
    if alike is not None:
        near[named] = alike
        return alike

    holding = [f for f in folders if os.path.isdir(f / package)]  # noqa: PTH112
    wanted = visible(str((holding or folders)[0] / path))
    raise UserError(
        f"there is no mesh file {wanted} (named {shorten(name, 200)}){mend}"
    )


def _package_folders() -> Iterator[Path]:
    """Yield the folders outside the URDF's own in which packages may lie."""
    for variable in _PACKAGE_PATHS:
        for name in filter(None, os.environ.get(variable, "").split(os.pathsep)):
            root = Path(name)
            yield from (root, root / "share", root.parent)


def _read_joint(element: Element, name: str, links: Collection[str]) -> RobotJoint:
    """Read a joint between two of the links.

    Raises:
        UserError: it is of no kind of joint, a link at its end is missing, or a number is wrong.
    """
    parent = _find_end(element, "parent", links)
    child = _find_end(element, "child", links)
    kind = element.get("type", "")

    if kind not in _KINDS:
        raise choices("type", kind, _KINDS)

    direction = RobotJoint.axis
    axis = element.find("axis")
    if axis is not None:
        direction = _read_numbers(axis, "xyz", 3)

    if kind in MOVING and math.hypot(*direction) < 1e-6:
        raise UserError("its axis has length 0")

    limits = _read_fields(element, "limit", **Limits()._asdict())
    mimic = element.find("mimic")
    factors = _read_fields(element, "mimic", multiplier=1.0, offset=0.0)
    spring = _read_fields(element, "spring", stiffness=0.0, rest=0.0)
    return RobotJoint(
        name,
        kind,
        parent,
        child,
        _read_origin(element),
        direction,
        Limits(**limits),
        None if mimic is None else Mimic(mimic.get("joint", ""), **factors),
        **_read_fields(element, "dynamics", damping=0.0, friction=0.0),
        spring=tuple(spring.values()) if element.find("spring") is not None else None,
    )


def _find_end(joint: Element, tag: str, links: Collection[str]) -> str:
    """Find the link at an end of a joint."""
    name = _named_end(joint, tag)
    if not name:
        raise UserError(f'it names no {tag}; add <{tag} link="..."/>')
    if name not in links:
        raise choices("link", name, links)

    return name


def _read_color(material: Element) -> Color:
    """Read the colour of a material; what is below 0 or above 1 is taken to be meant as the end."""
    with _inside(f"material {shorten(material.get('name', ''))}"):
        rgba = _read_numbers(_need(material, "color"), "rgba", 4)

    return tuple(np.clip(rgba, 0.0, 1.0).tolist())
