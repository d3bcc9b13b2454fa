"""Pull bodies from behind, by a toe at the end of an arm that passes them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from core.geometry import Array, Pose
from plugins.vlms.offline.heads import Head, Piece, Step, at, lay
from plugins.vlms.offline.job import Job
from plugins.vlms.offline.recipe import Values
from plugins.vlms.offline.ways.way import (
    BACK_M,
    OVER_M,
    Way,
    above,
    leaves,
    pick,
)

_LEAST_ROOM_M = 0.012  # for an arm with its toe
_LEAST_BEHIND_M = 0.008  # of room behind bodies, for the toe
_AHEAD_M = 0.1  # of bodies arms go on, where nothing covers these
_ROOMY = 0.5  # of the most room, a side has where an arm passes
_PASS_M = 0.003  # between the toe and bodies that it passes
_GAP_M = 0.002  # between the arm and the bodies
_LEAST_PART_M = 0.004  # arm and toe, at least: thinner ones break
_MOST_TOE_M = 0.012  # thick, a toe at most
_ARM_SHARE = 0.45  # of the room, an arm takes at most

# Over the bodies, on their left, and on their right.
_SIDES = np.array([[0, 0, 1], [0, 1, 0], [0, -1, 0]], dtype=float)


class _Fit(NamedTuple):
    """How a hook fits the room beside the bodies; metres.

    Attributes:
        side: the direction from the bodies to the arm, (3,), one of `_SIDES`.
        length: of the arm.
        arm: its thickness.
        breadth: of arm and toe.
        toe: how far the toe reaches from the arm's side behind the bodies.
        toe_thick: its thickness.
    """

    side: Array
    length: float
    arm: float
    breadth: float
    toe: float
    toe_thick: float


class Hook(Way):
    """A flat arm comes in from where the bodies have to go, over or beside them, and a toe at its end gets behind them.

    Seen from a side of the way, for an arm that passes to the top of the page:

            toe
            |=============== arm
            |  [bodies]     -> x, the way

    The head's origin is at the toe's front and at the bodies' edge, once it is behind them. Where something covers the
    bodies, all of the way is below it: the arm is long enough to be borne from outside.
    """

    name = "hook"
    title = "passes bodies, over them or beside them, gets behind them with a toe, and pulls"
    sizes = {
        "place": (0.0, 1.0),  # over, left or right, where there is room
        "toe": (0.5, 0.9),  # long, of the room that is left
        "breadth": (0.3, 0.9),  # of arm and toe, of the bodies' side
        "ahead": (0.02, 0.1),  # of the bodies the arm goes on
        "behind": (0.003, 0.012),  # the bodies, the toe gets in
    }
    moves = {
        "low": (0.002, 0.02),  # over the ground; over bodies a quarter of it
        "before": (0.01, 0.04),  # the bodies, where it comes down
        "farther": (-0.02, 0.03),  # than the bodies have to go
        "speed": (0.1, 0.35),
        "leaves": (0.0, 1.0),  # from a half on
    }

    def suits(self, job: Job) -> float:
        if len(job.want.bodies) > 1 or job.falls or not job.slides:
            return 0.0
        if job.room(x=-1.0) < _LEAST_BEHIND_M or not any(_measure_rooms(job)):
            return 0.0
        return 1.0 if job.is_covered else 0.3

    def head(self, job: Job, values: Values) -> Head:
        fit = _fit_hook(job, values)

        # The arm begins over the toe, which goes from the arm's far side to behind the bodies.
        arm_middle = fit.side * (_GAP_M + fit.arm / 2)
        arm_middle[0] = (fit.length - fit.toe_thick) / 2
        across = fit.arm + _GAP_M + fit.toe
        toe_middle = fit.side * (_GAP_M + fit.arm - across / 2)
        toe_middle[0] = -fit.toe_thick / 2

        long = fit.length + fit.toe_thick
        arm = lay(long, fit.arm, fit.breadth, fit.side)
        toe = lay(fit.toe_thick, across, fit.breadth, fit.side)
        pieces = [
            Piece("arm", Pose(arm_middle), arm),
            Piece("toe", Pose(toe_middle), toe),
        ]

        attach = arm_middle + np.array([fit.length / 2, 0.0, arm[2] / 2])
        return Head(pieces, attach, f"a hook {fit.length:.2f} m long")

    def motion(self, job: Job, values: Values) -> Iterator[Step]:
        fit = _fit_hook(job, values)
        side = fit.side
        rear = -job.size[0] / 2
        behind = rear - values["behind"]
        front = job.size[0] / 2 + values["before"] + fit.toe_thick
        if job.is_covered:
            front += job.length

        # Where the head's origin is across the way: as it pulls, and as the toe passes the bodies.
        edge = np.array([0.0, side[1] * job.size[1] / 2, 0.0])
        edge[2] = job.size[2] + values["low"] / 4
        if side[1]:
            edge[2] = values["breadth"] * job.size[2] / 2 + values["low"]
        passing = edge + side * (fit.toe + _PASS_M)

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
    """Choose a side on which the arm passes, and fit a hook to the room there."""
    rooms = _measure_rooms(job)
    roomy = [n for n, room in enumerate(rooms) if room >= _ROOMY * max(rooms)]
    chosen = pick(roomy, values["place"])
    side = _SIDES[chosen]
    room = rooms[chosen]

    # Where something covers the bodies, the arm is borne from outside.
    length = float(job.size[0] + values["ahead"])
    if job.is_covered:
        length += job.length

    # The toe pulls a side of the bodies, over which or beside which the arm is as broad.
    _, width, height = job.size.tolist()
    broad, deep = (width, height) if side[2] else (height, width)
    breadth = values["breadth"] * broad
    arm = job.find_thickness(length, _LEAST_PART_M, _ARM_SHARE * room, breadth)

    # The toe gets in behind the bodies, and passes them.
    behind = job.room(x=-1.0) - values["behind"] - _PASS_M
    left = room - arm - _GAP_M - _PASS_M
    toe = min(values["toe"] * left, values["breadth"] * deep)
    return _Fit(
        side=side,
        length=length,
        arm=arm,
        breadth=breadth,
        toe=max(_LEAST_PART_M, toe),
        toe_thick=float(np.clip(behind, _LEAST_PART_M, _MOST_TOE_M)),
    )
