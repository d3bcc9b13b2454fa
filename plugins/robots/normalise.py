"""Make a description anew with what every engine reads alike: convex hulls, whole inertias, limits of all joints."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from core.errors import UserError
from core.geometry import Color, Pose
from core.robot.description import merge_inertias
from core.values.descriptions import (
    DIGITS,
    Description,
    Inertial,
    Origin,
    RobotJoint,
    RobotLink,
    RobotShape,
    Weight,
)
from plugins.robots.hulls import hull_file, main_color, visual_file

ALSO = "; and "  # between one problem and the next
_ROUNDED = 0.01  # of the largest moment: an inertia that is off by less was rounded
# Of a base without one: it stays, but engines want a mass.
_BASE = Inertial(1.0, moments=(0.01, 0.0, 0.0, 0.01, 0.0, 0.01))
_GREY: Color = (0.7, 0.7, 0.7, 1.0)

T = TypeVar("T")


class Problems(list[UserError]):
    """What is wrong with an arm, collected, so that a person reads all of it at once."""

    def attempt(self, make: Callable[..., T], *given: Any) -> T | None:
        """Call a function; None: it raised an error, which is noted."""
        try:
            return make(*given)
        except UserError as error:
            self.append(error)
            return None

    def report(self) -> None:
        """Raise one error for all that was noted, of the first one's type."""
        if self:
            raise type(self[0])(ALSO.join(map(str, self)))


def normalise(
    description: Description,
    drives: Mapping[str, RobotJoint],
    flange: str,
    detached: Sequence[str],
) -> Description:
    """Make each group of rigidly joined links one link, under the name of the first.

    Args:
        description: of the robot.
        drives: the joints that move, by name; all others are fixed.
        flange: a link that stays, as a frame.
        detached: links that are not always there, and so stay apart from what bears them.

    Raises:
        UserError: a link that moves lacks mass or a physical inertia, or a mesh can't be used.
    """
    heads = [
        name
        for name, joint in description.joints.items()
        if joint.name in drives or name in detached
    ]
    parts = description.rigid_parts(heads)
    links = dict[str, RobotLink]()
    joints = dict[str, RobotJoint]()
    wrong = Problems()
    for head in (description.root, *heads):
        joined = [
            (description.links[name], pose)
            for name, (first, pose) in parts.items()
            if first == head
        ]
        links[head] = wrong.attempt(
            _joined, head, joined, head == description.root
        ) or RobotLink(head)

    wrong.report()

    for head in heads:
        joint = description.joints[head]
        parent, pose = parts[joint.parent]
        origin = Origin.from_pose(pose @ joint.origin.pose, DIGITS)
        moving = drives.get(joint.name)
        joints[head] = RobotJoint(joint.name, "fixed", parent, head, origin)
        if moving is not None:
            x, y, z = joint.direction.tolist()
            joints[head] = replace(
                joints[head], kind=moving.kind, axis=(x, y, z), limits=moving.limits
            )

    if flange not in links:
        head, pose = parts[flange]
        links[flange] = RobotLink(flange)
        joints[flange] = RobotJoint(
            description.joints[flange].name,
            "fixed",
            head,
            flange,
            Origin.from_pose(pose, DIGITS),
        )

    return Description(description.name, links, joints)


def _joined(
    head: str, parts: Sequence[tuple[RobotLink, Pose]], base: bool
) -> RobotLink:
    """Make rigidly joined links, at poses in the frame of the first, one. A base needs no inertia of its own."""
    try:
        inertial = Inertial.from_tensor(*_inertia(head, parts), form=DIGITS)
    except UserError:
        if not base:
            raise
        # Without shapes it is only a frame.
        solid = any(link.collisions for link, _ in parts)
        inertial = _BASE if solid else Inertial()

    visuals = []
    collisions = []
    for link, pose in parts:
        for shape in link.visuals or link.collisions:
            visuals.append(_read_alike(shape, pose, True))
        for shape in link.collisions:
            collisions.append(_read_alike(shape, pose, False))

    return RobotLink(head, inertial, tuple(collisions), tuple(visuals))


def _inertia(head: str, parts: Sequence[tuple[RobotLink, Pose]]) -> Weight:
    """Merge the inertias of rigidly joined links, in the frame of the first one.

    Raises:
        UserError: there is no mass, or no body could have these moments.
    """
    where = f"link {head!r}"
    if len(parts) > 1:
        where += f" with what is fixed to it ({len(parts) - 1} more)"
    heavy = []
    for link, pose in parts:
        if link.inertial.mass > 0:
            heavy.append(link.inertial.placed(pose))

    if not heavy:
        raise UserError(
            f"{where} moves, but has no mass; give it <inertial> with mass and inertia"
        )

    mass, center, tensor = merge_inertias(heavy)
    moments = np.linalg.eigvalsh(tensor)
    if not moments[0] > 0:
        raise UserError(
            f"{where} has {mass:g} kg, but an inertia that is not positive; give ixx, iyy and izz, kg m^2"
        )

    lacking = float(moments[2] - moments[0] - moments[1])
    if lacking > _ROUNDED * moments[2]:
        shown = ", ".join(f"{moment:.3g}" for moment in moments)
        rule = "of no body is one larger than the two others together"
        raise UserError(
            f"{where} has moments of inertia {shown} kg m^2; {rule}: look at its units and signs"
        )

    return mass, center, tensor + max(0.0, lacking * 1.001) * np.eye(3)


def _read_alike(shape: RobotShape, pose: Pose, drawn: bool) -> RobotShape:
    """Place a shape in the frame of another link, with a mesh that every engine reads alike."""
    color = shape.color or _GREY
    file = shape.shape
    origin = Origin.from_pose(pose @ shape.origin.pose, DIGITS)
    if not isinstance(file, Path):
        return RobotShape(file, origin, color)
    if not drawn:
        return RobotShape(hull_file(file, shape.scale), origin, color)
    visual = visual_file(file, color, shape.scale)
    return RobotShape(visual, origin, main_color(visual) or color)
