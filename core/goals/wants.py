"""Say where goals want bodies, as one who plans for them asks."""

from __future__ import annotations

from dataclasses import dataclass

from core.geometry import Vector

Place = tuple[float | None, float | None, float | None]


@dataclass(frozen=True)
class Want:
    """Where a goal to reach wants bodies in a layout, in the world, well within its limits.

    Attributes:
        bodies: those that are wanted at one place.
        number: of the goal among the task's.
        any: whether one of the goal's bodies is enough.
        held: whether they must end in hand.
        released: whether they must end touched by nothing of the robot.
        place: of each body's frame, m; None: anywhere. A coordinate that is None is free.
        tolerance: how far off the place is still there, m; None: it is one of many, within spans or in a space.
        away: how far each is to get from its start, m; None: that is free.
        axis: of the bodies' frames, that is to end along ``points``; None: however they turn.
        points: the direction.
        tolerance_deg: how far off the axis may be, degrees.
        joint: that is to get ``to`` a position; empty: none is.
        to: the position, m or rad.
        reference: the body or mark by which the goal says place and direction; empty: the world.
        breaks: whether a force is to break them.
        unsaid: the kinds of what the goal also asks, and this does not say; see `Reach.add_want`.
    """

    bodies: tuple[str, ...]
    number: int = 0
    any: bool = False
    held: bool = False
    released: bool = False
    place: Place | None = None
    tolerance: float | None = None
    away: float | None = None
    axis: Vector | None = None
    points: Vector = (0.0, 0.0, 1.0)
    tolerance_deg: float = 10.0
    joint: str = ""
    to: float = 0.0
    reference: str = ""
    breaks: bool = False
    unsaid: tuple[str, ...] = ()
