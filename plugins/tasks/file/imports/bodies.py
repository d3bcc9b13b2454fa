"""Gather bodies and joints, with notes on what was left out.

Covered by `tests/plugins/tasks/file/imports/test_urdf.py` and `tests/plugins/tasks/file/test_mjcf.py`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from core.errors import UserError
from core.geometry import Mesh, Pose
from core.scene import Body, Geom, Joint, Scene

MAX_SHAPES = 2000
MAX_DRAWN = 2_000_000  # triangles


@dataclass(frozen=True)
class Imported:
    """What a file holds: bodies and joints for a `Scene`, and in words what was left out or changed."""

    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...] = ()
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        shapes = [geom.shape for body in self.bodies for geom in (*body.visuals, *body.collisions)]
        faces = sum(len(shape.faces) for shape in shapes if isinstance(shape, Mesh))
        if len(shapes) > MAX_SHAPES or faces > MAX_DRAWN:
            limits = f"at most {MAX_SHAPES} and {MAX_DRAWN}"
            raise UserError(f"there are {len(shapes)} shapes of {faces} triangles; {limits} are read: leave some out")
        Scene(self.bodies, self.joints)


def joined_body(
    name: str, pose: Pose, mass: float | None, visuals: Sequence[Geom], collisions: Sequence[Geom], friction: float
) -> Body:
    """Make a body of what is rigidly joined, of one density; without a mass it does not move.

    Raises:
        UserError: it moves, but has no mass or no collision shape.
    """
    if mass is not None and not mass > 0:
        raise UserError(f"body {name!r} moves, but has no mass; give it one")
    if mass is not None and not collisions:
        raise UserError(f"body {name!r} moves, but has no collision shape; repeat what is drawn as one")
    return Body(name, pose, mass or 0.0, tuple(visuals or collisions), tuple(collisions), friction)
