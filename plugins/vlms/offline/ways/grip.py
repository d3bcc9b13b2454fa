"""Close the fingers of a gripper on a body, bare or with pads, and carry it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from core.geometry import Pose
from plugins.vlms.offline.hand import hand_of
from plugins.vlms.offline.heads import Head, Step, at, box
from plugins.vlms.offline.job import Job
from plugins.vlms.offline.recipe import Values
from plugins.vlms.offline.ways.way import Way, above

_NARROW = (
    1.03  # times its least width, a body is wide where fingers close: else it turns
)
_ANGLES = 16  # of half a turn, at which widths are measured
_ENTRY_M = 0.05  # of room above a body, to come down on it
_PAD_SHARE = 0.3  # of a body's length, that there is room for pads
_LEAST_PAD_M = 0.01  # long: shorter pads let a body turn
_PAD_HEIGHT_M = (0.015, 0.1)  # at least, to hold it upright, and at most, to be stiff
_MOST_PAD_M = 0.015  # thick
_BELOW_TIPS_M = 0.03  # pads begin at least, for the bars that bear them
_PALM_M = 0.005  # above what stands around the body, the palm stays
_SET_DOWN_M = 0.002  # above the ground a body is let go, and pads stay


class Grip(Way):
    """Pads on the fingers come down beside a body and close on it; they carry it, and open where it is set down.

    They are so long that the palm stays above what stands around the body, and as far from the robot, or near to it,
    as the arm lacks.
    """

    name = "grip"
    approaches = True
    fingers = True
    bolted = True
    title = "closes long fingers on a body, and carries it"
    sizes = {
        "room": (0.004, 0.01),  # between the body and each pad, open
        "thick": (0.004, 0.008),
        "length": (0.2, 0.8),  # of the body's
        "height": (0.4, 1.0),  # of the body's
        "into": (0.7, 1.0),  # what stands around the body, in finger lengths
        "ahead": (-0.05, 0.05),  # of the hand, beside what the arm lacks
    }
    moves = {
        "low": (0.0, 0.4),  # above the body's foot, in its heights
        "turn": (-0.1, 0.1),  # about the vertical
        "higher": (0.0, 0.03),  # than the body has to get
        "lifting": (0.1, 0.3),  # speed
        "carrying": (0.1, 0.4),  # speed
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
        long = max(_LEAST_PAD_M, values["length"] * job.size[0])
        height = float(np.clip(values["height"] * job.size[2], *_PAD_HEIGHT_M))
        hand = hand_of(job.layout.robot)
        thick = job.find_thickness(
            long / 2, values["thick"], _MOST_PAD_M, height, hand.press
        )
        y = job.size[1] / 2 + values["room"] + thick / 2
        pads = [
            box("left_pad", 0.0, -y, height / 2, (long, thick, height)),
            box("right_pad", 0.0, y, height / 2, (long, thick, height)),
        ]

        # The palm stays above what stands around.
        palm = job.clear + _PALM_M - values["into"] * hand.palm
        below = max(height + _BELOW_TIPS_M, palm)

        # The pads are as far from the robot, seen from the hand, as the arm lacks.
        away = job.layout.reach.find_heading(job.center) - job.heading
        aside = at(0.0, 0.0, 0.0, yaw=away).apply([_measure_lack(job), 0.0, -below])
        mount = hand.tips @ at(values["ahead"], 0.0, 0.0) @ Pose(aside)
        return Head(pads, np.array([0.0, 0.0, height]), "two pads", mount)

    def motion(self, job: Job, values: Values) -> Iterator[Step]:
        turn = values["turn"]
        speed = values["lifting"]
        low = max(_SET_DOWN_M, values["low"] * job.size[2])
        grasp = at(0.0, 0.0, low, yaw=turn)
        yield above(job, grasp)
        yield Step(grasp)
        yield Step(grasp, touch=True, grip=1.0)

        # It is lifted as far as it has to get, and over everything near where it goes on.
        x, y, rise = job.way
        lift = max(0.0, job.rise) + values["higher"]
        if not job.rises and job.goes:
            lift = max(lift, job.clear + _SET_DOWN_M)
        yield Step(at(0.0, 0.0, low + lift, yaw=turn), speed, touch=True, grip=1.0)
        there = at(x, y, low + lift, yaw=turn)
        yield Step(there, values["carrying"], touch=True, grip=1.0)
        if _is_kept(job):
            return

        down = at(x, y, low + min(lift, rise + _SET_DOWN_M), yaw=turn)
        yield Step(down, speed, touch=True, grip=1.0)
        yield Step(down, touch=True)
        yield Step(above(job, down).pose, touch=True)


def _is_kept(job: Job) -> bool:
    """Report whether the body stays between the pads: it is to be held, or nothing bears it where it gets."""
    return job.want.held or (job.rises and not job.want.released)


def _is_free_for_pads(job: Job) -> bool:
    """Report whether there is room for the widest pads beside the body, from its foot to above everything near."""
    _, room = Grip.sizes["room"]
    _, thick = Grip.sizes["thick"]
    high = max(job.clear, job.size[2])
    wide = job.size[1] + 2 * (room + thick)
    size = np.array([_PAD_SHARE * job.size[0], wide, high])
    return not job.meets(np.array([0.0, 0.0, (high - job.size[2]) / 2]), size)


def _measure_least_width(job: Job) -> float:
    """Measure how wide the bodies are on the level where they are narrowest."""
    angles = np.arange(_ANGLES) * np.pi / _ANGLES
    across = job.points[:, :2] @ np.array([np.cos(angles), np.sin(angles)])
    return float(np.ptp(across, axis=0).min())


def _measure_lack(job: Job) -> float:
    """Measure how far the body, or where it has to go, is beyond the arm's reach, metres; negative: too near to it."""
    reach = job.layout.reach
    places = np.array([job.center, job.center + job.shift])
    return float(reach.too_far(places).max() - reach.too_near(places).max())


class Hand(Grip):
    """The bare fingers come down beside a body and close on it."""

    name = "hand"
    bare = True
    title = "is the hand itself, whose fingers close on a body"
    sizes = {}

    def suits(self, job: Job) -> float:
        if _measure_lack(job) != 0 or job.size[1] > hand_of(job.layout.robot).widest:
            return 0.0
        return super().suits(job)

    def head(self, job: Job, values: Values) -> Head:
        return Head([], np.zeros(3), "the bare hand", hand_of(job.layout.robot).tips)
