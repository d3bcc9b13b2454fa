"""Make a description anew with what every engine reads alike: convex hulls, whole inertias, limits of all joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from core.errors import Problems, UserError
from core.geometry import Pose
from core.robot.description import merge_inertias
from core.values.descriptions import (
    DIGITS,
    Description,
    Inertial,
    RobotJoint,
    RobotLink,
    RobotShape,
    Weight,
)
from plugins.robots.hulls import GREY, make_all, make_shape

_ROUNDED = 0.01  # of the largest moment: an inertia that is off by less was rounded
# Of a base without one: it stays, but engines want a mass.
_BASE = Inertial(1.0, moments=(0.01, 0.0, 0.0, 0.01, 0.0, 0.01))


def normalise(
    description: Description,
    flange: str,
    detached: Sequence[str],
) -> Description:
    """Make each group of rigidly joined links one link, under the name of the first. No mesh is read.

    Args:
        description: of the robot.
        flange: a link that stays, as a frame.
        detached: links that are not always there, and so stay apart from what bears them.

    Raises:
        UserError: a link that moves lacks mass or a physical inertia.
    """
    heads = [
        name
        for name, joint in description.joints.items()
        if joint.kind != "fixed" or name in detached
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
            _join, head, joined, head == description.root
        ) or RobotLink(head)

    wrong.report()

    for head in heads:
        joint = description.joints[head]
        parent, pose = parts[joint.parent]
        place = pose @ joint.origin.pose
        joints[head] = RobotJoint.fixed(joint.name, parent, head, place, DIGITS)
        if joint.kind != "fixed":
            axis = tuple(joint.direction.tolist())
            joints[head] = replace(
                joints[head], kind=joint.kind, axis=axis, limits=joint.limits
            )

    if flange not in links:
        links[flange] = RobotLink(flange)
        name = description.joints[flange].name
        head, pose = parts[flange]
        joints[flange] = RobotJoint.fixed(name, head, flange, pose, DIGITS)

    return Description(description.name, links, joints)


def _join(head: str, parts: Sequence[tuple[RobotLink, Pose]], base: bool) -> RobotLink:
    """Make rigidly joined links, at poses in the frame of the first, one. A base needs no inertia of its own."""
    try:
        inertial = Inertial.from_tensor(*_inertia(head, parts), form=DIGITS)
    except UserError:
        if not base:
            raise

        # Without shapes it is only a frame.
        solid = any(link.collisions for link, _ in parts)
        inertial = _BASE if solid else Inertial()

    visuals = list[RobotShape]()
    collisions = list[RobotShape]()
    for link, pose in parts:
        drawn = link.visuals or link.collisions
        visuals += [_place(shape, pose) for shape in drawn]
        collisions += [_place(shape, pose) for shape in link.collisions]

    return RobotLink(head, inertial, tuple(collisions), tuple(visuals))


def _place(shape: RobotShape, pose: Pose) -> RobotShape:
    """Place a shape in the frame of another link."""
    return replace(shape.placed(pose), color=shape.color or GREY)


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
            f"{where} moves, but has no mass; give it <inertial> with mass and inertia, or the mass of the whole arm, "
            "which is spread over the collision shapes of links that have none: robot.mass_kg=KG"
        )

    mass, center, tensor = merge_inertias(heavy)
    moments = np.linalg.eigvalsh(tensor)
    if not moments[0] > 0:
        raise UserError(
            f"{where} has {mass:g} kg, but an inertia that is not positive; give ixx, iyy and izz, kg m^2, or "
            "robot.mass_kg=KG of the whole arm, so that it is computed"
        )

    lacking = float(moments[2] - moments[0] - moments[1])
    if lacking > _ROUNDED * moments[2]:
        shown = ", ".join(f"{moment:.3g}" for moment in moments)
        rule = "of no body is one larger than the two others together"
        raise UserError(
            f"{where} has moments of inertia {shown} kg m^2; {rule}: look at its units and signs"
        )

    return mass, center, tensor + max(0.0, lacking * 1.001) * np.eye(3)


def read_meshes(description: Description, notes: list[str]) -> Description:
    """Replace meshes by those that every engine reads alike; what can't be drawn is noted.

    Raises:
        UserError: a mesh that collides can't be used; names all of them.
    """
    make_all(description.links.values())
    wrong = Problems()
    links = {}
    for name, link in description.links.items():
        not_drawn = Problems()
        collisions = [
            wrong.attempt(make_shape, shape, False) for shape in link.collisions
        ]
        visuals = [not_drawn.attempt(make_shape, shape, True) for shape in link.visuals]
        notes += [f"link {name!r}: not drawn: {error}" for error in not_drawn]
        solid = tuple(filter(None, collisions))
        drawn = tuple(filter(None, visuals)) or solid
        links[name] = replace(link, collisions=solid, visuals=drawn)

    wrong.report()
    return replace(description, links=links)
