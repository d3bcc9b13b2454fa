"""Close the fingers of a gripper on a body, bare or with pads, and carry it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from core.geometry import Array
from plugins.vlms.offline.hand import hand_of
from plugins.vlms.offline.heads import Head, Step, at, box
from plugins.vlms.offline.job import Job
from plugins.vlms.offline.ways.way import Range, Ranges, Values, Way, above

_NARROW = (
    1.03  # times its least width, a body is wide where fingers close: else it turns
)
_ANGLES = 16  # of half a turn, at which widths are measured
_ENTRY_M = 0.05  # of room above a body, to come down on it
_PAD_ROOM_M = 0.016  # on each side of a body, for pads
_PAD_SHARE = 0.3  # of a body's length, that there is room for pads
_LEAST_PAD_M = 0.01  # long: shorter pads let a body turn
_PAD_HEIGHT_M = (0.015, 0.1)  # at least, to hold it upright, and at most, to be stiff
_BELOW_TIPS_M = 0.03  # pads begin at least, for the bars that bear them
_OVER_M = 0.005  # what stands around the body, the palm stays
_LOW_M = 0.002  # above the ground, at least


class Grip(Way):
    """Pads on the fingers come down beside a body and close on it; they carry it, and open where it is set down.

    They are so long that the palm stays above what stands around the body, and as far ahead as the arm is too short.
    """

    name = "grip"
    approaches = True
    fingers = True
    bolted = True
    title = "closes long fingers on a body, and carries it"
    sizes: ClassVar[Ranges] = {
        "room": Range(0.004, 0.015),  # between the body and each pad, open
        "thick": Range(0.004, 0.01),
        "length": Range(0.2, 0.8),  # of the body's
        "height": Range(0.4, 1.0),  # of the body's
        "into": Range(0.7, 1.0),  # what stands around the body, in finger lengths
        "ahead": Range(-0.05, 0.05),  # of the hand, beside what the arm is too short
    }
    moves: ClassVar[Ranges] = {
        "low": Range(0.0, 0.4),  # above the body's foot, in its heights
        "turn": Range(-0.1, 0.1),  # about the vertical
        "higher": Range(0.0, 0.03),  # than the body has to get
        "lifting": Range(0.1, 0.3),  # speed
        "carrying": Range(0.1, 0.4),  # speed
        "drags": Range(0.0, 1.0),  # from a half on, it may stay on the ground
    }

    def suits(self, job: Job) -> float:
        if len(job.want.bodies) > 1 or job.beyond or not (job.goes or job.rises):
            return 0.0
        if job.want.released and job.rises and not job.is_borne:
            return 0.0
        if job.size[1] > _NARROW * _measure_least_width(job):
            return 0.0
        if job.room(z=1.0) < _ENTRY_M or not _is_free_for_pads(job):
            return 0.0
        return 1.0 if job.rises or job.want.held else 0.5

    def head(self, job: Job, values: Values) -> Head:
        thick = values["thick"]
        long = max(_LEAST_PAD_M, values["length"] * job.size[0])
        height = float(np.clip(values["height"] * job.size[2], *_PAD_HEIGHT_M))
        y = job.size[1] / 2 + values["room"] + thick / 2
        pads = [
            box("left_pad", 0.0, -y, height / 2, (long, thick, height)),
            box("right_pad", 0.0, y, height / 2, (long, thick, height)),
        ]

        # So far below the fingertips that the palm stays above what stands around, and as far ahead as the arm lacks.
        hand = hand_of(job.layout.robot)
        palm = job.clear + _OVER_M - values["into"] * hand.palm
        below = max(height + _BELOW_TIPS_M, palm)
        ahead, left, _ = _measure_excess(job) * _find_away(job)
        mount = hand.tips @ at(ahead + values["ahead"], left, -below)
        return Head(pads, np.array([0.0, 0.0, height]), "two pads", mount)

    def motion(self, job: Job, values: Values) -> Iterator[Step]:
        turn = values["turn"]
        low = max(_LOW_M, values["low"] * job.size[2])
        grasp = at(0.0, 0.0, low, yaw=turn)
        speed = values["lifting"]

        yield above(job, grasp)
        yield Step(grasp)
        yield Step(grasp, touch=True, grip=1.0)

        # It is lifted as far as it has to get, or over everything near, or not at all.
        lift = max(0.0, job.rise) + values["higher"]
        if job.goes and not job.rises:
            lift = max(lift, job.clear + _LOW_M)
            if values["drags"] > 0.5 and job.slides:
                lift = 0.0
        yield Step(at(0.0, 0.0, low + lift, yaw=turn), speed, touch=True, grip=1.0)

        x, y, rise = job.way
        if job.goes:
            there = at(x, y, low + lift, yaw=turn)
            yield Step(there, values["carrying"], touch=True, grip=1.0)

        is_kept = job.want.held or (job.rises and not job.want.released)
        if is_kept:
            return

        down = at(x, y, low + min(lift, rise + _LOW_M), yaw=turn)
        yield Step(down, speed, touch=True, grip=1.0)
        yield Step(down, touch=True)
        yield Step(above(job, down).pose, touch=True)


def _is_free_for_pads(job: Job) -> bool:
    """Report whether there is room for pads beside the body, from its foot to above everything near."""
    high = max(job.clear, job.size[2])
    wide = job.size[1] + 2 * _PAD_ROOM_M
    room = np.array([_PAD_SHARE * job.size[0], wide, high])
    return not job.meets(np.array([0.0, 0.0, (high - job.size[2]) / 2]), room)


def _measure_least_width(job: Job) -> float:
    """Measure how wide the bodies are on the level where they are narrowest."""
    angles = np.arange(_ANGLES) * np.pi / _ANGLES
    across = job.points[:, :2] @ np.array([np.cos(angles), np.sin(angles)])
    return float(np.ptp(across, axis=0).min())


def _measure_excess(job: Job) -> float:
    """Measure how far the bodies, or where they have to go, are out of the arm's reach, metres."""
    reach = job.layout.reach
    places = [job.center, job.center + job.shift]
    return max(0.0, *(float(reach.excess(place[None])) for place in places))


def _find_away(job: Job) -> Array:
    """Find the direction from the robot to the bodies, along the ground of the frame, (3,)."""
    x, y = (job.center - job.layout.reach.base)[:2]
    distance = float(np.hypot(x, y))
    if distance == 0.0:  # above the robot's base, no direction is away
        return np.zeros(3)

    ahead = job.frame.rotation.inv().apply([x, y, 0.0])
    return np.asarray(ahead / distance)


class Hand(Grip):
    """The bare fingers come down beside a body and close on it."""

    name = "hand"
    bare = True
    title = "is the hand itself, whose fingers close on a body"
    sizes: ClassVar[Ranges] = {}

    def suits(self, job: Job) -> float:
        if _measure_excess(job) > 0 or job.size[1] > hand_of(job.layout.robot).widest:
            return 0.0
        return super().suits(job)

    def head(self, job: Job, values: Values) -> Head:
        return Head([], np.zeros(3), "the bare hand", hand_of(job.layout.robot).tips)
