"""A goal: bodies that point at another one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from core.geometry import Array, Vector
from core.goals.base import SLIP_RAD, Measure, Reach, angle_between, length
from core.values.joints import rotate
from core.values.states import State


@dataclass(frozen=True, kw_only=True)
class Facing(Reach):
    """Bodies whose ``axis`` (3,), in their frames, must end pointing at the middle of another body or mark.

    A lamp whose x axis must point at a book, wherever both end: ``Facing(("lamp",), facing="book")``.

    Attributes:
        facing: the name of the body or mark.
        tolerance_deg: how far the axis may be off, degrees.

    Raises:
        ValueError: the axis has no length, or a body is to face itself.
    """

    facing: str
    axis: Vector = (1.0, 0.0, 0.0)
    tolerance_deg: float = 10.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not np.any(self.axis):
            raise ValueError("a goal's axis needs a length")
        if self.facing in self.bodies:
            raise ValueError(f"{self.facing} can't face itself; name another body")

    def measures(self, body: str, start: State) -> Iterator[Measure]:
        axis = np.divide(self.axis, np.linalg.norm(self.axis))

        def angle(state: State) -> Array:
            way = state.position(self.facing) - state.position(body)
            distance = np.maximum(length(way), np.finfo(float).tiny)
            towards = way / distance[..., None]
            return angle_between(rotate(state.quaternion(body), axis), towards)

        most = float(np.radians(self.tolerance_deg))
        name = f"angle of {body} to {self.facing}"
        yield Measure(name, angle, most, SLIP_RAD, "rad")
