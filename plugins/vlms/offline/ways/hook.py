"""Pull bodies from behind, by a toe at the end of an arm that passes them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, NamedTuple

import numpy as np

from core.geometry import Array, Pose
from plugins.vlms.offline.heads import Head, Piece, Step, at
from plugins.vlms.offline.job import Job
from plugins.vlms.offline.ways.way import (
    BACK_M,
    OVER_M,
    Range,
    Ranges,
    Values,
    Way,
    above,
    leaves,
)

_LEAST_ROOM_M = 0.012  # for an arm with its toe
_BEHIND_M = 0.008  # of room behind bodies, for the toe
_AHEAD_M = 0.1  # of bodies arms go on, where nothing covers these
_MOST_ROOM_M = 0.1  # more room makes a side no likelier
_PASS_M = 0.003  # between the toe and bodies that it passes
_GAP_M = 0.002  # between the arm and the bodies
_THIN_M = 0.004  # arm and toe, at least: thinner ones break
_THICK_M = 0.012  # and at most
_FIRST = 1e-6  # the share that is the first side with room

# Over the bodies, on their left, and on their right.
_SIDES = np.array([[0, 0, 1], [0, 1, 0], [0, -1, 0]], dtype=float)


class _Fit(NamedTuple):
    """How a hook fits the room beside the bodies; metres.

    Attributes:
        side: the direction from the bodies to the arm, (3,), one of `_SIDES`.
        thick: arm and toe.
        toe: how far the toe reaches from the arm's side behind the bodies.
    """

    side: Array
    thick: float
    toe: float


class Hook(Way):
    """An arm comes in from where the bodies have to go, over or beside them, and a toe at its end gets behind them.

    Seen from a side of the way, for an arm that passes to the top of the page:

            toe
            |=============== arm
            |  [bodies]     -> x, the way

    The head's origin is at the toe's front and at the bodies' edge, once it is behind them. Where something covers the
    bodies, all of the way is below it: the arm is long enough to be borne from outside.
    """

    name = "hook"
    title = "passes bodies, over them or beside them, gets behind them with a toe, and pulls"
    sizes: ClassVar[Ranges] = {
        "place": Range(0.0, 1.0),  # over, left or right, by the room there
        "arm": Range(0.15, 0.35),  # thick, of the room
        "toe": Range(0.5, 0.9),  # long, of the room that is left
        "breadth": Range(0.3, 0.9),  # of the toe, of the bodies' side
        "ahead": Range(0.02, 0.1),  # of the bodies the arm goes on
    }
    moves: ClassVar[Ranges] = {
        "low": Range(0.002, 0.02),  # over the ground; over bodies a quarter of it
        "before": Range(0.01, 0.04),  # the bodies, where it comes down
        "behind": Range(0.003, 0.012),  # the bodies, where the toe gets in
        "farther": Range(-0.02, 0.03),  # than the bodies have to go
        "speed": Range(0.1, 0.35),
        "leaves": Range(0.0, 1.0),  # from a half on
    }

    def suits(self, job: Job) -> float:
        if len(job.want.bodies) > 1 or job.falls or not job.slides:
            return 0.0
        if job.room(x=-1.0) < _BEHIND_M or not any(_measure_rooms(job)):
            return 0.0
        return 1.0 if job.is_covered else 0.3

    def head(self, job: Job, values: Values) -> Head:
        side, thick, toe = _fit_hook(job, values)
        length = job.size[0] + values["ahead"]
        if job.is_covered:
            length += job.length

        # The toe goes from the arm's far side to behind the bodies.
        across = thick + _GAP_M + toe
        toe_size = (thick, across, values["breadth"] * job.size[2])
        if side[2]:
            toe_size = (thick, values["breadth"] * job.size[1], across)

        arm_middle = side * (_GAP_M + thick / 2)
        arm_middle[0] = (length - thick) / 2
        toe_middle = side * (_GAP_M + thick - across / 2)
        toe_middle[0] = -thick / 2
        pieces = [
            Piece("arm", Pose(arm_middle), (length + thick, thick, thick)),
            Piece("toe", Pose(toe_middle), toe_size),
        ]
        attach = arm_middle + np.array([length / 2, 0.0, thick / 2])
        return Head(pieces, attach, f"a hook {length:.2f} m long")

    def motion(self, job: Job, values: Values) -> Iterator[Step]:
        side, thick, toe = _fit_hook(job, values)
        rear = -job.size[0] / 2
        behind = rear - values["behind"]
        front = job.size[0] / 2 + values["before"] + thick
        if job.is_covered:
            front += job.length

        # Where the head's origin is across the way: as it pulls, and as the toe passes the bodies.
        edge = np.array([0.0, side[1] * job.size[1] / 2, 0.0])
        edge[2] = job.size[2] + values["low"] / 4
        if side[1]:
            edge[2] = values["breadth"] * job.size[2] / 2 + values["low"]
        passing = edge + side * (toe + _PASS_M)

        before = at(front, *passing[1:])
        if job.is_covered:
            yield Step(at(front, passing[1], passing[2] + OVER_M))
        else:
            yield above(job, before)
        yield Step(before)
        yield Step(at(behind, *passing[1:]))
        yield Step(at(behind, *edge[1:]))

        end = at(rear + job.length + values["farther"], *edge[1:])
        yield Step(end, speed=values["speed"], touch=True)
        if leaves(job, values):
            yield Step(at(end.position[0] - BACK_M, *edge[1:]), touch=True)


def _measure_rooms(job: Job) -> list[float]:
    """Measure the room on each of `_SIDES` of the bodies; 0: an arm with its toe has none."""
    ahead = job.length if job.is_covered else _AHEAD_M
    rooms = [job.room(*side, ahead=ahead) for side in _SIDES]
    return [room if room > _LEAST_ROOM_M else 0.0 for room in rooms]


def _fit_hook(job: Job, values: Values) -> _Fit:
    """Choose the side on which the arm passes, the likelier the more room is there, and fit a hook to the room."""
    rooms = _measure_rooms(job)
    shares = np.cumsum(np.minimum(rooms, _MOST_ROOM_M))
    place = np.clip(values["place"], _FIRST, 1.0)
    chosen = int(np.searchsorted(shares, place * shares[-1]))
    side = _SIDES[chosen]
    room = rooms[chosen]

    # As thick as the toe still gets in behind the bodies.
    most = min(_THICK_M, job.room(x=-1.0) - values["behind"] - _PASS_M)
    thick = float(np.clip(values["arm"] * room, _THIN_M, max(most, _THIN_M)))

    # As long as it passes the bodies, and as the side that it pulls is high or wide.
    extent = job.size[2] if side[2] else job.size[1]
    left = room - thick - _GAP_M - _PASS_M
    toe = max(_THIN_M, min(values["toe"] * left, values["breadth"] * extent))
    return _Fit(side, thick, toe)
