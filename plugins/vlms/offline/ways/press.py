"""Press or turn what a joint holds."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from core.geometry import Array, Pose
from plugins.vlms.offline.heads import Head, Piece, Step, at
from plugins.vlms.offline.job import Job
from plugins.vlms.offline.joints import Spot, find_spots
from plugins.vlms.offline.recipe import Values
from plugins.vlms.offline.ways.way import (
    BACK_M,
    Way,
    above,
    leaves,
    pick,
)

_ROD_M = (0.008, 0.018)  # thick, at least and at most
_TOUCH_M = 0.001  # before a point, the rod is at it
_UPRIGHT = 0.1  # the level part of a unit vector that counts as upright
_ARC_STEPS = 4  # of a turn: between two of them the rod goes straight


class Press(Way):
    """A rod comes to a point of a body that a joint holds, and pushes it along the joint's way.

    The head's origin is the rod's end that pushes. Its x points where that goes at first, but level; the rod itself
    slopes as the way does. So the arm's flange stays upright.
    """

    name = "press"
    title = "presses what a joint holds, with a rod that follows the joint's way"
    does = "joint"
    sizes = {
        "spot": (0.0, 1.0),  # of those where the body can be pushed
        "longer": (0.01, 0.08),  # than the rod must be
    }
    moves = {
        "before": (0.01, 0.03),  # the body, where the rod comes down
        "into": (0.0, 0.01),  # the body, as it gives way
        "farther": (0.0, 0.15),  # than the joint has to get, of its way
        "follows": (0.0, 1.0),  # of the body's turn, that the rod turns with it
        "speed": (0.05, 0.25),
        "leaves": (0.0, 1.0),  # from a half on, what stays where it is
    }

    def suits(self, job: Job) -> float:
        return float(len(find_spots(job)) > 0)

    def head(self, job: Job, values: Values) -> Head:
        spot = _choose_spot(job, values)
        length = spot.depth + values["longer"]
        thick = job.find_thickness(length, *_ROD_M)

        rise = float(np.arcsin(np.clip(spot.way[2], -1.0, 1.0)))
        along = at(0.0, 0.0, 0.0, pitch=-rise)
        rod = Piece("rod", along @ at(-length / 2, 0.0, 0.0), (length, thick, thick))
        attach = along.apply([thick / 2 - length, 0.0, 0.0])
        return Head([rod], attach, f"a rod {length:.2f} m long")

    def motion(self, job: Job, values: Values) -> Iterator[Step]:
        spot = _choose_spot(job, values)
        heading = _find_heading(job, spot)
        into_frame = job.frame.inverse()

        # The rod comes down behind the point, and goes to it.
        begin = into_frame @ at(*spot.point, yaw=heading)
        ahead = into_frame.rotation.apply(spot.way)
        away = _shift(begin, -(spot.depth + values["before"]) * ahead)
        yield above(job, away)
        yield Step(away)
        yield Step(_shift(begin, -_TOUCH_M * ahead))

        # It goes where the point goes as the joint moves, and a little into the body.
        count = _ARC_STEPS if spot.turns else 1
        for carried in spot.carry(job.want.to, values["farther"], count):
            turned = float(carried.rotation.as_rotvec()[2]) * values["follows"]
            way = carried.rotation.apply(spot.way)
            point = carried.apply(spot.point) + values["into"] * way
            pose = into_frame @ at(*point, yaw=heading + turned)
            yield Step(pose, speed=values["speed"], touch=True)

        if leaves(job, values) and not spot.springs_back:
            back = into_frame.rotation.apply(-BACK_M * way)
            yield Step(_shift(pose, back), touch=True)


def _choose_spot(job: Job, values: Values) -> Spot:
    """Choose a point where the body is pushed."""
    return pick(find_spots(job), values["spot"])


def _find_heading(job: Job, spot: Spot) -> float:
    """Find where a rod points on the level, radians in the world; where it is upright, away from the robot."""
    if np.hypot(*spot.way[:2]) < _UPRIGHT:
        return job.outward
    return float(np.arctan2(spot.way[1], spot.way[0]))


def _shift(pose: Pose, way: Array) -> Pose:
    """Shift a pose by (3,)."""
    return Pose(pose.position + way, pose.quaternion)
