"""Make bodies and joints of a URDF file."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Container, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Literal
from xml.etree.ElementTree import Element

import numpy as np
from scipy.spatial.transform import Rotation

from core.errors import UserError
from core.geometry import Color, Pose
from core.scene import Body, Geom, Joint
from core.support.cli import expand
from core.values.descriptions import Description, RobotJoint, RobotLink, RobotShape
from core.values.urdf import MAX_BYTES, find_mesh, read_tree, read_xml
from plugins.tasks.file.imports.imported import Imported, find_left_out, joined_body
from plugins.tasks.file.imports.solids import KINDS, load_solid, read_inside

_FRICTION = 0.5
_READ = ("link", "joint", "material")
_GREY: Color = (0.7, 0.7, 0.7, 1.0)


def read_urdf(
    file: str | Path,
    *,
    fixed: bool = True,
    prefix: str = "",
    folder: Path | None = None,
    without: Sequence[str] = (),
) -> Imported:
    """Make bodies and joints of a URDF file: a body of all links that are rigidly joined, named like the first.

    A joint starts at 0, or at the end of its range that is next to it. Meshes are OBJ, STL or GLB, in the file's own
    axes, cut into convex parts as `read_mesh` does.

    Args:
        file: the URDF.
        fixed: whether the root is fixed to the world; it need not be there then.
        prefix: put before all names.
        folder: where all files must lie; None: where the URDF is.
        without: names of links, or patterns, that are left out with all that hangs from them.

    Raises:
        UserError: says what can't be used, where, and how to mend it.
    """
    file = expand(file).absolute()
    folder = folder or file.parent
    data = read_inside(file, folder, "URDF", MAX_BYTES / 1e6)
    root = read_xml(data, file)
    tags = Counter(str(element.tag) for element in root)
    left = {tag: count for tag, count in tags.items() if tag not in _READ}
    notes = [f"left out: {count} <{tag[:40]}>" for tag, count in left.items()]

    try:
        _leave_out(root, without, prefix)
        description = read_tree(root, find=partial(find_mesh, file=file))
        return _UrdfBodies(description, folder, prefix, notes).read(fixed)
    except (UserError, ValueError) as error:
        raise UserError(f"{file}: {error}") from error


def _leave_out(root: Element, without: Sequence[str], prefix: str) -> None:
    """Take links out of a URDF's root, with all that hangs from them.

    Raises:
        UserError: one of them is not there, or nothing would be left.
    """
    links = {link.get("name", ""): link for link in root.findall("link")}
    left = find_left_out(without, prefix, links)
    joints = root.findall("joint")
    hung = [(joint, *_find_ends(joint)) for joint in joints]
    count = -1

    while count < len(left):
        count = len(left)
        left |= {child for _, parent, child in hung if parent in left}

    if left and left >= links.keys():
        raise UserError(
            f"without {', '.join(without)} nothing is left; leave out less, or the whole import"
        )

    for name in left & links.keys():
        root.remove(links[name])

    for joint, _, child in hung:
        if child in left:
            root.remove(joint)


def _find_ends(joint: Element) -> tuple[str, str]:
    """Find the names of a joint's parent and child; empty where they are missing."""
    names = []
    for tag in ("parent", "child"):
        end = joint.find(tag)
        names.append("" if end is None else end.get("link", ""))

    parent, child = names
    return parent, child


class _UrdfBodies:
    """Bodies and joints of a URDF file, and notes on what was left out."""

    def __init__(
        self, description: Description, folder: Path, prefix: str, notes: list[str]
    ) -> None:
        self._description = description
        self._folder = folder
        self._prefix = prefix
        self._notes = notes

    def read(self, fixed: bool) -> Imported:
        """Make the bodies, the root first, and the joints between them."""
        tree = self._description
        moving = {
            child: joint for child, joint in tree.joints.items() if self._moves(joint)
        }
        parts = tree.rigid_parts(moving)
        places = {tree.root: Pose()}
        bodies = dict[str, Body]()
        joints = list[Joint]()
        heads = {tree.root, *moving}
        for head in sorted(heads, key=lambda link: len(tree.above(link))):
            if head != tree.root:
                joint = moving[head]
                parent, place = parts[joint.parent]
                frame = places[parent] @ place @ joint.origin.pose
                places[head] = frame @ _moved(joint)
                if joint.kind != "floating":
                    joints.append(self._joint(joint, parent, bodies))

            links = [
                (tree.links[name], place)
                for name, (first, place) in parts.items()
                if first == head
            ]
            stays = fixed and head == tree.root
            body = self._body(head, places[head], links, fixed=stays)
            if body is not None:
                bodies[head] = body

        limits = [joint.limits for joint in moving.values()]
        if any(limit.effort or limit.velocity for limit in limits):
            self._notes.append(
                "left out: limits of effort and velocity, as nothing drives the joints"
            )

        return Imported(tuple(bodies.values()), tuple(joints), tuple(self._notes))

    def _moves(self, joint: RobotJoint) -> bool:
        """Tell whether a joint moves, and note what it does not do."""
        where = f"joint {joint.name!r}"
        if joint.kind == "planar":
            self._notes.append(f"{where} is planar, which can't be; it is fixed")
        if joint.mimic:
            self._notes.append(
                f"{where} mimics another one, which is left out; it moves by itself"
            )

        if joint.kind in ("revolute", "prismatic"):
            lower, upper = joint.range
            if lower > upper:
                raise UserError(
                    f"{where} has limits {lower:g} to {upper:g}; exchange them"
                )

            if lower == upper:
                self._notes.append(f"{where} has no range, so that it is fixed")
                return False

            if _turns_freely(joint):
                self._notes.append(
                    f"{where} may turn a whole turn, so that it has no limits"
                )

        return joint.kind not in ("fixed", "planar")

    def _joint(self, joint: RobotJoint, parent: str, bodies: Container[str]) -> Joint:
        """Make a joint; where its parent is none of the bodies, that is the world."""
        kind: Literal["hinge", "slider"] = "hinge"
        if joint.kind == "prismatic":
            kind = "slider"

        bearer = None
        if parent in bodies:
            bearer = self._prefix + parent

        found = Joint(
            self._prefix + joint.name,
            kind,
            self._prefix + joint.child,
            bearer,
            axis=joint.direction,
            damping=joint.damping,
            friction=joint.friction,
        )
        if joint.kind == "continuous" or _turns_freely(joint):
            return found

        lower, upper = joint.range
        return replace(found, lower=lower, upper=upper, start=_start(joint))

    def _body(
        self,
        head: str,
        pose: Pose,
        links: Sequence[tuple[RobotLink, Pose]],
        *,
        fixed: bool,
    ) -> Body | None:
        """Make a body of links that are rigidly joined, each with its pose; None: nothing is there."""
        visuals = list[Geom]()
        for link, place in links:
            for shape in link.visuals:
                visuals += self._geoms(shape, place, drawn=True)

        collisions = list[Geom]()
        for link, place in links:
            for shape in link.collisions:
                collisions += self._geoms(shape, place, drawn=False)

        mass = None
        if not fixed:
            mass = sum(link.inertial.mass for link, _ in links)
        elif not (visuals or collisions):
            return None

        name = self._prefix + head
        return joined_body(name, pose, mass, visuals, collisions, _FRICTION)

    def _geoms(self, shape: RobotShape, place: Pose, *, drawn: bool) -> list[Geom]:
        """Make what is drawn of a shape, or what collides."""
        pose = place @ shape.origin.pose
        color = shape.color or _GREY
        if not isinstance(shape.shape, Path):
            return [Geom(shape.shape, pose, color)]
        if drawn and shape.shape.suffix.lower() not in KINDS:
            self._notes.append(
                f"left out: what is drawn of {shape.shape.name}; {', '.join(KINDS)} are read"
            )
            return []

        solid = load_solid(shape.shape, self._folder, shape.scale, drawn_only=drawn)
        if drawn:
            return [Geom(mesh, pose, known or color) for mesh, known in solid.drawn]

        return [Geom(part, pose, color) for part in solid.parts]


def _turns_freely(joint: RobotJoint) -> bool:
    """Check if a joint's limits let it turn a whole turn."""
    if joint.kind != "revolute":
        return False

    lower, upper = joint.range
    return upper - lower >= 2 * math.pi


def _start(joint: RobotJoint) -> float:
    """Return the position at which a joint starts, rad or m: the one in its range next to 0."""
    if joint.kind not in ("revolute", "prismatic"):
        return 0.0

    lower, upper = joint.range
    return min(max(0.0, lower), upper)


def _moved(joint: RobotJoint) -> Pose:
    """Return how a joint's start moves what hangs from it."""
    if joint.kind == "prismatic":
        return Pose(joint.direction * _start(joint))

    turn = Rotation.from_rotvec(joint.direction * _start(joint))
    return Pose.from_rotation(np.zeros(3), turn)
