"""Press or turn what a joint holds."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from core.geometry import Array, Pose
from plugins.vlms.offline.heads import Head, Piece, Step, at
from plugins.vlms.offline.job import Asked, Job
from plugins.vlms.offline.joints import Spot, find_spots
from plugins.vlms.offline.ways.way import (
    BACK_M,
    Range,
    Ranges,
    Values,
    Way,
    above,
    pick,
)

_UPRIGHT = 0.1  # the level part of a unit vector that counts as upright
_ARC = 4  # steps of a turn: between two of them the way is straight


class Press(Way):
    """A rod comes to a point of a body that a joint holds, and pushes it along the joint's way.

    Its head is level, with x along the way at the start, and its origin at the rod's end.
    """

    name = "press"
    title = "presses what a joint holds, with a rod that follows the joint's way"
    does: ClassVar[Asked] = "joint"
    sizes: ClassVar[Ranges] = {
        "spot": Range(0.0, 1.0),  # of those where the body can be pushed
        "longer": Range(0.01, 0.08),  # than the rod must be
        "thick": Range(0.008, 0.016),
    }
    moves: ClassVar[Ranges] = {
        "before": Range(0.01, 0.03),  # the body, where the rod comes down
        "into": Range(0.0, 0.01),  # the body, as it gives way
        "farther": Range(0.0, 0.15),  # than the joint has to get, of its way
        "follows": Range(0.0, 1.0),  # of the body's turn, that the rod turns with it
        "speed": Range(0.05, 0.25),
        "leaves": Range(0.0, 1.0),  # from a half on
    }

    def suits(self, job: Job) -> float:
        return float(len(find_spots(job)) > 0)

    def head(self, job: Job, values: Values) -> Head:
        spot = _choose(job, values)
        rise = float(np.arcsin(np.clip(spot.way[2], -1.0, 1.0)))
        thick = values["thick"]
        length = spot.depth + values["longer"]
        along = at(0.0, 0.0, 0.0, pitch=-rise)
        rod = Piece("rod", along @ at(-length / 2, 0.0, 0.0), (length, thick, thick))
        attach = along.apply([thick / 2 - length, 0.0, 0.0])
        return Head([rod], attach, f"a rod {length:.2f} m long")

    def motion(self, job: Job, values: Values) -> Iterator[Step]:
        spot = _choose(job, values)
        level = at(*spot.point, yaw=_find_heading(job, spot))
        within = job.frame.inverse()
        back = within.rotation.apply(spot.way)
        begin = within @ level
        touching = _shift(begin, -0.001 * back)
        away = _shift(begin, -(spot.depth + values["before"]) * back)

        yield above(job, away)
        yield Step(away)
        yield Step(touching)

        joint = spot.joint.joint
        way = (job.want.to - joint.start) * (1 + values["farther"])
        steps = _ARC if spot.turns else 1
        pose = begin
        for share in np.linspace(0.0, 1.0, steps + 1)[1:]:
            carried = spot.carry(joint.start + share * way)
            turn = float(carried.rotation.as_rotvec()[2]) * values["follows"]
            point = carried.apply(spot.point)
            ahead = carried.rotation.apply(spot.way) * values["into"]
            level = at(*(point + ahead), yaw=_find_heading(job, spot) + turn)
            pose = within @ level
            back = within.rotation.apply(carried.rotation.apply(spot.way))
            yield Step(pose, speed=values["speed"], touch=True)

        if values["leaves"] > 0.5 and not joint.springs_back:
            yield Step(_shift(pose, -BACK_M * back), touch=True)


def _choose(job: Job, values: Values) -> Spot:
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
