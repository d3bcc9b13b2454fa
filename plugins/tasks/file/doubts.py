"""Say what in a scene is possible, and yet seldom meant: mixed up units, and bodies in the air."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

import numpy as np

from core.geometry import Array
from core.robot.solids import body_solids
from core.scene import Body, Camera, Scene, Soft, State
from core.values.doubts import find_doubt

SEEN = 0.9  # of half a picture's height: what is farther from its middle is hardly seen
FALLS_M = 0.002  # more than engines need to settle what rests

Box = tuple[Array, Array]


def find_doubts(scene: Scene) -> Iterator[str]:
    """Yield a line for each thing that is seldom meant."""
    boxes = {}
    for body in scene.bodies:
        if body.collisions or isinstance(body, Soft):
            boxes[body.name] = bound(body)

    hanging = {joint.body for joint in scene.joints}
    hanging |= {soft.name for soft in scene.softs if soft.pinned}

    for body in scene.free:
        if body.name not in boxes:
            continue

        low, high = boxes[body.name]
        where = f"body {body.name}"
        yield from find_doubt(where, "body mass", body.mass)
        yield from find_doubt(where, "length", float((high - low).max()))
        volume = sum(geom.shape.volume for geom in body.collisions)
        if volume > 0:
            yield from find_doubt(where, "density", body.mass / volume)
        if body.name in hanging or any(body.velocity):
            continue

        gap = _gap_below(body.name, boxes)
        if gap > FALLS_M:
            under = f"it falls by {1000 * gap:.3g} mm"
            if np.isinf(gap):
                under = "nothing is below it"

            yield f"body {body.name} begins in the air: {under}; a position is that of its middle"


def find_unseen(camera: Camera, state: State, names: Iterable[str]) -> list[str]:
    """Return the bodies whose middles are not in a camera's picture, or so near its edge that most of them is not."""
    most = SEEN * np.tan(np.radians(camera.fov_deg) / 2)
    unseen = []
    for name in names:
        right, up, forward = camera.axes @ (state.position(name) - camera.position)
        if forward <= 0 or abs(up) > most * forward or abs(right) > most * forward:
            unseen.append(name)

    return unseen


def bound(body: Body) -> Box:
    """Bound a body's collision shapes in the world, or the nodes of a soft one with its thickness."""
    if isinstance(body, Soft):
        half = body.form.thickness / 2
        return body.placed.min(axis=0) - half, body.placed.max(axis=0) + half

    bounds = np.array([solid.bounds() for solid in body_solids(body)])
    middles = bounds[:, 0]
    halves = bounds[:, 1]
    return (middles - halves).min(axis=0), (middles + halves).max(axis=0)


def _gap_below(name: str, boxes: Mapping[str, Box]) -> float:
    """Compute how far a body's box is above the next one below it, m; 0 where boxes overlap, inf: there is none."""
    low, high = boxes[name]
    least = float("inf")
    for other, (bottom, top) in boxes.items():
        overlap = (low[:2] < top[:2]).all() and (high[:2] > bottom[:2]).all()
        if other != name and overlap and bottom[2] < low[2]:
            least = min(least, max(0.0, float(low[2] - top[2])))

    return least
