"""Describe bodies to a designer that is told no number of them."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from core.geometry import Array, Pose
from core.interfaces import Task
from core.scene import Body, Soft
from plugins.vlms.told.tables import say, table

_NUMBERED = re.compile(r"_?\d+$")


def bodies_table(task: Task, seed: int) -> str:
    """Write a row for each body, or bodies alike: how it moves, its weight, and where its frame's origin is.

    Args:
        task: whose scene it is.
        seed: of the layout.
    Returns:
        In Markdown.
    """
    scene = task.scene(seed)
    jointed = {joint.body for joint in scene.joints}

    names: dict[tuple[str, ...], list[str]] = {}

    for body in scene.bodies:
        is_soft = isinstance(body, Soft)
        row = (
            _NUMBERED.sub("", body.name),
            say("bodies", "kind", body, is_soft, body.name in jointed),
            say("bodies", "weight", body.mass),
            _describe_origin(body),
        )

        names.setdefault(row, []).append(body.name)

    rows = []
    for cells, alike in names.items():
        name = alike[0]
        if len(alike) > 1:
            name = f"{alike[0]} ... {alike[-1]} ({len(alike)})"

        rows.append((name, *cells[1:]))

    return table(("body", "is", "weight", "origin of its frame"), rows)


def _describe_origin(body: Body) -> str:
    """Name the place of a body's origin between its ends along its own axes.

    Args:
        body: rigid or soft, anywhere.
    """
    low, high = bounds(body, Pose())
    shares = -low / np.maximum(high - low, 1e-9)
    places = [say("bodies", "place", share) for share in shares.tolist()]
    if places == ["middle"] * 3:
        return "centre"

    named = [f"{axis} {place}" for axis, place in zip("xyz", places, strict=True)]

    return ", ".join(named)


def bounds(body: Body, pose: Pose) -> tuple[Array, Array]:
    """Compute the lowest and the highest corner (3,) of a body's shapes in a frame in which it has this pose.

    Args:
        body: of one shape or more.
        pose: of the body in the frame; that of the scene for bounds in the world.
    """
    points = []
    for part in body.collisions or body.visuals:
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
