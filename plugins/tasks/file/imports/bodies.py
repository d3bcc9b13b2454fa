"""Gather bodies and joints, with notes on what was left out.

Covered by `tests/plugins/tasks/file/imports/test_urdf.py` and `tests/plugins/tasks/file/test_mjcf.py`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from core.errors import UserError
from core.geometry import Mesh, Pose
from core.robot.description import merged
from core.scene import Body, Geom, Joint, Scene
from core.values.descriptions import Weight

MAX_SHAPES = 2000
MAX_DRAWN = 2_000_000  # triangles
_OFF = 0.1


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


def heavy_body(
    name: str,
    pose: Pose,
    weights: Sequence[Weight],
    visuals: Sequence[Geom],
    collisions: Sequence[Geom],
    friction: float,
    notes: list[str],
) -> Body:
    """Make a body that moves, and note if the file's inertia is not that of its collision parts at one density."""
    weights = [weight for weight in weights if weight[0] > 0]
    if not weights:
        raise UserError(f"body {name!r} moves, but has no mass; give it one")
    if not collisions:
        raise UserError(f"body {name!r} moves, but has no collision shape; repeat what is drawn as one")
    mass, center, tensor = merged(weights)
    body = Body(name, pose, mass, tuple(visuals or collisions), tuple(collisions), friction)
    own, size = body.inertia(), np.trace(tensor)
    if size > 0:
        axes, moved = own.frame.rotation.as_matrix(), float(np.linalg.norm(own.frame.position - center))
        turned = np.linalg.norm(axes @ np.diag(own.moments) @ axes.T - tensor) / np.linalg.norm(tensor)
        if max(turned, moved / np.sqrt(size / 2 / mass)) > _OFF:
            what = f"its inertia differs by {turned:.0%}, its centre of mass by {1000 * moved:.1f} mm"
            notes.append(f"body {name!r}: {what}: one density is assumed for its collision shapes")
    return body


def still_body(name: str, pose: Pose, visuals: Sequence[Geom], collisions: Sequence[Geom], friction: float) -> Body:
    """Make a body that does not move."""
    return Body(name, pose, 0.0, tuple(visuals or collisions), tuple(collisions), friction)
