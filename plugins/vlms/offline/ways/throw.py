"""Throw bodies to where no tool gets, or off what they stand on."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from plugins.vlms.offline.heads import Head, Step, at, build_walls
from plugins.vlms.offline.job import Job
from plugins.vlms.offline.ways.way import Range, Ranges, Values, Way, above, wall_height


class Throw(Way):
    """A wall between two short ones runs with the bodies, and stops: they slide, roll or fall on."""

    name = "throw"
    title = "throws bodies on along the ground, or over an edge, with a wall that stops"
    sizes: ClassVar[Ranges] = {
        "room": Range(0.002, 0.01),  # between the bodies and the walls beside them
        "height": Range(0.6, 1.3),  # of the bodies'
        "depth": Range(0.2, 0.8),  # of the bodies', of the walls beside them
        "thick": Range(0.005, 0.01),
    }
    moves: ClassVar[Ranges] = {
        "behind": Range(0.005, 0.03),
        "above": Range(0.002, 0.008),  # the ground
        "stroke": Range(0.4, 0.9),  # metres, of bodies that are thrown far
        "swing": Range(-0.8, 0.8),  # of the wrist, to both sides, as it throws far
        "share": Range(0.3, 1.0),  # of their way, of bodies that fall
        "fast": Range(0.4, 2.0),  # m/s
        "heading": Range(-0.15, 0.15),
    }

    def suits(self, job: Job) -> float:
        if not job.goes or job.rises or job.is_covered or job.want.held:
            return 0.0
        return float(job.beyond or job.falls)

    def head(self, job: Job, values: Values) -> Head:
        thick = values["thick"]
        height = wall_height(job, values)
        inside = job.size[1] + 2 * values["room"]
        depth = values["depth"] * job.size[0]
        pieces = build_walls(thick, inside, depth, height)
        return Head(pieces, np.array([-thick / 2, 0.0, height]), "a wall between two")

    def motion(self, job: Job, values: Values) -> Iterator[Step]:
        foot = min(values["above"], job.size[2] / 2)
        yaw = values["heading"]
        stroke = values["stroke"]
        swing = values["swing"]
        if job.falls:
            stroke = values["share"] * job.length
            swing = 0.0

        depth = values["depth"] * job.size[0] + job.size[1] / 2
        # Its walls get nearer by so much as it is turned.
        turned = depth * abs(np.sin(swing))
        behind = -job.size[0] / 2 - values["behind"] - turned
        begin = at(behind * np.cos(yaw), behind * np.sin(yaw), foot, yaw=yaw - swing)
        ahead = behind + stroke
        end = at(ahead * np.cos(yaw), ahead * np.sin(yaw), foot, yaw=yaw + swing)

        yield above(job, begin)
        yield Step(begin)
        yield Step(end, speed=values["fast"], touch=True)
