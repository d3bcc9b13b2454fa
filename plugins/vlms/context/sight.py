"""Tell a designer what eyes and hands would: in feedback ways as seen in the picture, and no number of a body."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from core.interfaces import Task
from core.scene import Camera
from core.simulation.projection import project
from core.values.observations import Moved, Sight
from plugins.vlms.context.phrases import phrase

_WIDTH = 640  # pixels, of which ways are shares
_HEIGHT = 480
# A force is felt by the arm, and no number of a body.
_UNIT = r"mm|cm|m/s|m|kg|g|N m|J|deg|degrees|rad"
# A number with a unit, or a decimal that is neither a time nor a count; a list of them; names such as card_3 stay.
_MEASURED = rf"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?= ?(?:{_UNIT})\b)"
# A reward is no number of a body.
_NUMBER = re.compile(
    rf"(?<![\w.])(?<!reward of )(?:{_MEASURED}|[-+]?\d+\.\d+(?!\d| ?s\b| ?N\b(?! ?m)))"
)
_SAID = re.compile(rf"{_MEASURED} ?(?:{_UNIT})\b")
_LIST = re.compile(r"[(\[]\s*[-+\d.e]+(?:\s*,\s*[-+\d.e]+)+\s*[)\]]")


def hide_numbers(text: str) -> str:
    """Take the numbers of bodies out of a text; seconds and counts stay."""
    return _NUMBER.sub("some", _LIST.sub("somewhere", text))


@dataclass(frozen=True)
class Hidden(Sight):
    """Feedback without numbers of the bodies with these ``names``; their ways are as a camera shows them.

    Attributes:
        names: of bodies.
        camera: of the task.
        said: measures that the prompt says itself, such as a limit of ``20 mm``, without their spaces.
    """

    numbers = False
    names: tuple[str, ...]
    camera: Camera
    said: frozenset[str] = frozenset()

    @classmethod
    def for_layout(cls, task: Task, seed: int) -> Hidden:
        """Hide the numbers of a layout's bodies, seen by the task's camera."""
        names = tuple(body.name for body in task.scene(seed).bodies)
        measures = _SAID.findall(task.in_words)
        said = frozenset(measure.replace(" ", "") for measure in measures)
        return cls(names, task.camera, said)

    def text(self, text: str) -> str:
        """Take the numbers out of a text that speaks of a body of the scene; seconds and counts stay.

        Args:
            text: feedback, of one line or more.
        """
        if not any(re.search(rf"\b{re.escape(name)}\b", text) for name in self.names):
            return text
        return _NUMBER.sub(self._hide, _LIST.sub("somewhere", text))

    def _hide(self, found: re.Match[str]) -> str:
        """Return what replaces a number: itself, where the prompt says the same."""
        measure = _SAID.match(found.string, found.start())
        is_said = measure is not None and measure[0].replace(" ", "") in self.said
        return found[0] if is_said else "some"

    def way(self, moved: Moved, *, ends: bool = True) -> str:
        """Describe a body's way as shares of the picture's width and height.

        Args:
            moved: where the body is at the end, and from where it came.
            ends: say where it ends; here it is never said.
        """
        end = np.array(moved.to)
        places = np.stack([end - moved.by, end])
        (x, y), (to_x, to_y) = project(self.camera, places, _WIDTH, _HEIGHT)
        right = (to_x - x) / _WIDTH
        up = (y - to_y) / _HEIGHT

        return phrase("observed", "way", right, up)
