"""Say where goals want bodies, and what they forbid, as one who plans for them asks."""

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
        after: the number of the goal that must be reached before it; None: there is none.
        any: whether one of the goal's bodies is enough.
        held: whether they must end in hand.
        released: whether they must end touched by nothing of the robot.
        rest: whether they must end at rest.
        ever: whether it is enough to be there at some time.
        by_s: until when, s; None: that is free.
        place: of each body's frame, m; None: anywhere. A coordinate that is None is free.
        tolerance: how far off the place is still there, m; None: it is one of many, within spans or in a space.
        away: how far each is to get from its start, m; None: that is free.
        axis: of the bodies' frames, that is to end along ``points``; None: however they turn.
        points: the direction.
        tolerance_deg: how far off the axis may be, degrees.
        joint: that is to get ``to`` a position; empty: none is.
        to: the position, m or rad.
        reference: the body or mark by which the goal says place and direction; empty: the world.
        container: the body or mark inside of which they are to end; empty: none.
        breaks: whether a force is to break them.
        unsaid: the kinds of what the goal also asks, and this does not say; see `Reach.add_want`.
    """

    bodies: tuple[str, ...]
    number: int = 0
    after: int | None = None
    any: bool = False
    held: bool = False
    released: bool = False
    rest: bool = False
    ever: bool = False
    by_s: float | None = None
    place: Place | None = None
    tolerance: float | None = None
    away: float | None = None
    axis: Vector | None = None
    points: Vector = (0.0, 0.0, 1.0)
    tolerance_deg: float = 10.0
    joint: str = ""
    to: float = 0.0
    reference: str = ""
    container: str = ""
    breaks: bool = False
    unsaid: tuple[str, ...] = ()


@dataclass(frozen=True)
class Ban:
    """What a limit forbids.

    Attributes:
        bodies: those that it is about.
        moved: how far they may move, m; None: that is free.
        turned_deg: how far they may turn, degrees; likewise.
        force: how hard they may be pressed, N, 0: they must not be touched; None: that is free.
        by: what must not touch them; empty: the robot.
        breaks: whether they must not break.
        lasting: what must hold all the time.
        unsaid: the kind of the limit, where this does not say it; else empty.
    """

    bodies: tuple[str, ...] = ()
    moved: float | None = None
    turned_deg: float | None = None
    force: float | None = None
    by: tuple[str, ...] = ()
    breaks: bool = False
    lasting: tuple[Want, ...] = ()
    unsaid: str = ""
