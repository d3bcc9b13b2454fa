"""Sweep scattered bodies together."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from core.geometry import Pose
from plugins.vlms.offline.heads import Head, Piece, Step, at, box
from plugins.vlms.offline.job import Job
from plugins.vlms.offline.recipe import Values
from plugins.vlms.offline.ways.way import (
    Way,
    move_along,
    wall_height,
)

_LEAST_AWAY_M = 0.01  # the bodies the wall comes down, at least


class Sweep(Way):
    r"""A wall between two wings that open forward comes down behind bodies, and gathers them on its way to the goal.

    Seen from above, with x to the right; the head's origin is at the wall's front:

             /  left wing
            |   wall
             \  right wing

    A wing that is turned from the motion by less than about 60 degrees lets bodies slide along it to the middle.
    """

    name = "sweep"
    title = "sweeps scattered bodies together with a wall between two wings"
    sizes = {
        "room": (0.0, 0.03),  # beside the outermost bodies
        "narrow": (0.15, 0.6),  # the wall, of the width between the wings' ends
        "angle": (0.4, 1.0),  # of the wings, from the motion
        "height": (0.8, 1.8),  # of the bodies'
        "thick": (0.005, 0.01),
    }
    moves = {
        "behind": (0.3, 1.0),  # of the wings' depth, from where it comes down
        "above": (0.001, 0.005),  # the ground
        "heap": (0.02, 0.15),  # before the goal's middle the wall stops
        "speed": (0.1, 0.35),
        "leaves": (0.0, 1.0),  # from a half on
    }

    def suits(self, job: Job) -> float:
        if len(job.want.bodies) < 2 or job.falls or job.is_covered:
            return 0.0
        return float(job.slides)

    def head(self, job: Job, values: Values) -> Head:
        thick = values["thick"]
        height = wall_height(job, values)
        wall, end, depth = self._measure(job, values)
        pieces = [box("wall", -thick / 2, 0.0, height / 2, (thick, 2 * wall, height))]

        # A wing goes from an end of the wall's back to beside the bodies.
        length = float(np.hypot(depth, end - wall)) + thick
        for name, side in (("left_wing", 1.0), ("right_wing", -1.0)):
            turn = (0.0, 0.0, side * values["angle"])
            root = Pose.xyz_rpy((-thick, side * wall, height / 2), turn)
            middle = root @ at(length / 2, 0.0, 0.0)
            pieces.append(Piece(name, middle, (length, thick, height)))

        attach = np.array([-thick / 2, 0.0, height])
        return Head(pieces, attach, f"a wall with wings {2 * end:.2f} m apart")

    def motion(self, job: Job, values: Values) -> Iterator[Step]:
        _, _, depth = self._measure(job, values)
        foot = values["above"]
        behind = -job.size[0] / 2 - _LEAST_AWAY_M - values["behind"] * depth
        begin = at(behind, 0.0, foot)
        end = at(job.length - values["heap"], 0.0, foot)

        yield from move_along(job, values, begin, end)

    @staticmethod
    def _measure(job: Job, values: Values) -> tuple[float, float, float]:
        """Measure half the wall's width, half the width between the wings' ends, and how far they go ahead."""
        end = float(job.size[1] / 2 + values["room"])
        wall = values["narrow"] * end
        return wall, end, float((end - wall) / np.tan(values["angle"]))
