"""Move a body between walls."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from plugins.vlms.offline.heads import Head, Step, at, box, build_walls
from plugins.vlms.offline.job import Job
from plugins.vlms.offline.recipe import Values
from plugins.vlms.offline.ways.way import (
    Way,
    move_along,
    wall_height,
)

_MOST_THICK_M = 0.02  # a wall
_WALLS_M = 0.012  # of room beside bodies, for walls


class Cage(Way):
    """Walls come down behind a body and beside it, and lead it where it has to go.

    A fourth wall before the body stops what rolls.
    """

    name = "cage"
    title = "leads a body along the ground between walls, which also stop what rolls"
    sizes = {
        "room": (0.003, 0.025),  # between the body and each wall
        "height": (0.5, 1.2),  # of the body's
        "thick": (0.005, 0.01),
        "depth": (0.5, 1.1),  # of the body's, of the walls beside it
        "front": (0.0, 1.0),  # from a half on there is a wall before the body
    }
    moves = {
        "above": (0.002, 0.008),  # the ground
        "farther": (-0.02, 0.02),  # than the body has to go
        "speed": (0.1, 0.35),
        "leaves": (0.0, 1.0),  # from a half on
    }

    def suits(self, job: Job) -> float:
        if len(job.want.bodies) > 1 or job.falls or not job.slides or job.is_covered:
            return 0.0
        if min(job.room(y=1.0), job.room(y=-1.0)) <= _WALLS_M:
            return 0.0
        return 1.0

    def head(self, job: Job, values: Values) -> Head:
        height = wall_height(job, values)
        inside = job.size[1] + 2 * values["room"]
        closed = values["front"] > 0.5
        depth = values["depth"] * job.size[0]
        if closed:
            depth = job.size[0] + 2 * values["room"]

        # The wall before the body is borne by the left one alone, and by half of the one behind.
        length = depth + (inside if closed else 0.0)
        thick = job.find_thickness(length, values["thick"], _MOST_THICK_M, height)
        pieces = build_walls(thick, inside, depth, height)
        if closed:
            across = pieces[0].size
            pieces.append(box("front", depth + thick / 2, 0.0, height / 2, across, 1))

        return Head(pieces, np.array([-thick / 2, 0.0, height]), "walls around a body")

    def motion(self, job: Job, values: Values) -> Iterator[Step]:
        foot = min(values["above"], job.size[2] / 2)
        behind = -job.size[0] / 2
        begin = at(behind - values["room"], 0.0, foot)
        end = at(behind + job.length + values["farther"], 0.0, foot)

        yield from move_along(job, values, begin, end, back=0.0)
