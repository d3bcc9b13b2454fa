"""Pull what a joint holds, from behind its face."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import ClassVar, NamedTuple

import numpy as np

from core.geometry import Array
from plugins.vlms.offline.heads import Head, Piece, Step, at
from plugins.vlms.offline.job import Asked, Job
from plugins.vlms.offline.joints import Spot, list_spots, meets_anything
from plugins.vlms.offline.ways.way import Range, Ranges, Values, Way, above, pick

_TOE_M = 0.006  # thick
_BEHIND_M = 0.014  # a face there must be room for the toe
_OUT_M = 0.25  # before it, for the arm and what bears it
_WIDE_M = 0.016  # the opening must be
# From a point on a face to the middle of an opening.
_OFFSETS_M = np.linspace(0.008, 0.03, 7)
_LEVEL = 0.9  # the level part of a way that a level arm pulls, at least
_ARC = 6  # steps of a turn


class _Opening(NamedTuple):
    """An opening beside a point that is pulled: the middle between its edges is ``offset`` (3,) from the point."""

    spot: Spot
    offset: Array


class Pull(Way):
    """An arm with a toe goes in through an opening in a body's face, the toe gets behind the face, and pulls.

    The head is level: x goes in.
    """

    name = "pull"
    title = (
        "goes in through an opening, and pulls what a joint holds from behind its face"
    )
    does: ClassVar[Asked] = "joint"
    sizes: ClassVar[Ranges] = {
        "opening": Range(0.0, 1.0),  # which one
        "long": Range(0.06, 0.14),  # the arm
        "arm": Range(0.004, 0.008),  # thick
        "toe": Range(0.004, 0.01),  # beside the arm
        "wide": Range(0.008, 0.015),
    }
    moves: ClassVar[Ranges] = {
        "behind": Range(0.001, 0.004),  # the face, the toe gets in
        "before": Range(0.02, 0.05),  # the face it comes down
        "aside": Range(0.002, 0.01),  # behind the face
        "farther": Range(0.0, 0.15),  # than the joint has to get, of its way
        "speed": Range(0.05, 0.2),
    }

    def suits(self, job: Job) -> float:
        return float(len(_find_openings(job)) > 0)

    def head(self, job: Job, values: Values) -> Head:
        opening = _choose(job, values)
        level = _heading(opening.spot)
        side = at(0.0, 0.0, 0.0, yaw=-level).apply(opening.offset)
        out = -side / np.linalg.norm(side)
        arm = values["arm"]
        high = values["toe"] + arm
        across = np.where(np.abs(out) > 0.5, high, values["wide"])
        toe = at(-_TOE_M / 2, *(out * (high - arm) / 2)[1:])
        size = np.where(np.abs(out) > 0.5, arm, values["wide"])
        pieces = [
            Piece(
                "arm", at(-values["long"] / 2, 0.0, 0.0), (values["long"], *size[1:])
            ),
            Piece("toe", toe, (_TOE_M, *across[1:])),
        ]
        return Head(pieces, np.array([arm - values["long"], 0.0, 0.0]), "a hook")

    def motion(self, job: Job, values: Values) -> Iterator[Step]:
        opening = _choose(job, values)
        spot = opening.spot
        within = job.frame.inverse()
        yaw = _heading(spot)
        out = opening.offset / np.linalg.norm(opening.offset)
        inside = spot.point - (values["behind"] + _TOE_M) * spot.way
        middle = inside + opening.offset + out * values["toe"] / 2
        before = middle + (values["before"] + _TOE_M) * spot.way
        hooked = middle - values["aside"] * out

        yield above(job, within @ at(*before, yaw=yaw))
        yield Step(within @ at(*before, yaw=yaw))
        yield Step(within @ at(*middle, yaw=yaw), touch=True)
        yield Step(within @ at(*hooked, yaw=yaw), touch=True)

        joint = spot.joint.joint
        way = (job.want.to - joint.start) * (1 + values["farther"])
        for share in np.linspace(0.0, 1.0, _ARC + 1)[1:]:
            carried = spot.carry(joint.start + share * way)
            pose = within @ carried @ at(*hooked, yaw=yaw)
            yield Step(pose, speed=values["speed"], touch=True)


@lru_cache(maxsize=32)
def _find_openings(job: Job) -> list[_Opening]:
    """Find openings beside points that can be pulled."""
    found = []
    for spot in list_spots(job):
        yaw = _heading(spot)
        if np.hypot(*spot.way[:2]) < _LEVEL:
            continue
        left = np.array([-np.sin(yaw), np.cos(yaw), 0.0])
        up = np.array([0.0, 0.0, 1.0])
        for side in (left, -left, up, -up):
            free = [off for off in _OFFSETS_M if _is_open(job, spot, off * side, yaw)]
            if free:
                found.append(_Opening(spot, np.mean(free) * side))
    return found


def _is_open(job: Job, spot: Spot, offset: Array, yaw: float) -> bool:
    """Report whether an arm gets past a point, at an offset (3,) from it, and a toe from there to behind it."""
    side = np.abs(at(0.0, 0.0, 0.0, yaw=-yaw).apply(offset))
    behind = spot.point + offset / 2 - _TOE_M * spot.way
    if meets_anything(job, at(*behind, yaw=yaw), tuple(np.maximum(side, _TOE_M))):
        return False

    size = (_BEHIND_M + _OUT_M, _WIDE_M / 2, _WIDE_M / 2)
    middle = spot.point + offset + (_OUT_M - _BEHIND_M) / 2 * spot.way
    return not meets_anything(job, at(*middle, yaw=yaw), size)


def _choose(job: Job, values: Values) -> _Opening:
    """Choose an opening."""
    return pick(_find_openings(job), values["opening"])


def _heading(spot: Spot) -> float:
    """Find where the way in points, radians in the world."""
    return float(np.arctan2(-spot.way[1], -spot.way[0]))
