"""Scoop bodies up from the ground."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from plugins.vlms.offline.heads import Head, Step, at, box
from plugins.vlms.offline.job import Job
from plugins.vlms.offline.recipe import Values
from plugins.vlms.offline.ways.way import (
    OVER_M,
    Way,
    above,
    wall_height,
)

_BESIDE_M = 0.002  # of what is beside and before it, a floor stays
_ENTRY_M = 0.05  # of room before bodies, to come down there
_CLIMBED_M = 0.01  # of the floor's edge has no walls, where bodies climb onto it
_FLOOR_M = 0.003  # thick, at most: bodies climb onto it
_WALL_M = 0.004  # thick, at least; and twice as thick as the floor


class Scoop(Way):
    """A thin floor before a wall slides under the bodies, and lifts them; or carries them to a place, and tips.

    It comes from a side where there is room. Seen from the right, with x to the right; the head's origin is at the
    wall's front, at the floor's underside:

        |
        | wall, and rails beside the floor
        |__________  floor
    """

    name = "scoop"
    approaches = True
    title = (
        "slides a thin floor under bodies, lifts them, carries them, and tips them out"
    )
    sizes = {
        "room": (0.002, 0.02),  # beside the bodies
        "depth": (0.9, 1.15),  # of the bodies' length
        "floor": (0.001, 0.003),  # thick, or as thick as it must be
        "height": (0.7, 1.3),  # of the bodies', of the wall behind them
        "rails": (0.0, 0.8),  # of that height, of the walls beside them
    }
    moves = {
        "above": (0.0005, 0.003),  # the ground
        "behind": (0.005, 0.03),  # the bodies
        "under": (0.95, 1.03),  # of its depth
        "speed": (0.08, 0.3),
        "lean": (0.0, 0.25),  # back, with bodies on it
        "higher": (0.0, 0.03),  # than the bodies have to get
        "lifting": (0.12, 0.35),  # speed
        "carrying": (0.15, 0.4),  # speed
        "tip": (0.5, 1.3),  # down, to pour them out
        "to_edge": (0.0, 1.0),  # of the floor's depth, that lies over the place
    }

    def suits(self, job: Job) -> float:
        if job.is_covered or job.beyond or job.room(x=-1.0) < _ENTRY_M:
            return 0.0
        if job.rises:
            return 0.0 if job.want.released else 0.6
        if job.want.held:
            return 0.0
        if job.goes and (job.falls or not job.slides):
            return 0.1
        return 0.0

    def head(self, job: Job, values: Values) -> Head:
        width, depth = self._measure(job, values)
        thin = job.find_thickness(depth, values["floor"], _FLOOR_M, width)
        thick = max(_WALL_M, 2 * thin)
        height = wall_height(job, values)
        wall = (thick, width, height)
        floor = (depth + thick, width, thin)
        pieces = [
            box("wall", -thick / 2, 0.0, height / 2, wall),
            box("floor", (depth - thick) / 2, 0.0, thin / 2, floor),
        ]

        rail = values["rails"] * height
        if rail > 2 * thin:
            length = depth - _CLIMBED_M
            for name, side in (("left_rail", 1.0), ("right_rail", -1.0)):
                y = side * (width - thick) / 2
                size = (length, thick, rail)
                pieces.append(box(name, length / 2, y, rail / 2, size, parent=1))

        text = f"a scoop {width:.2f} m wide"
        return Head(pieces, np.array([-thick / 2, 0.0, height]), text)

    def motion(self, job: Job, values: Values) -> Iterator[Step]:
        _, depth = self._measure(job, values)
        low = values["above"]
        behind = -job.size[0] / 2 - values["behind"] - depth
        ahead = behind + values["behind"] + depth * values["under"]
        lean = -values["lean"]

        # The floor slides under the bodies, and leans back.
        before = at(behind, 0.0, low)
        yield above(job, before)
        yield Step(before)
        yield Step(at(ahead, 0.0, low), speed=values["speed"], touch=True)
        yield Step(at(ahead, 0.0, low, pitch=lean), touch=True)

        # What goes somewhere else passes everything, with the floor's edge tipped down too.
        lift = max(0.0, job.rise) + values["higher"]
        if job.goes:
            hangs = depth * float(np.sin(values["tip"]))
            lift = max(lift, job.clear + OVER_M + hangs)
        high = low + lift
        up = at(ahead, 0.0, high, pitch=lean)
        yield Step(up, speed=values["lifting"], touch=True)
        if not job.goes:
            return

        x, y, _ = job.way
        x += ahead - values["to_edge"] * depth / 2
        there = at(x, y, high, pitch=lean)
        yield Step(there, speed=values["carrying"], touch=True)
        if not job.rises:
            tipped = at(x, y, high, pitch=values["tip"])
            yield Step(tipped, touch=True)

    @staticmethod
    def _measure(job: Job, values: Values) -> tuple[float, float]:
        """Measure how wide the floor is, and how far it goes ahead of the wall."""
        room = min(job.room(y=1.0), job.room(y=-1.0)) - _BESIDE_M
        width = job.size[1] + 2 * min(values["room"], room)
        ahead = job.room(x=1.0) - _BESIDE_M
        depth = min(values["depth"] * job.size[0], job.size[0] + ahead)
        return float(width), float(depth)
