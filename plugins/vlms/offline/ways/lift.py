"""Lift bodies from below, by tines beside what they stand on."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from plugins.vlms.offline.handles import Handles, find_handles
from plugins.vlms.offline.heads import Head, Step, at, box
from plugins.vlms.offline.job import Job
from plugins.vlms.offline.recipe import Values
from plugins.vlms.offline.ways.way import Way, above

_LEAST_TINE_M = 0.004  # a tine is at least so thick, to be made,
_MOST_TINE_M = 0.012  # and at most
_NARROW_M = 0.006  # a tine is at least so wide, to bear what lies on it
_BACK_M = 0.012  # thick, behind the tines
_WALL_HEIGHT_M = (0.03, 0.08)  # at least, to bear the tines, and at most
_FOOT_M = 0.001  # below tines, at least


class Lift(Way):
    """Two tines go in beside the bodies' foot, below what stands out of them, and lift them straight up.

    Seen from above, with x to the right; the head's origin is at the wall's front, at the tines' foot:

        |=========   left tine
        | wall [foot]
        |=========   right tine
    """

    name = "lift"
    approaches = True
    title = "lifts bodies by what stands out of them, with two tines beside their foot"
    sizes = {
        "depth": (0.8, 1.1),  # of the bodies' length
        "tine": (0.4, 0.9),  # wide, of what stands out
        "thick": (0.3, 0.6),  # of the height below what stands out
        "room": (0.002, 0.01),  # between tines and foot
        "behind": (0.01, 0.04),  # bodies the wall stays
    }
    moves = {
        "below": (0.002, 0.012),  # what stands out, as they go in
        "higher": (0.0, 0.02),  # than the bodies have to get
        "speed": (0.1, 0.35),
        "lifting": (0.1, 0.35),  # speed
    }

    def suits(self, job: Job) -> float:
        if job.is_covered or not job.rises or job.want.released:
            return 0.0
        return float(find_handles(job) is not None)

    def head(self, job: Job, values: Values) -> Head:
        handles, depth, thick = self._measure(job, values)
        stands_out = job.size[1] / 2 - handles.inner
        wide = max(_NARROW_M, stands_out * values["tine"])
        inner = handles.inner + values["room"]
        across = 2 * (inner + wide)
        high = float(np.clip(job.size[2] - handles.low, *_WALL_HEIGHT_M))

        wall = box("wall", -_BACK_M / 2, 0.0, high / 2, (_BACK_M, across, high))
        size = (depth + _BACK_M, wide, thick)
        x = (depth - _BACK_M) / 2
        tines = [
            box(name, x, side * (inner + wide / 2), thick / 2, size)
            for name, side in (("left", 1.0), ("right", -1.0))
        ]
        return Head([wall, *tines], np.array([-_BACK_M / 2, 0.0, high]), "a fork")

    def motion(self, job: Job, values: Values) -> Iterator[Step]:
        handles, depth, thick = self._measure(job, values)
        low = max(_FOOT_M, handles.low - thick - values["below"])
        behind = -job.size[0] / 2 - values["behind"]
        before = at(behind - depth, 0.0, low)
        below = at(behind, 0.0, low)

        yield above(job, before)
        yield Step(before)
        yield Step(below, speed=values["speed"], touch=True)

        # The tines come to what stands out, and then the bodies rise.
        lift = job.rise + values["higher"] + handles.low - thick - low
        high = low + lift
        up = at(behind, 0.0, high)
        yield Step(up, speed=values["lifting"], touch=True)

        if job.goes:
            x, y, _ = job.way
            there = at(behind + x, y, high)
            yield Step(there, speed=values["lifting"], touch=True)

    @staticmethod
    def _measure(job: Job, values: Values) -> tuple[Handles, float, float]:
        """Measure what stands out, how far the tines go ahead of the wall, and how thick they are."""
        handles = find_handles(job)
        assert handles is not None  # the job suits
        depth = job.size[0] * values["depth"] + values["behind"]
        thick = float(
            np.clip(handles.low * values["thick"], _LEAST_TINE_M, _MOST_TINE_M)
        )
        return handles, depth, thick
