"""Tell what a file is that others made: an arm, a gripper, things for a scene, or a part of an MJCF model."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path
from xml.etree.ElementTree import Element

from core.errors import UserError
from core.imports.documents import MAX_BYTES, read_root, read_xml
from core.imports.meshes import KINDS
from core.imports.urdf import read_tree
from core.support.files import read_untrusted
from core.values.descriptions import MOVING, Description

ARM = "arm"
GRIPPER = "gripper"
SCENE = "scene"
_ARM_JOINTS = 3  # one after the other: a cabinet's door bears a handle, and no more
_OPPOSITE = -0.9  # cosine between the ways in which two fingers open
_MOST_INCLUDED = 20
_HINGES = (None, "hinge")


def tell_kind(file: Path) -> str:
    """Tell what a file is: `ARM`, `GRIPPER` or `SCENE`.

    An arm has three driven joints or more, one after the other. A gripper has two fingers that slide apart, and no arm.

    Raises:
        UserError: it is of no kind that is read; says what it is, and the command that makes of it what is read.
    """
    if file.suffix.lower() in KINDS:
        return SCENE

    root = read_root(read_untrusted(file, MAX_BYTES), file)
    if root.tag == "mujoco":
        chains = _list_chains(root, file)
        return ARM if max(chains, default=0) >= _ARM_JOINTS else SCENE

    try:
        description = read_tree(root)
    except UserError as error:
        raise UserError(f"{file}: {error}") from error

    if _measure_chain(description) >= _ARM_JOINTS:
        return ARM

    return GRIPPER if find_fingers(description) else SCENE


def _measure_chain(description: Description) -> int:
    """Count the joints of the longest chain in which one at least is driven."""
    longest = 0
    for link in description.links:
        above = description.above(link)[:-1]
        joints = [description.joints[name] for name in above]
        moving = [joint for joint in joints if joint.kind in MOVING]
        driven = [j for j in moving if j.limits.effort or j.limits.velocity]
        if driven:
            longest = max(longest, len(moving))

    return longest


def find_fingers(
    description: Description, beyond: str | None = None
) -> tuple[str, str] | None:
    """Find the two joints of a parallel gripper: driven slides of one part that open in opposite ways, from 0.

    Args:
        description: of a file.
        beyond: the link that has to bear them; None: any.
    """
    slides = [
        joint
        for joint in description.joints.values()
        if joint.kind == "prismatic"
        and joint.range[0] == 0
        and (joint.limits.effort or joint.mimic)
        and (beyond is None or beyond in description.above(joint.parent))
    ]
    parts = description.rigid_parts(joint.child for joint in slides)
    opening = []
    for joint in slides:
        head, pose = parts[joint.parent]
        frame = pose @ joint.origin.pose
        opening.append((joint.name, head, frame.rotation.apply(joint.direction)))

    for (first, head, way), (second, other, back) in combinations(opening, 2):
        if head == other and way @ back < _OPPOSITE:
            return first, second

    return None


def _list_chains(root: Element, file: Path) -> Iterator[int]:
    """Yield for each body of an MJCF file how many joints move it against the world."""
    waiting = [
        (element, 0)
        for top in _include(root, file)
        for element in top.iter("worldbody")
    ]
    while waiting:
        element, above = waiting.pop()
        joints = [
            joint
            for joint in element.findall("joint")
            if joint.get("type") not in ("free", "ball")
        ]
        count = above + len(joints)
        yield count
        waiting += [
            (child, count) for child in element if child.tag in ("body", "frame")
        ]


def _include(root: Element, file: Path) -> list[Element]:
    """List the roots of an MJCF file and of those that it includes."""
    found = [root]
    names = {file.resolve()}
    for element in found:
        for include in element.iter("include"):
            other = (file.parent / include.get("file", "")).resolve()
            if other not in names and len(names) < _MOST_INCLUDED and other.is_file():
                names.add(other)
                found.append(read_xml(read_untrusted(other, MAX_BYTES), other))

    return found


def find_radians(root: Element) -> bool:
    """Tell whether an MJCF file's ranges are hardly meant in degrees, as they count unless its compiler says radian."""
    if any(compiler.get("angle") for compiler in root.iter("compiler")):
        return False

    ends = []
    for joint in root.iter("joint"):
        if joint.get("type") in _HINGES:
            ends += [abs(float(end)) for end in joint.get("range", "").split()]

    return 0 < max(ends, default=0) <= 2 * math.pi
