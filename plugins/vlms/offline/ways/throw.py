"""Throw bodies to where no tool gets, or drop them off what they stand on, with a wall between two short ones."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from plugins.vlms.offline.heads import Head, Step, at, build_walls
from plugins.vlms.offline.job import Job
from plugins.vlms.offline.recipe import Values
from plugins.vlms.offline.ways.way import Ranges, Way, above, wall_height

_RUN: Ranges = {
    "behind": (0.005, 0.03),  # the bodies, where the wall comes down
    "above": (0.002, 0.008),  # the ground
    "heading": (-0.15, 0.15),  # beside the bodies' way
    "speed": (0.4, 2.0),
}


class Throw(Way):
    """A wall between two short ones runs with the bodies, and stops: they slide or roll on.

    The wrist swings about the vertical meanwhile, from one side of the way to the other, which makes the wall faster.
    """

    name = "throw"
    title = "throws bodies on along the ground, with a wall that stops"
    sizes = {
        "room": (0.002, 0.01),  # between the bodies and the walls beside them
        "height": (0.6, 1.3),  # of the bodies'
        "depth": (0.2, 0.8),  # of the bodies', of the walls beside them
        "thick": (0.005, 0.01),
    }
    moves = {
        **_RUN,
        "stroke": (0.4, 0.9),  # metres
        "swing": (-0.8, 0.8),  # to each side
    }

    def suits(self, job: Job) -> float:
        return float(job.beyond and not job.falls and _may_fly(job))

    def head(self, job: Job, values: Values) -> Head:
        thick = values["thick"]
        height = wall_height(job, values)
        inside = job.size[1] + 2 * values["room"]
        depth = values["depth"] * job.size[0]
        pieces = build_walls(thick, inside, depth, height)
        return Head(pieces, np.array([-thick / 2, 0.0, height]), "a wall between two")

    def motion(self, job: Job, values: Values) -> Iterator[Step]:
        yield from _run(job, values, values["stroke"], values["swing"])


class Drop(Throw):
    """A wall between two short ones pushes bodies over an edge: they fall to where they have to go."""

    name = "drop"
    title = "pushes bodies over an edge, with a wall that stops"
    moves = {
        **_RUN,
        "share": (0.3, 1.0),  # of the bodies' way
    }

    def suits(self, job: Job) -> float:
        return float(job.falls and _may_fly(job))

    def motion(self, job: Job, values: Values) -> Iterator[Step]:
        yield from _run(job, values, values["share"] * job.length, 0.0)


def _may_fly(job: Job) -> bool:
    """Report whether bodies may get where they have to go on their own."""
    return job.goes and not (job.rises or job.is_covered or job.want.held)


def _run(job: Job, values: Values, stroke: float, swing: float) -> Iterator[Step]:
    """Yield the poses of a wall that comes down behind bodies, and runs.

    Args:
        job: what is moved.
        values: of the head's parameters, and of those in `_RUN`.
        stroke: how far it runs, metres.
        swing: by how much it is turned to one side of its way first, and to the other in the end, radians.
    """
    # Its walls get nearer to the bodies by so much as it is turned.
    depth = values["depth"] * job.size[0] + job.size[1] / 2
    behind = -job.size[0] / 2 - values["behind"] - depth * abs(np.sin(swing))

    heading = at(0.0, 0.0, 0.0, yaw=values["heading"])
    foot = min(values["above"], job.size[2] / 2)
    begin = heading @ at(behind, 0.0, foot, yaw=-swing)
    end = heading @ at(behind + stroke, 0.0, foot, yaw=swing)

    yield above(job, begin)
    yield Step(begin)
    yield Step(end, speed=values["speed"], touch=True)
