"""Find the ways of using a tool that suit a task in a layout."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from core.interfaces import Task
from plugins.vlms.offline_new.job import Job
from plugins.vlms.offline_new.layout import Layout
from plugins.vlms.offline_new.wants import list_wants
from plugins.vlms.offline_new.ways import WAYS
from plugins.vlms.offline_new.ways.way import Way

_TURNS = (0.0, np.pi, np.pi / 2, -np.pi / 2)  # the first one away from the robot


@dataclass(frozen=True, eq=False)
class Option:
    """A way of using a tool that suits an alternative of the task.

    Attributes:
        way: of using a tool.
        number: of the alternative.
        jobs: that are done one after another.
        weight: how often it is chosen, in relation to others.
    """

    way: Way
    number: int
    jobs: Sequence[Job]
    weight: float


def list_options(layout: Layout, task: Task, fingers: bool) -> list[Option]:
    """List the ways of using a tool that suit a task in a layout, for all its alternatives.

    Args:
        layout: of the task.
        task: whose goals are read.
        fingers: whether tools are on the fingers of a gripper.
    """
    options = []
    ways = [way for way in WAYS if way.fingers == fingers]

    for way in ways:
        for number, jobs in enumerate(list_alternatives(layout, task, way)):
            weight = min(way.suits(job) for job in jobs)
            if weight > 0:
                options.append(Option(way, number, jobs, weight))

    return options


def list_alternatives(layout: Layout, task: Task, way: Way) -> list[tuple[Job, ...]]:
    """List the alternatives that a task leaves to a way: what a tool has to do in each, and from which side."""
    found: list[tuple[Job, ...]] = []
    for wants in list_wants(task, layout.scene):
        if any(want.others for want in wants):
            continue

        turns = _TURNS
        if not way.approaches and not all(want.away for want in wants):
            turns = _TURNS[:1]
        for turn in turns:
            jobs = (Job(layout, want, turn, way.approaches) for want in wants)
            found.append(tuple(jobs))

    return found
