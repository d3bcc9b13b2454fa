"""Say what in a scene is possible, and yet seldom meant: mixed up units, bodies in the air, marks out of reach."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from core.designs.statics import GRAVITY
from core.geometry import Array
from core.robot.solids import body_solids
from core.scene import Body, Scene, Soft

HEAVY_KG = 50.0
THIN_M = 0.0002
LONG_M = 2.0
FAR_M = 1.5
SINKS = 0.1  # of a soft solid's height, by its own weight
FALLS_M = 0.002  # more than engines need to settle what rests

Box = tuple[Array, Array]


def find_doubts(scene: Scene, written: Mapping[str, Any]) -> Iterator[str]:
    """Yield a line for each thing that is seldom meant; ``written`` is the content of the file."""
    boxes = {body.name: _box(body) for body in scene.bodies if body.collisions or isinstance(body, Soft)}
    hanging = {joint.body for joint in scene.joints} | {soft.name for soft in scene.softs if soft.pinned}
    for body in scene.bodies:
        if body.name in boxes and not (body.fixed and body.name in ("table", "floor")):
            yield from _of_body(body, boxes)
        away = float(np.linalg.norm(body.pose.position[:2]))
        if body.fixed and not body.collisions and away > FAR_M:
            yield f"mark {body.name} is {away:.2g} m from the robot's base, beyond the reach of most arms"
    for body in scene.free:
        if body.name in boxes and body.name not in hanging and not any(body.velocity):
            gap = _gap_below(body.name, boxes)
            if gap > FALLS_M:
                under = "nothing is below it" if np.isinf(gap) else f"it falls by {1000 * gap:.3g} mm"
                yield f"body {body.name} begins in the air: {under}; a position is that of its middle"
    joints: Sequence[Mapping[str, Any]] = written.get("joints") or ()
    for joint in joints:
        if "axis" not in joint and joint.get("kind") != "ball":
            yield f"joint {joint.get('name')} has no axis; it turns about, or moves along, z of its body"


def _of_body(body: Body, boxes: Mapping[str, Box]) -> Iterator[str]:
    low, high = boxes[body.name]
    thin = min((float(np.min(part.shape.bounds[1])) for part in body.collisions), default=THIN_M)
    if body.mass > HEAVY_KG:
        yield f"body {body.name} weighs {body.mass:g} kg, more than any arm here moves; grams?"
    if thin < THIN_M:
        yield f"body {body.name} is {1000 * thin:.3g} mm thin, and engines may not hold it; is that in metres?"
    if float((high - low).max()) > LONG_M:
        yield f"body {body.name} is {float((high - low).max()):.3g} m long; millimetres?"
    if isinstance(body, Soft) and body.form.kind == "solid":
        sinks = GRAVITY * body.elastic.density * float(high[2] - low[2]) / (2 * body.elastic.young)
        if sinks > SINKS:
            yield f"body {body.name} is pressed down by {sinks:.0%} by its own weight; is young in Pa?"


def _box(body: Body) -> Box:
    """Bound a body's collision shapes in the world, or the nodes of a soft one with its thickness."""
    if isinstance(body, Soft):
        half = body.form.thickness / 2
        return body.placed.min(axis=0) - half, body.placed.max(axis=0) + half
    middles, halves = map(np.array, zip(*(solid.bounds() for solid in body_solids(body)), strict=True))
    return (middles - halves).min(axis=0), (middles + halves).max(axis=0)


def _gap_below(name: str, boxes: Mapping[str, Box]) -> float:
    """Compute how far a body's box is above the next one below it, m; 0 where boxes overlap, inf: there is none."""
    low, high = boxes[name]
    gaps = [
        max(0.0, float(low[2] - other[1][2]))
        for key, other in boxes.items()
        if key != name and (low[:2] < other[1][:2]).all() and (high[:2] > other[0][:2]).all() and other[0][2] < low[2]
    ]
    return min(gaps, default=float("inf"))
