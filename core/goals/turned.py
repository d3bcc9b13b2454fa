"""A goal: an axis of bodies along a direction."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from core.geometry import Array, Vector
from core.goals.base import SLIP_DEG, SLIP_RAD, Measure, Reach, angle_between
from core.values.joints import rotate
from core.values.spans import Span
from core.values.states import State


@dataclass(frozen=True, kw_only=True)
class Turned(Reach):
    """Bodies whose ``axis`` (3,), in their frames, must end along ``points`` (3,).

    A cup that must stand upright is ``Turned(("cup",), axis=(0.0, 0.0, 1.0))``, and one that must lie down::

        Turned(("cup",), angle_deg=Span(low=60.0))

    Attributes:
        points: in the world, or in the frame of the body or mark ``at``, as it stands in the layout.
        tolerance_deg: how far the axis may be off, degrees.
        angle_deg: instead of a tolerance, the angle between the two, degrees from 0 to 180.

    Raises:
        ValueError: one of the two has no length.
    """

    axis: Vector = (0.0, 0.0, 1.0)
    points: Vector = (0.0, 0.0, 1.0)
    at: str | None = None
    tolerance_deg: float = 10.0
    angle_deg: Span | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (np.any(self.axis) and np.any(self.points)):
            raise ValueError("a goal's axis and points need a length")

    def measures(self, body: str, start: State) -> Iterator[Measure]:
        axis = np.divide(self.axis, np.linalg.norm(self.axis))
        points = np.divide(self.points, np.linalg.norm(self.points))
        if self.at is not None:
            points = rotate(start.quaternion(self.at), points)

        def angle(state: State) -> Array:
            return angle_between(rotate(state.quaternion(body), axis), points)

        def angle_deg(state: State) -> Array:
            return np.asarray(np.degrees(angle(state)))

        name = f"angle of {body}"
        if self.angle_deg is not None:
            yield from Measure.within(self.angle_deg, name, angle_deg, "deg", SLIP_DEG)
            return

        most = float(np.radians(self.tolerance_deg))
        yield Measure(name, angle, most, SLIP_RAD, "rad")
