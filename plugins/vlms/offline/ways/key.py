"""Lift a body by a slot in its middle, with a key that turns below it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from core.geometry import Array
from plugins.vlms.offline.heads import Head, Step, at, box
from plugins.vlms.offline.job import Job, span
from plugins.vlms.offline.layout import solid_points
from plugins.vlms.offline.recipe import Values
from plugins.vlms.offline.ways.way import Way, above

_BIT_M = 0.008  # high, to bear a body
_STEM_M = 0.07  # longer than the body is high: what bears the key stays above it
_SHORTEST = 0.75  # of the slot's length, a bit is at least,
_RESTS = 1.1  # and of its width, so that it rests on the slot's edges when it is turned


class Key(Way):
    """A T goes down through a slot along x, turns by a quarter below it, and lifts the body by the slot's edges."""

    name = "key"
    title = "goes through a slot, turns below it, and lifts"
    approaches = True
    sizes = {
        "length": (_SHORTEST, 0.95),  # of the slot's
        "width": (0.3, 0.6),  # of the slot's
    }
    moves = {
        "below": (0.004, 0.02),  # the body, as it turns
        "higher": (0.0, 0.03),  # than the body has to get
        "lifting": (0.05, 0.2),
    }

    def suits(self, job: Job) -> float:
        if job.is_covered or not job.rises or job.want.released:
            return 0.0
        long, wide = _measure_slot(job)
        return float(_SHORTEST * long > _RESTS * wide > 0)

    def head(self, job: Job, values: Values) -> Head:
        long, wide = _measure_slot(job)
        thick = wide * values["width"]
        top = _BIT_M + float(job.size[2]) + _STEM_M
        bit = (long * values["length"], thick, _BIT_M)
        pieces = [
            box("stem", 0.0, 0.0, top / 2, (thick, thick, top)),
            box("bit", 0.0, 0.0, _BIT_M / 2, bit),
        ]
        return Head(pieces, np.array([0.0, 0.0, top]), "a T")

    def motion(self, job: Job, values: Values) -> Iterator[Step]:
        low = -_BIT_M - values["below"]
        quarter = np.pi / 2
        yield above(job, at(0.0, 0.0, 0.0))
        yield Step(at(0.0, 0.0, low), touch=True)
        yield Step(at(0.0, 0.0, low, yaw=quarter), touch=True)

        # The body lies on top of the bit.
        up = job.rise + values["higher"] - _BIT_M
        yield Step(at(0.0, 0.0, up, yaw=quarter), values["lifting"], touch=True)


def _measure_slot(job: Job) -> tuple[float, float]:
    """Measure the hole in the middle of the bodies along the frame's x and y; 0, where there is none."""
    into_frame = job.frame.inverse()
    bounds = []
    for name in job.want.bodies:
        for solid in job.layout.solids[name]:
            bounds.append(span(into_frame.apply(solid_points(solid))))

    return _measure_gap(bounds, 0), _measure_gap(bounds, 1)


def _measure_gap(bounds: Sequence[tuple[Array, Array]], axis: int) -> float:
    """Measure how long the hole around the frame's middle is along x or y: what lies across that axis ends it."""
    across = 1 - axis
    gaps = [
        max(low[axis], -high[axis], 0.0)
        for low, high in bounds
        if low[across] < 0 < high[across]
    ]
    return 2 * float(min(gaps, default=0.0))
