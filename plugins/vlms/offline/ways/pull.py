"""Pull what a joint holds, from behind its face."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from core.geometry import Array, Pose
from plugins.vlms.offline.heads import Head, Piece, Step, at, lay
from plugins.vlms.offline.job import Job
from plugins.vlms.offline.joints import Spot, list_spots
from plugins.vlms.offline.recipe import Values
from plugins.vlms.offline.ways.way import Way, above, pick

_TOE_M = 0.006  # thick
_FREE_BEHIND_M = 0.014  # a face there must be room for the toe
_FREE_BEFORE_M = 0.25  # it there must be room for the arm, and what bears it
_FREE_WIDTH_M = 0.008  # of that room: as much as an arm has, at most
_DISTANCES_M = np.linspace(0.008, 0.03, 7)  # from a point, an opening is looked for
_LEVEL = 0.9  # the level part of a way that a level arm pulls, at least
_ARC_STEPS = 6  # of a turn: between two of them the arm goes straight

_SIDES = np.array([[0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=float)


class _Opening(NamedTuple):
    """An opening beside a point that is pulled.

    Attributes:
        spot: the point.
        side: the direction from the point to the opening, one of `_SIDES`, in the head's frame.
        distance: from the point to the opening's middle, metres.
    """

    spot: Spot
    side: Array
    distance: float


class Pull(Way):
    """An arm with a toe goes in through an opening in a body's face, the toe gets behind the face, and pulls.

    The head is level: x goes in, and its origin is the middle of the arm's end. The toe is there, on the arm's side
    towards the point that is pulled.
    """

    name = "pull"
    title = (
        "goes in through an opening, and pulls what a joint holds from behind its face"
    )
    does = "joint"
    sizes = {
        "opening": (0.0, 1.0),  # which one
        "long": (0.06, 0.14),  # the arm
        "arm": (0.004, 0.008),  # thick, towards the toe
        "toe": (0.004, 0.01),  # beside the arm
        "wide": (0.008, 0.015),  # arm and toe
    }
    moves = {
        "behind": (0.001, 0.004),  # the face, the toe gets in
        "before": (0.02, 0.05),  # the face it comes down
        "aside": (0.002, 0.01),  # behind the face
        "farther": (0.0, 0.15),  # than the joint has to get, of its way
        "speed": (0.05, 0.2),
    }

    def suits(self, job: Job) -> float:
        return float(len(_find_openings(job)) > 0)

    def head(self, job: Job, values: Values) -> Head:
        to_point = -_choose_opening(job, values).side
        long = values["long"]
        thick = values["arm"]
        toe = values["toe"]

        arm_size = lay(long, thick, values["wide"], to_point)
        toe_size = lay(_TOE_M, thick + toe, values["wide"], to_point)
        toe_middle = to_point * toe / 2
        toe_middle[0] = -_TOE_M / 2
        pieces = [
            Piece("arm", at(-long / 2, 0.0, 0.0), arm_size),
            Piece("toe", Pose(toe_middle), toe_size),
        ]
        return Head(pieces, np.array([thick - long, 0.0, 0.0]), "a hook")

    def motion(self, job: Job, values: Values) -> Iterator[Step]:
        opening = _choose_opening(job, values)
        spot = opening.spot
        yaw = _find_heading(spot)
        side = at(0.0, 0.0, 0.0, yaw=yaw).apply(opening.side)
        into_frame = job.frame.inverse()

        # In the world: before the opening, within it behind the face, and with the toe behind the point.
        inside = spot.point - (values["behind"] + _TOE_M) * spot.way
        middle = inside + (opening.distance + values["toe"] / 2) * side
        before = middle + (values["before"] + _TOE_M) * spot.way
        hooked = at(*(middle - values["aside"] * side), yaw=yaw)

        yield above(job, into_frame @ at(*before, yaw=yaw))
        yield Step(into_frame @ at(*before, yaw=yaw))
        yield Step(into_frame @ at(*middle, yaw=yaw), touch=True)
        yield Step(into_frame @ hooked, touch=True)

        for carried in spot.carry(job.want.to, values["farther"], _ARC_STEPS):
            pose = into_frame @ carried @ hooked
            yield Step(pose, speed=values["speed"], touch=True)


@lru_cache(maxsize=32)
def _find_openings(job: Job) -> list[_Opening]:
    """Find openings beside points that can be pulled."""
    found = []
    for spot in list_spots(job):
        if np.hypot(*spot.way[:2]) < _LEVEL:
            continue
        for side in _SIDES:
            free = [far for far in _DISTANCES_M if _is_open(job, spot, side, far)]
            if free:
                found.append(_Opening(spot, side, float(np.mean(free))))

    return found


def _is_open(job: Job, spot: Spot, side: Array, distance: float) -> bool:
    """Report whether an arm gets past a point, at a distance to a side of it, and a toe from there to behind it."""
    level = at(*spot.point, yaw=_find_heading(spot))
    out = level.rotation.inv().apply(spot.way)
    between = Pose(distance / 2 * side - _TOE_M * out)
    passage = np.maximum(distance * np.abs(side), _TOE_M)
    if job.layout.meets(level @ between, tuple(passage)):
        return False

    arm = Pose(distance * side + (_FREE_BEFORE_M - _FREE_BEHIND_M) / 2 * out)
    room = (_FREE_BEHIND_M + _FREE_BEFORE_M, _FREE_WIDTH_M, _FREE_WIDTH_M)
    return not job.layout.meets(level @ arm, room)


def _choose_opening(job: Job, values: Values) -> _Opening:
    """Choose an opening."""
    return pick(_find_openings(job), values["opening"])


def _find_heading(spot: Spot) -> float:
    """Find where the way in points, radians in the world."""
    return float(np.arctan2(-spot.way[1], -spot.way[0]))
