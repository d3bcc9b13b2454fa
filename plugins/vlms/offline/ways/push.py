"""Push bodies from behind."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from plugins.vlms.offline.heads import Head, Step, at, box
from plugins.vlms.offline.job import Job
from plugins.vlms.offline.recipe import Values
from plugins.vlms.offline.ways.way import (
    Way,
    move_along,
    wall_height,
)

_MOST_THICK_M = 0.02  # a wall
_PLAY_M = 0.004  # a wall is narrower than the room for it


class Push(Way):
    """A wall comes down behind the bodies and moves as far as they have to go.

    Where they only lie beside others, a narrow wall goes between these.
    """

    name = "push"
    title = "pushes bodies along the ground from behind"
    sizes = {
        "width": (0.2, 1.6),  # of the bodies'
        "height": (0.5, 1.2),  # of the bodies'
        "thick": (0.006, 0.012),
    }
    moves = {
        "behind": (0.004, 0.03),
        "above": (0.002, 0.012),  # the ground
        "farther": (-0.02, 0.02),  # than they have to go
        "aside": (-0.05, 0.05),  # of their middle, in their widths
        "speed": (0.1, 0.4),
        "leaves": (0.0, 1.0),  # from a half on
    }

    def suits(self, job: Job) -> float:
        if job.falls or not job.slides or job.is_covered:
            return 0.0
        if len(job.want.bodies) > 1:
            return 0.1
        return 0.5

    def head(self, job: Job, values: Values) -> Head:
        room = min(job.room(y=1.0), job.room(y=-1.0))
        widest = job.size[1] + 2 * room - _PLAY_M
        width = min(values["width"] * job.size[1], widest)
        height = wall_height(job, values)
        far = float(np.hypot(width / 2, height))
        thick = job.find_thickness(far, values["thick"], _MOST_THICK_M, height)
        wall = box("wall", -thick / 2, 0.0, height / 2, (thick, width, height))
        return Head([wall], np.array([-thick / 2, 0.0, height]), "a wall")

    def motion(self, job: Job, values: Values) -> Iterator[Step]:
        foot = min(values["above"], job.size[2] / 2)
        beside = values["aside"] * job.size[1]
        touching = -job.size[0] / 2
        begin = at(touching - values["behind"], beside, foot)
        end = at(touching + job.length + values["farther"], beside, foot)

        yield from move_along(job, values, begin, end)
