"""Describe bodies to a designer that is told no number of them."""

from __future__ import annotations

import re

import numpy as np

from core.geometry import Array, Pose
from core.interfaces import Task
from core.scene import Body, Soft
from core.support.text import table

_PLACES = (  # by the share of the body that is below the origin
    (-0.02, "before its low end"),
    (0.02, "low end"),
    (0.48, "lower half"),
    (0.52, "middle"),
    (0.98, "upper half"),
    (1.02, "high end"),
    (np.inf, "beyond its high end"),
)
_ALIKE = re.compile(r"_?\d+$")


def bodies_table(task: Task, seed: int) -> str:
    """Write a row for each body, or bodies alike: how it moves, its weight, and where its frame's origin is."""
    scene = task.scene(seed)
    jointed = {joint.body for joint in scene.joints}
    groups = dict[tuple[str, ...], list[str]]()
    for body in scene.bodies:
        kind = "free" if body.mass else "fixed" if body.collisions else "mark"
        if isinstance(body, Soft):
            kind = f"soft {body.form.kind}, {body.in_words()}"
        elif body.name in jointed:
            kind = "on a joint"
        row: tuple[str, ...] = (
            _ALIKE.sub("", body.name),
            kind,
            weight(body),
            _origin(body),
        )
        groups.setdefault(row, []).append(body.name)
    rows = []
    for row, names in groups.items():
        name = (
            names[0]
            if len(names) == 1
            else f"{names[0]} ... {names[-1]} ({len(names)})"
        )
        rows.append((name, *row[1:]))
    return table(("body", "is", "weight", "origin of its frame"), rows)


def weight(body: Body) -> str:
    """Say in words how heavy a body is."""
    limits = (
        (0.03, "very light"),
        (0.2, "light"),
        (1.0, "as a full cup"),
        (3.0, "heavy"),
        (10.0, "very heavy"),
    )
    return (
        next((word for most, word in limits if body.mass < most), "too heavy to lift")
        if body.mass
        else "-"
    )


def slip(body: Body) -> str:
    """Say in words how well things slide on a body."""
    if not (body.collisions or body.mass):
        return "-"
    limits = ((0.05, "as ice"), (0.25, "oiled"), (0.45, "smooth"), (0.8, "as wood"))
    return next((word for most, word in limits if body.friction < most), "as rubber")


def _origin(body: Body) -> str:
    """Name the place of a body's origin between its ends along its own axes."""
    low, high = bounds(body, Pose())
    shares = -low / np.maximum(high - low, 1e-9)
    words = [
        next(word for most, word in _PLACES if share < most)
        for share in shares.tolist()
    ]
    if words == ["middle"] * 3:
        return "centre"
    return ", ".join(f"{axis} {word}" for axis, word in zip("xyz", words, strict=True))


def bounds(body: Body, pose: Pose) -> tuple[Array, Array]:
    """Compute the lowest and the highest corner (3,) of a body's shapes in a frame in which it has this pose."""
    parts = body.collisions or body.visuals
    points = [
        (pose @ part.pose).apply(np.asarray(part.shape.to_trimesh().vertices))
        for part in parts
    ]
    every = np.concatenate(points)
    return every.min(axis=0), every.max(axis=0)
