"""Describe bodies to a designer that is told no number of them."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from core.geometry import Array, Pose
from core.interfaces import Task
from core.scene import Body, Soft
from plugins.vlms.told.tables import table

Words = Sequence[tuple[float, str]]
"""Words for a number, each with the number that it is below."""

_PLACES: Words = (  # by the share of the body that is below the origin
    (-0.02, "before its low end"),
    (0.02, "low end"),
    (0.48, "lower half"),
    (0.52, "middle"),
    (0.98, "upper half"),
    (1.02, "high end"),
    (np.inf, "beyond its high end"),
)
_WEIGHTS: Words = (  # by the mass, kg
    (0.03, "very light"),
    (0.2, "light"),
    (1.0, "as a full cup"),
    (3.0, "heavy"),
    (10.0, "very heavy"),
    (np.inf, "too heavy to lift"),
)
_FRICTIONS: Words = (  # by the coefficient
    (0.05, "as ice"),
    (0.25, "oiled"),
    (0.45, "smooth"),
    (0.8, "as wood"),
    (np.inf, "as rubber"),
)
_STIFFNESS: Words = (  # by Young's modulus, Pa
    (2e4, "very soft, as dough"),
    (2e5, "soft, as a sponge"),
    (2e6, "as soft rubber"),
    (2e7, "as rubber"),
    (np.inf, "stiff, as plastic"),
)
_NUMBERED = re.compile(r"_?\d+$")


def bodies_table(task: Task, seed: int) -> str:
    """Write a row for each body, or bodies alike: how it moves, its weight, and where its frame's origin is.

    Args:
        task: whose scene it is.
        seed: of the layout.
    """
    scene = task.scene(seed)
    jointed = {joint.body for joint in scene.joints}
    names: dict[tuple[str, ...], list[str]] = {}

    for body in scene.bodies:
        kind = "on a joint" if body.name in jointed else _describe_kind(body)
        row = (_NUMBERED.sub("", body.name), kind, weight(body), _describe_origin(body))
        names.setdefault(row, []).append(body.name)

    rows = []
    for cells, alike in names.items():
        name = alike[0]
        if len(alike) > 1:
            name = f"{alike[0]} ... {alike[-1]} ({len(alike)})"
        rows.append((name, *cells[1:]))

    return table(("body", "is", "weight", "origin of its frame"), rows)


def _describe_kind(body: Body) -> str:
    """Say how a body without a joint moves."""
    if isinstance(body, Soft):
        return f"soft {body.form.kind}, {softness(body)}"
    if body.mass:
        return "free"
    return "fixed" if body.collisions else "mark"


def _choose(words: Words, number: float) -> str:
    """Choose the word for a number.

    Args:
        words: by rising limits, the last of which is endless.
        number: which is below one of them.
    """
    return next(word for limit, word in words if number < limit)


def softness(body: Soft) -> str:
    """Say in words how stiff a soft body is, and whether it is held."""
    stiff = _choose(_STIFFNESS, body.elastic.young)
    if body.pinned:
        return f"{stiff}; held at {len(body.pinned)} of its nodes"
    return stiff


def weight(body: Body) -> str:
    """Say in words how heavy a body is."""
    return _choose(_WEIGHTS, body.mass) if body.mass else "-"


def slip(body: Body) -> str:
    """Say in words how well things slide on a body."""
    if not (body.collisions or body.mass):
        return "-"
    return _choose(_FRICTIONS, body.friction)


def _describe_origin(body: Body) -> str:
    """Name the place of a body's origin between its ends along its own axes."""
    low, high = bounds(body, Pose())
    shares = -low / np.maximum(high - low, 1e-9)
    places = [_choose(_PLACES, share) for share in shares.tolist()]
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
