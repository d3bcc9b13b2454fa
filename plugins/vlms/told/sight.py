"""Tell a designer what eyes and hands would: in feedback ways as seen in the picture, and no number of a body."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from core.interfaces import Task
from core.scene import Camera
from core.values.observations import Moved, Sight

_SIZE = 640, 480  # pixels, of which ways are shares
_SHARE = 0.01  # of the picture; a shorter way is not seen
_UNIT = r"mm|cm|m/s|m|kg|g|N m|N|J|deg|degrees|rad"
# A number with a unit, or a decimal that is neither a time nor a count; a list of them; names such as card_3 stay.
_MEASURED = rf"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?= ?(?:{_UNIT})\b)"
_NUMBER = re.compile(rf"(?<![\w.])(?:{_MEASURED}|[-+]?\d+\.\d+(?!\d| ?s\b))")
_LIST = re.compile(r"[(\[]\s*[-+\d.e]+(?:\s*,\s*[-+\d.e]+)+\s*[)\]]")


@dataclass(frozen=True)
class Hidden(Sight):
    """Feedback without numbers of the bodies with these ``names``; their ways are as a camera shows them."""

    numbers = False
    names: tuple[str, ...]
    camera: Camera

    @classmethod
    def of(cls, task: Task, seed: int) -> Hidden:
        """Hide the numbers of a layout's bodies, seen by the task's camera."""
        return cls(tuple(body.name for body in task.scene(seed).bodies), task.camera)

    def text(self, text: str) -> str:
        """Take the numbers out of a text that speaks of a body of the scene; seconds and counts stay."""
        if not any(re.search(rf"\b{re.escape(name)}\b", text) for name in self.names):
            return text
        return _NUMBER.sub("some", _LIST.sub("somewhere", text))

    def way(self, moved: Moved) -> str:
        """Describe a body's way as shares of the picture's width and height."""
        end = np.array(moved.to)
        (x, y), (to_x, to_y) = self.camera.project(
            np.stack([end - moved.by, end]), *_SIZE
        )
        ways = (
            ((to_x - x) / _SIZE[0], ("right", "left"), "width"),
            ((y - to_y) / _SIZE[1], ("up", "down"), "height"),
        )
        seen = [
            f"{names[int(share < 0)]} by {100 * abs(share):.0f} % of its {side}"
            for share, names, side in ways
            if abs(share) >= _SHARE
        ]
        return (
            f"in the picture {' and '.join(seen)}"
            if seen
            else "not seen in the picture"
        )
