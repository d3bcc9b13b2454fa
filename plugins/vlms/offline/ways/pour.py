"""Pour bodies out of the vessel in which they lie."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from core.geometry import Pose
from plugins.vlms.offline.handles import find_handles
from plugins.vlms.offline.heads import Head, Piece, Step, at, box
from plugins.vlms.offline.job import Job
from plugins.vlms.offline.recipe import Values
from plugins.vlms.offline.ways.way import Way

_PLATE_M = 0.012  # thick: the plate at the flange, and the crossbar before it
_PLATE_WIDTH_M = 0.06  # covers a flange
_PLATE_MARGIN_M = 0.035  # goes on above the flange's middle, and below the channels'
_CROSSBAR_HEIGHT_M = 0.03  # stiff enough for a full vessel
_MOST_LIP_M = 0.012  # thick, web and edges at most
_FREE_SHARE = 0.3  # of a handle, beside the vessel, that the channel leaves free
_PASSES_M = 0.01  # the vessel passes everything near by so much, at least
_TURN_STEPS = 5  # of half a second each, at least: nothing is flung out
_SHAKE_M = 0.02  # what sticks to a wall comes off


class Pour(Way):
    """Two channels slide over the handles of a vessel, carry it to the place, and turn it over.

    Seen from behind and from the left, with F for the flange, which points ahead:

             F plate              F
             |                    |  web and edges
        [----+----] crossbar     ||=========
        channels                  plate, crossbar

    Each channel is open towards the vessel, between its two edges, so that the handle lies in it whichever way is up.
    The head's origin is F and its x points ahead, so that the arm's last joint turns head and vessel about x.
    """

    name = "pour"
    approaches = True
    bolted = True
    title = "takes a vessel by its handles, carries it, and pours out what lies in it"
    sizes = {
        "drop": (0.07, 0.12),  # of the channels below the flange: clear of the arm
        "room": (0.002, 0.005),  # around a handle
        "lip": (0.004, 0.007),  # thickness of web and edges
        "gap": (0.003, 0.012),  # between the crossbar and the vessel
        "longer": (-0.04, 0.0),  # channels than handles
    }
    moves = {
        "behind": (0.01, 0.03),  # the vessel, where the channels come down
        "above": (0.06, 0.15),  # from where they do
        "taking": (0.1, 0.3),  # speed until the vessel is lifted
        "higher": (0.0, 0.05),  # than the vessel has to pass
        "carrying": (0.15, 0.4),  # speed
        "heading": (-0.5, 0.8),  # at the place, beside the way from the robot
        "turn": (2.2, 3.0),  # so far that walls slope down to the mouth
        "side": (-1.0, 1.0),  # it turns to: the left from 0 on, the right below
        "aside": (0.3, 0.7),  # of the drop, so that the mouth gets above the place
    }

    def suits(self, job: Job) -> float:
        vessel = job.vessel
        if vessel is None or not job.goes or job.beyond or job.want.held:
            return 0.0
        if vessel.is_covered or abs(job.turned) > np.pi / 2:
            return 0.0
        return float(find_handles(vessel) is not None)

    def head(self, job: Job, values: Values) -> Head:
        drop = values["drop"]
        fit = _fit_channels(job, values)
        plate = (_PLATE_M, _PLATE_WIDTH_M, drop + 2 * _PLATE_MARGIN_M)
        crossbar = (_PLATE_M, 2 * (fit.outer + fit.lip), _CROSSBAR_HEIGHT_M)
        pieces = [
            box("plate", _PLATE_M / 2, 0.0, -drop / 2, plate),
            box("crossbar", 1.5 * _PLATE_M, 0.0, -drop, crossbar),
            *_build_channel("left", 1.0, fit, values),
            *_build_channel("right", -1.0, fit, values),
        ]
        ahead = at(0.0, 0.0, 0.0, pitch=np.pi / 2)
        return Head(pieces, np.zeros(3), "two channels for handles", ahead)

    def motion(self, job: Job, values: Values) -> Iterator[Step]:
        fit = _fit_channels(job, values)
        foot = job.frame.inverse() @ fit.vessel.frame
        low = fit.height + values["drop"]
        high = _find_passing_height(job, fit, foot, low) + values["higher"]

        # The channels come down behind the vessel, go ahead over its handles, and lift it.
        away = fit.back + fit.length + values["behind"]
        speed = values["taking"]
        yield Step(foot @ at(-away, 0.0, low + values["above"]))
        yield Step(foot @ at(-away, 0.0, low))
        yield Step(foot @ at(-fit.back, 0.0, low), speed, touch=True)
        yield Step(foot @ at(-fit.back, 0.0, high), speed, touch=True)

        # It goes to where the vessel's mouth will be above the place.
        side = 1.0 if values["side"] > 0 else -1.0
        away = job.layout.reach.find_heading(job.center + job.shift) - job.heading
        x, y, _ = job.way
        place = at(x, y, foot.position[2], yaw=away + values["heading"])
        there = place @ at(-fit.back, -side * values["aside"] * values["drop"], high)
        yield Step(there, values["carrying"], touch=True)

        # It is turned over, and shaken.
        turn = side * values["turn"]
        for share in np.linspace(0.0, 1.0, _TURN_STEPS + 1)[1:]:
            over = there @ at(0.0, 0.0, 0.0, roll=share * turn)
            yield Step(over, touch=True)

        shaken = at(0.0, 0.0, _SHAKE_M) @ over
        for pose in (shaken, over, shaken):
            yield Step(pose, touch=True)


class _Fit(NamedTuple):
    """How channels fit the handles of a vessel; metres, across and along its frame.

    Attributes:
        vessel: what is carried.
        height: of the handles' middle, above the vessel's foot.
        inner: from the vessel's middle to where a channel begins.
        outer: from there to its web.
        half: from a channel's middle up and down to those of its edges.
        length: of a channel.
        lip: the thickness of its web and edges, of which each bears the vessel at times.
        back: from the vessel's middle to the flange.
    """

    vessel: Job
    height: float
    inner: float
    outer: float
    half: float
    length: float
    lip: float
    back: float


def _fit_channels(job: Job, values: Values) -> _Fit:
    """Fit channels to the handles of the vessel of a job that suits."""
    vessel = job.vessel
    assert vessel is not None
    handles = find_handles(vessel)
    assert handles is not None

    to_crossbar = vessel.size[0] / 2 + values["gap"]
    inner = handles.inner + _FREE_SHARE * (handles.outer - handles.inner)
    outer = handles.outer + values["room"]
    high = handles.high - handles.low
    length = float(handles.front + to_crossbar + values["longer"])
    lip = vessel.find_thickness(length, values["lip"], _MOST_LIP_M, outer - inner)
    return _Fit(
        vessel=vessel,
        height=(handles.low + handles.high) / 2,
        inner=inner,
        outer=outer,
        half=high / 2 + values["room"] + lip / 2,
        length=length,
        lip=lip,
        back=to_crossbar + 2 * _PLATE_M,
    )


def _build_channel(name: str, side: float, fit: _Fit, values: Values) -> list[Piece]:
    """Build a channel before the crossbar, on the left for a side of 1, on the right for -1."""
    lip = fit.lip
    middle = -values["drop"]
    x = 2 * _PLATE_M + fit.length / 2
    y = side * (fit.outer + fit.inner) / 2
    web = (fit.length, lip, 2 * fit.half + lip)
    edge = (fit.length, fit.outer - fit.inner, lip)
    crossbar = 1  # the number of the piece that bears it
    return [
        box(f"{name}_web", x, side * (fit.outer + lip / 2), middle, web, crossbar),
        box(f"{name}_lower", x, y, middle - fit.half, edge, crossbar),
        box(f"{name}_upper", x, y, middle + fit.half, edge, crossbar),
    ]


def _find_passing_height(job: Job, fit: _Fit, foot: Pose, low: float) -> float:
    """Find how high above the vessel's foot the flange passes everything near, with the vessel upright or lying.

    Args:
        job: that suits.
        fit: of its vessel.
        foot: the vessel's frame in the job's.
        low: how high the flange is above the foot, metres.
    """
    lying = max(fit.vessel.size[:2]) / 2
    top = job.clear - foot.position[2]
    return float(top + max(low, lying) + _PASSES_M)
