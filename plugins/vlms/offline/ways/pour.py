"""Pour bodies out of the vessel in which they lie."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from core.geometry import Pose
from plugins.vlms.offline.handles import Handles, find_handles
from plugins.vlms.offline.heads import Head, Step, at, box
from plugins.vlms.offline.job import Job
from plugins.vlms.offline.ways.way import Range, Ranges, Values, Way

_PLATE_M = 0.01  # thick, at the flange
_WIDE_M = 0.06  # the plate
_HIGH_M = 0.03  # the crossbar
_TOP_M = 0.035  # the plate goes on above the flange's middle, and below the channels
_INNER = 0.3  # of a handle, from the vessel on, that the channel leaves free
_STEPS = 5  # of the turn
_OVER_M = 0.01  # everything near, at least, the vessel passes
_SHAKE_M = 0.02


class Pour(Way):
    """Two channels slide over the handles of a vessel, carry it to the place, and turn it over.

    The flange points ahead meanwhile, so that the arm's last joint turns the vessel: x of the head is its axis.
    """

    name = "pour"
    approaches = True
    bolted = True
    title = "takes a vessel by its handles, carries it, and pours out what lies in it"
    sizes: ClassVar[Ranges] = {
        "drop": Range(0.07, 0.12),  # of the channels below the flange: clear of the arm
        "room": Range(0.002, 0.005),  # around a handle
        "lip": Range(0.004, 0.007),  # thickness of the channels
        "gap": Range(0.003, 0.012),  # between the crossbar and the vessel
        "longer": Range(-0.04, 0.0),  # channels than handles
    }
    moves: ClassVar[Ranges] = {
        "behind": Range(0.01, 0.03),  # the vessel, where it comes down
        "above": Range(0.06, 0.15),  # from where
        "taking": Range(0.1, 0.3),
        "higher": Range(0.0, 0.05),  # than the vessel has to pass
        "carrying": Range(0.15, 0.4),
        "heading": Range(-0.5, 0.8),  # at the place, beside the way from the robot
        "turn": Range(2.2, 3.0),  # so far that walls slope down to the mouth
        "side": Range(-1.0, 1.0),  # to the left from 0 on, to the right below
        "aside": Range(0.3, 0.7),  # of the drop, so that the mouth gets above the place
    }

    def suits(self, job: Job) -> float:
        vessel = job.vessel
        if vessel is None or not job.goes or job.beyond or job.want.held:
            return 0.0
        if vessel.is_covered or abs(job.turned) > np.pi / 2:
            return 0.0
        return float(find_handles(vessel) is not None)

    def head(self, job: Job, values: Values) -> Head:
        vessel, handles = _find(job)
        drop = values["drop"]
        lip = values["lip"]
        length = self._measure_length(vessel, handles, values)
        outer = handles.outer + values["room"]
        inner = handles.inner + _INNER * (handles.outer - handles.inner)
        half = (handles.high - handles.low) / 2 + values["room"] + lip / 2

        plate = (_PLATE_M, _WIDE_M, drop + 2 * _TOP_M)
        crossbar = (_PLATE_M, 2 * (outer + lip), _HIGH_M)
        pieces = [
            box("plate", _PLATE_M / 2, 0.0, -drop / 2, plate),
            box("crossbar", 1.5 * _PLATE_M, 0.0, -drop, crossbar),
        ]
        web = (length, lip, 2 * half + lip)
        edge = (length, outer - inner, lip)
        x = 2 * _PLATE_M + length / 2
        for name, side in (("left", 1.0), ("right", -1.0)):
            y = side * (outer + inner) / 2
            pieces += [
                box(f"{name}_web", x, side * (outer + lip / 2), -drop, web, 1),
                box(f"{name}_lower", x, y, -drop - half, edge, 1),
                box(f"{name}_upper", x, y, -drop + half, edge, 1),
            ]

        mount = at(0.0, 0.0, 0.0, pitch=np.pi / 2)
        return Head(pieces, np.zeros(3), "two channels for handles", mount)

    @staticmethod
    def _measure_length(vessel: Job, handles: Handles, values: Values) -> float:
        """Measure how long the channels are: from behind the vessel to where the handles end."""
        half = float(vessel.size[0]) / 2
        return handles.front + half + values["gap"] + values["longer"]

    def motion(self, job: Job, values: Values) -> Iterator[Step]:
        vessel, handles = _find(job)
        drop = values["drop"]
        within = job.frame.inverse() @ vessel.frame
        back = vessel.size[0] / 2 + values["gap"] + 2 * _PLATE_M
        length = self._measure_length(vessel, handles, values)

        low = (handles.low + handles.high) / 2 + drop
        start = -back - length - values["behind"]
        lying = max(vessel.size[:2]) / 2
        high = job.clear - within.position[2] + max(low, lying) + _OVER_M
        high += values["higher"]

        speed = values["taking"]
        yield Step(within @ at(start, 0.0, low + values["above"]))
        yield Step(within @ at(start, 0.0, low))
        yield Step(within @ at(-back, 0.0, low), speed, touch=True)
        yield Step(within @ at(-back, 0.0, high), speed, touch=True)

        side = 1.0 if values["side"] > 0 else -1.0
        heading = _find_goal_heading(job) + values["heading"]
        place = Pose.xyz_rpy([*job.way[:2], within.position[2]], (0.0, 0.0, heading))
        there = place @ at(-back, -side * values["aside"] * drop, high)
        yield Step(there, values["carrying"], touch=True)

        turn = side * values["turn"]
        for share in np.linspace(0.0, 1.0, _STEPS + 1)[1:]:
            over = there @ at(0.0, 0.0, 0.0, roll=share * turn)
            yield Step(over, touch=True)

        shaken = at(0.0, 0.0, _SHAKE_M) @ over
        yield Step(shaken, touch=True)
        yield Step(over, touch=True)
        yield Step(shaken, touch=True)


def _find(job: Job) -> tuple[Job, Handles]:
    """Find the vessel of a job that suits, and its handles."""
    vessel = job.vessel
    assert vessel is not None
    handles = find_handles(vessel)
    assert handles is not None
    return vessel, handles


def _find_goal_heading(job: Job) -> float:
    """Find the direction from the robot to where the bodies have to go, in the frame, radians."""
    x, y = (job.center + job.shift - job.layout.reach.base)[:2]
    return float(np.arctan2(y, x)) - job.heading
