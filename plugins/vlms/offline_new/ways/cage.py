"""Move bodies between walls."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from core.geometry import Pose
from plugins.vlms.offline_new.heads import Head, Piece, Step, at, box
from plugins.vlms.offline_new.job import Job
from plugins.vlms.offline_new.ways.way import Range, Values, Way, above

_LEAST_ROOM_M = 0.003  # beside bodies: a head comes down around them
_WALLS_M = 0.012  # for walls beside them


class Cage(Way):
    """Walls come down behind the bodies and beside them, and lead them where they have to go.

    The side walls may open outward, to gather what is scattered; a fourth wall before the bodies stops what rolls.
    """

    name = "cage"
    title = "leads bodies along the ground between walls, which also gather what is scattered and stop what rolls"
    sizes = {
        "room": Range(0.003, 0.025),  # between the bodies and each wall
        "height": Range(0.5, 1.2),  # of the bodies'
        "thick": Range(0.005, 0.01),
        "depth": Range(0.5, 1.1),  # of the bodies', that walls beside them have
        "narrow": Range(0.3, 1.0),  # of the bodies' width, that the wall behind several has
        "front": Range(0.0, 1.0),  # from a half on there is a wall before the bodies
    }
    moves = {
        "above": Range(0.002, 0.008),  # the ground
        "farther": Range(-0.02, 0.02),  # than they have to go
        "speed": Range(0.1, 0.35),
        "leaves": Range(0.0, 1.0),  # from a half on
    }

    def suits(self, job: Job) -> float:
        room = min(job.room(y=1.0), job.room(y=-1.0))
        if not job.goes or job.rises or job.falls or job.beyond or room < _WALLS_M:
            return 0.0
        return 1.0

    def head(self, job: Job, values: Values) -> Head:
        thick = values["thick"]
        height = float(np.clip(values["height"] * job.size[2], 0.02, 0.15))
        inside = job.size[1] + 2 * values["room"]
        depth = self._measure_depth(job, values)
        behind = inside
        if len(job.want.bodies) > 1:
            behind = inside * values["narrow"]

        wide = behind + 2 * thick
        pieces = [box("back", -thick / 2, 0.0, height / 2, (thick, wide, height))]
        pieces += self._make_sides(behind, inside, depth, height, thick)

        if self._is_closed(job, values):
            x = depth + thick / 2
            size = (thick, inside + 2 * thick, height)
            pieces.append(box("front", x, 0.0, height / 2, size, parent=1))

        return Head(pieces, np.array([-thick / 2, 0.0, height]), "walls")

    @staticmethod
    def _make_sides(
        behind: float, inside: float, depth: float, height: float, thick: float
    ) -> Iterator[Piece]:
        """Make the walls beside the bodies, which open from the width behind them to that before them."""
        opening = (inside - behind) / 2
        angle = float(np.arctan2(opening, depth))
        length = float(np.hypot(opening, depth)) + thick
        for name, side in (("left", 1.0), ("right", -1.0)):
            y = side * (behind + thick) / 2
            foot = Pose.xyz_rpy((-thick, y, height / 2), (0.0, 0.0, side * angle))
            yield Piece(name, foot @ at(length / 2, 0.0, 0.0), (length, thick, height))

    @staticmethod
    def _is_closed(job: Job, values: Values) -> bool:
        """Report whether there is a wall before the bodies."""
        return values["front"] > 0.5 and len(job.want.bodies) == 1

    def _measure_depth(self, job: Job, values: Values) -> float:
        """Measure how far the walls go beside the bodies."""
        if self._is_closed(job, values):
            return float(job.size[0] + 2 * values["room"])
        return float(job.size[0] * values["depth"])

    def motion(self, job: Job, values: Values) -> Iterator[Step]:
        foot = min(values["above"], job.size[2] / 2)
        room = max(values["room"], _LEAST_ROOM_M)
        begin = at(-job.size[0] / 2 - room, 0.0, foot)
        end = at(-job.size[0] / 2 + job.length + values["farther"], 0.0, foot)

        yield above(job, begin)
        yield Step(begin)
        yield Step(end, speed=values["speed"], touch=True)

        if values["leaves"] > 0.5 or job.want.released:
            up = above(job, end)
            yield Step(up.pose, touch=True)
