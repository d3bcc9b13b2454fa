"""A goal: bodies that point at another one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from core.geometry import Array, Vector
from core.goals.evidence import length
from core.goals.keys import AXIS, TOLERANCE_DEG, Key
from core.goals.measures import SLIP_RAD, Measure, measure_angle
from core.goals.reaching import Reach
from core.goals.sites import ANY_BODY
from core.goals.turned import ALONG
from core.goals.wants import Want
from core.scene import Scene
from core.values.states import State


@dataclass(frozen=True, kw_only=True)
class Facing(Reach):
    """Bodies whose ``axis`` (3,) in their own frame, by default x, must end pointing at another body or mark.

    A lamp whose x axis must point at a book, wherever both end: ``Facing(("lamp",), facing="book")``.

    Attributes:
        facing: the body or mark at whose middle the axis must point.
        tolerance_deg: how far the axis may be off, degrees.

    Raises:
        ValueError: the axis has no length, or a body is to face itself.
    """

    facing: str
    axis: Vector = (1.0, 0.0, 0.0)
    tolerance_deg: float = 10.0

    orients: ClassVar = True
    keys: ClassVar = {
        "facing": Key(
            str,
            "The name of a body or mark, at whose middle the axis of the others must point; the x axis, if there is no "
            "axis",
            head=True,
        ),
        "axis": AXIS,
        "tolerance_deg": TOLERANCE_DEG,
    }
    asks = (
        "axis {{ vector(goal.axis, 3) }} of its frame must point at {{ goal.facing }}, within "
        "{{ goal.tolerance_deg | g }} degrees"
    )
    short = "turn {{ bodies }} to {{ goal.facing }}"
    names: ClassVar = {"facing": ANY_BODY}
    turns = True

    def __post_init__(self) -> None:
        super().__post_init__()
        if not np.any(self.axis):
            raise ValueError("a goal's axis needs a length")
        if self.facing in self.bodies:
            raise ValueError(f"{self.facing} can't face itself; name another body")

    def measures(self, body: str, start: State) -> Iterator[Measure]:
        def towards(state: State) -> Array:
            way = state.position(self.facing) - state.position(body)
            distance = np.maximum(length(way), np.finfo(float).tiny)
            return np.asarray(way / distance[..., None])

        angle = measure_angle(body, self.axis, towards)
        most = float(np.radians(self.tolerance_deg))
        name = f"angle of {body} to {self.facing}"
        yield Measure(name, angle, most, SLIP_RAD, "rad")

    def add_want(self, want: Want, scene: Scene) -> Want:
        """Return it with a turn on the level, from where the first body is to what it is to face."""
        way = scene[self.facing].pose.position - scene[want.bodies[0]].pose.position
        if np.hypot(*way[:2]) < ALONG:
            return super().add_want(want, scene)

        points = (float(way[0]), float(way[1]), 0.0)
        return replace(
            want, axis=self.axis, points=points, tolerance_deg=self.tolerance_deg
        )
