"""Tell a designer what eyes and hands would: in feedback ways as seen in the picture, and no number of a body."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from core.geometry import Array
from core.interfaces import Task
from core.scene import Body, Camera, Soft
from core.support.text import table
from core.values.observations import Moved

_SIZE = 640, 480  # pixels, of which ways are shares
_SHARE = 0.01  # of the picture; a shorter way is not seen
_UNIT = r"mm|cm|m/s|m|kg|g|N m|N|J|deg|degrees|rad"
# A number with a unit, or a decimal that is neither a time nor a count; a list of them; names such as card_3 stay.
_MEASURED = rf"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?= ?(?:{_UNIT})\b)"
_NUMBER = re.compile(rf"(?<![\w.])(?:{_MEASURED}|[-+]?\d+\.\d+(?!\d| ?s\b))")
_LIST = re.compile(r"[(\[]\s*[-+\d.e]+(?:\s*,\s*[-+\d.e]+)+\s*[)\]]")
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


@dataclass(frozen=True)
class Sight:
    """Where feedback is seen from: the task's camera; ``names`` are those of the scene's bodies."""

    names: tuple[str, ...]
    camera: Camera

    @classmethod
    def of(cls, task: Task, seed: int) -> Sight:
        return cls(tuple(body.name for body in task.scene(seed).bodies), task.camera)

    def text(self, text: str) -> str:
        """Take the numbers out of a text that speaks of a body of the scene; seconds and counts stay."""
        if not any(re.search(rf"\b{re.escape(name)}\b", text) for name in self.names):
            return text
        return _NUMBER.sub("some", _LIST.sub("somewhere", text))

    def way(self, moved: Moved) -> str:
        """Describe a body's way as shares of the picture's width and height."""
        end = np.array(moved.to)
        (x, y), (to_x, to_y) = self.camera.project(np.stack([end - moved.by, end]), *_SIZE)
        ways = ((to_x - x) / _SIZE[0], ("right", "left"), "width"), ((y - to_y) / _SIZE[1], ("up", "down"), "height")
        seen = [
            f"{names[int(share < 0)]} by {100 * abs(share):.0f} % of its {side}"
            for share, names, side in ways
            if abs(share) >= _SHARE
        ]
        return f"in the picture {' and '.join(seen)}" if seen else "not seen in the picture"


def bodies_table(task: Task, seed: int) -> str:
    """Write a row for each body, or bodies alike: how it moves, its weight, and where its frame's origin is."""
    scene, groups = task.scene(seed), dict[tuple[str, ...], list[str]]()
    jointed = {joint.body for joint in scene.joints}
    for body in scene.bodies:
        kind = "on a joint" if body.name in jointed else "free" if body.mass else "fixed" if body.collisions else "mark"
        kind = f"soft {body.form.kind}, {body.elastic.in_words()}" if isinstance(body, Soft) else kind
        said = _ALIKE.sub("", body.name), kind, weight(body), _origin(body)
        groups.setdefault(said, []).append(body.name)
    names = (f"{own[0]} ... {own[-1]} ({len(own)})" if len(own) > 1 else own[0] for own in groups.values())
    rows = [(name, *said[1:]) for name, said in zip(names, groups, strict=True)]
    return table(("body", "is", "weight", "origin of its frame"), rows)


def weight(body: Body) -> str:
    """Say in words how heavy a body is."""
    limits = ((0.03, "very light"), (0.2, "light"), (1.0, "as a full cup"), (3.0, "heavy"), (10.0, "very heavy"))
    return next((word for most, word in limits if body.mass < most), "too heavy to lift") if body.mass else "-"


def slip(body: Body) -> str:
    """Say in words how well things slide on a body."""
    if not (body.collisions or body.mass):
        return "-"
    limits = ((0.05, "as ice"), (0.25, "oiled"), (0.45, "smooth"), (0.8, "as wood"))
    return (
        next((word for most, word in limits if body.friction < most), "as rubber")
        if body.collisions or body.mass
        else "-"
    )


def _origin(body: Body) -> str:
    """Name the place of a body's origin between its ends along its own axes."""
    low, high = own_bounds(body)
    shares = -low / np.maximum(high - low, 1e-9)
    words = [next(word for most, word in _PLACES if share < most) for share in shares.tolist()]
    if words == ["middle"] * 3:
        return "centre"
    return ", ".join(f"{axis} {word}" for axis, word in zip("xyz", words, strict=True))


def own_bounds(body: Body) -> tuple[Array, Array]:
    """Compute the lowest and the highest corner (3,) of a body's shapes along its own axes."""
    parts = body.collisions or body.visuals
    points = np.concatenate([part.pose.apply(np.asarray(part.shape.to_trimesh().vertices)) for part in parts])
    return points.min(axis=0), points.max(axis=0)
