"""Describe bodies to a designer that is told no number of them."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from core.geometry import Array, Pose
from core.interfaces import Task
from core.scene import Body, Soft
from plugins.vlms.context.phrases import phrase, table

_FLAT_M = 1e-9  # what is thinner has no ends

_NUMBERED = re.compile(r"_?\d+$")


def bodies_table(task: Task, seed: int) -> str:
    """Write a row for each body, or for bodies alike: how it moves, its weight, and where its frame's origin is.

    Bodies are alike if their rows differ in nothing but the number at the end of their names.

    Args:
        task: whose scene it is.
        seed: of the layout.

    Returns:
        A table in Markdown, such as::

            | body | is | weight | origin, from low to high end |
            | --- | --- | --- | --- |
            | cube_1 ... cube_4 (4) | free | light | centre |
    """
    scene = task.scene(seed)
    jointed = {joint.body for joint in scene.joints}

    names: dict[tuple[str, ...], list[str]] = {}
    for body in scene.bodies:
        is_jointed = body.name in jointed
        row = (
            _NUMBERED.sub("", body.name),  # what it shares with bodies alike
            phrase("bodies", "kind", body, isinstance(body, Soft), is_jointed),
            phrase("bodies", "weight", body.mass),
            _describe_origin(body),
        )
        names.setdefault(row, []).append(body.name)

    rows = []
    for (_, *cells), alike in names.items():
        name = alike[0]
        if len(alike) > 1:
            name += f" ... {alike[-1]} ({len(alike)})"
        rows.append((name, *cells))

    return table(("body", "is", "weight", "origin, from low to high end"), rows)


def bounds(body: Body, pose: Pose) -> tuple[Array, Array]:
    """Compute the lowest and the highest corner (3,) of a body's shapes in a frame in which it has this pose.

    Args:
        body: rigid or soft; the shapes that collide count, or those that are drawn where none does. Without any it is
            as large as its origin.
        pose: of the body in the frame; that of the scene for bounds in the world.

    For example, a body's size along its own axes::

        low, high = bounds(body, Pose())
        size = high - low
    """
    parts = body.collisions or body.visuals
    if not parts:
        return pose.position, pose.position

    points = []
    for part in parts:
        vertices = np.asarray(part.shape.to_trimesh().vertices)
        points.append((pose @ part.pose).apply(vertices))

    corners = np.concatenate(points)

    return corners.min(axis=0), corners.max(axis=0)


def bounds_in_world(bodies: Sequence[Body]) -> tuple[Array, Array]:
    """Compute the lowest and the highest corner (3,) of bodies in the world.

    Args:
        bodies: where they are in the layout; one or more.
    """
    lows, highs = zip(*[bounds(body, body.pose) for body in bodies], strict=True)
    return np.min(lows, axis=0), np.max(highs, axis=0)


def _describe_origin(body: Body) -> str:
    """Name the place of a body's origin between its ends along its own axes.

    Args:
        body: rigid or soft, anywhere.
    """
    low, high = bounds(body, Pose())
    size = high - low
    shares = np.where(size > _FLAT_M, -low / np.maximum(size, _FLAT_M), 0.5)
    places = [phrase("bodies", "place", share) for share in shares.tolist()]
    if places == ["middle"] * 3:
        return "centre"

    return ", ".join(map(" ".join, zip("xyz", places, strict=True)))
