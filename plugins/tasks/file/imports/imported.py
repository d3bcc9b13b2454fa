"""Gather bodies and joints, with notes on what was left out."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from core.errors import UserError, choices
from core.geometry import Mesh, Pose
from core.goals.sites import find_names
from core.scene import Body, Geom, Joint, Scene

MAX_SHAPES = 2000
MAX_DRAWN = 2_000_000  # triangles
LIGHTEST = 1e-6  # kg
HEAVIEST = 1e4  # kg
SHORTEST_M = 1e-6
LONGEST_M = 20.0
MAX_FRICTION = 10.0
_NAME = re.compile(r"[A-Za-z0-9_.-]{1,96}")
_RENAME = "its name is not of letters, digits, '_', '.' or '-'; rename it"


@dataclass(frozen=True)
class Imported:
    """What a file holds: bodies and joints for a `Scene`, and in words what was left out or changed.

    Raises:
        UserError: it has what a scene file may not say either; names the body or joint and the number.
    """

    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...] = ()
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        shapes = 0
        faces = 0
        for body in self.bodies:
            _check_body(body)
            for geom in (*body.visuals, *body.collisions):
                shapes += 1
                if isinstance(geom.shape, Mesh):
                    faces += len(geom.shape.faces)

        for joint in self.joints:
            _check_joint(joint)

        if shapes > MAX_SHAPES or faces > MAX_DRAWN:
            limits = f"at most {MAX_SHAPES} and {MAX_DRAWN}"
            raise UserError(
                f"there are {shapes} shapes of {faces} triangles; {limits} are read: leave some out"
            )

        Scene(self.bodies, self.joints)


def _check_body(body: Body) -> None:
    """Refuse a body that has what a scene file may not say.

    Raises:
        UserError: says what.
    """
    where = f"body {body.name[:64]!r}"
    if not _NAME.fullmatch(body.name):
        raise UserError(f"{where}: {_RENAME}")
    if not 0 <= body.friction <= MAX_FRICTION:
        raise UserError(
            f"{where} has a friction of {body.friction:.3g}; 0 to {MAX_FRICTION:g} are read"
        )

    for geom in (*body.visuals, *body.collisions):
        size = geom.shape.bounds[1].max()
        distance = np.abs((body.pose @ geom.pose).position).max()
        if not (size <= LONGEST_M and distance <= LONGEST_M):
            far = f"a shape of {size:.3g} m at {distance:.3g} m from the origin"
            raise UserError(f"{where} has {far}; at most {LONGEST_M:g} m are read")

    for geom in body.collisions:
        size = geom.shape.bounds[1].min()
        if size < SHORTEST_M:
            raise UserError(
                f"{where} has a collision shape of {size:.3g} m; at least {SHORTEST_M:g} m is read"
            )


def _check_joint(joint: Joint) -> None:
    """Refuse a joint that has what a scene file may not say.

    Raises:
        UserError: says what.
    """
    if not _NAME.fullmatch(joint.name):
        raise UserError(f"joint {joint.name[:64]!r}: {_RENAME}")
    if not np.abs(joint.origin).max() <= LONGEST_M:
        raise UserError(
            f"joint {joint.name!r} is more than {LONGEST_M:g} m from its body; at most that is read"
        )


def find_left_out(
    without: Sequence[str], prefix: str, names: Iterable[str]
) -> set[str]:
    """Find the bodies of a file that an import is ``without``.

    Args:
        without: names or patterns, as the file has them or with the prefix.
        prefix: that the import puts before all names.
        names: of the file's bodies.

    Raises:
        UserError: one of them fits no body.
    """
    known = list(names)
    patterns = [pattern.removeprefix(prefix) for pattern in without]
    found = {*find_names(patterns, known)}
    for name in found.difference(known):
        raise choices("body to leave out", name, known)

    return found


def joined_body(
    name: str,
    pose: Pose,
    mass: float | None,
    visuals: Sequence[Geom],
    collisions: Sequence[Geom],
    friction: float,
) -> Body:
    """Make a body of what is rigidly joined, of one density.

    Args:
        name: the body's.
        pose: where it starts, in the file's frame.
        mass: kg; None: it does not move.
        visuals: what is drawn; where there is nothing, that is the collision shapes.
        collisions: what collides.
        friction: the coefficient.

    Raises:
        UserError: it moves, but has no mass or no collision shape.
    """
    leave_out = (
        f"leave it out, with all that hangs from it: without: [{name}] in the import"
    )
    if mass is not None:
        if not mass > 0:
            raise UserError(
                f"body {name!r} moves, but has no mass; give it one, as by density: 600 in the import, or {leave_out}"
            )
        if not LIGHTEST <= mass <= HEAVIEST:
            limits = f"{LIGHTEST:g} to {HEAVIEST:g} kg"
            raise UserError(f"body {name!r} has {mass:.3g} kg; {limits} are read")

        if not collisions:
            raise UserError(
                f"body {name!r} moves, but has no collision shape; repeat what is drawn as one, or {leave_out}"
            )

    return Body(
        name,
        pose,
        mass or 0.0,
        tuple(visuals or collisions),
        tuple(collisions),
        friction,
    )
