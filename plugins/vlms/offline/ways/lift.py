"""Lift bodies from below, by tines beside what they stand on."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from plugins.vlms.offline.handles import Handles, find_handles
from plugins.vlms.offline.heads import Head, Step, at, box
from plugins.vlms.offline.job import Job
from plugins.vlms.offline.ways.way import Range, Ranges, Values, Way, above

_THIN_M = 0.004  # a tine, at least
_THICK_M = 0.012  # and at most
_WALL_M = 0.012  # thick, behind the tines


class Lift(Way):
    """Two tines go in beside the bodies' foot, below what stands out of them, and lift them straight up."""

    name = "lift"
    approaches = True
    title = "lifts bodies by what stands out of them, with two tines beside their foot"
    sizes: ClassVar[Ranges] = {
        "depth": Range(0.8, 1.1),  # of the bodies' length
        "tine": Range(0.4, 0.9),  # of what stands out
        "thick": Range(0.3, 0.6),  # of the height below what stands out
        "room": Range(0.002, 0.01),  # between tines and foot
        "behind": Range(0.01, 0.04),  # bodies the wall stays
    }
    moves: ClassVar[Ranges] = {
        "below": Range(0.002, 0.012),  # what stands out, as they go in
        "higher": Range(0.0, 0.02),  # than the bodies have to get
        "speed": Range(0.1, 0.35),
        "lifting": Range(0.1, 0.35),
    }

    def suits(self, job: Job) -> float:
        if job.is_covered or not job.rises or job.want.released:
            return 0.0
        return float(find_handles(job) is not None)

    def head(self, job: Job, values: Values) -> Head:
        handles, depth, thick = self._measure(job, values)
        out = job.size[1] / 2 - handles.inner
        tine = max(0.006, out * values["tine"])
        inner = handles.inner + values["room"]
        width = 2 * (inner + tine)
        high = float(np.clip(job.size[2] - handles.low, 0.03, 0.08))

        wall = box("wall", -_WALL_M / 2, 0.0, high / 2, (_WALL_M, width, high))
        size = (depth + _WALL_M, tine, thick)
        x = (depth - _WALL_M) / 2
        tines = [
            box(name, x, side * (inner + tine / 2), thick / 2, size)
            for name, side in (("left", 1.0), ("right", -1.0))
        ]
        return Head([wall, *tines], np.array([-_WALL_M / 2, 0.0, high]), "a fork")

    def motion(self, job: Job, values: Values) -> Iterator[Step]:
        handles, depth, thick = self._measure(job, values)
        low = max(0.001, handles.low - thick - values["below"])
        behind = -job.size[0] / 2 - values["behind"]
        before = at(behind - depth, 0.0, low)
        below = at(behind, 0.0, low)
        lift = job.rise + values["higher"] + handles.low - thick - low
        up = at(behind, 0.0, low + lift)

        yield above(job, before)
        yield Step(before)
        yield Step(below, speed=values["speed"], touch=True)
        yield Step(up, speed=values["lifting"], touch=True)

        if job.goes:
            x, y, _ = job.way
            there = at(behind + x, y, up.position[2])
            yield Step(there, speed=values["lifting"], touch=True)

    @staticmethod
    def _measure(job: Job, values: Values) -> tuple[Handles, float, float]:
        """Measure what stands out, how far the tines go ahead of the wall, and how thick they are."""
        handles = find_handles(job)
        assert handles is not None  # the job suits
        depth = job.size[0] * values["depth"] + values["behind"]
        thick = float(np.clip(handles.low * values["thick"], _THIN_M, _THICK_M))
        return handles, depth, thick
