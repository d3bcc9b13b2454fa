"""Find the ways of using a tool that suit a task in a layout."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from core.design import Tool
from core.goals import Want, numbered
from core.interfaces import Material, Robot, Task
from plugins.vlms.offline.job import Job
from plugins.vlms.offline.layout import Layout
from plugins.vlms.offline.wants import list_alternatives
from plugins.vlms.offline.ways import WAYS
from plugins.vlms.offline.ways.way import Way

KINDS = ("rigid", "gripper")
"""All kinds of tools: on the flange, and on the fingers of a gripper."""

# The first one is away from the robot.
_SIDE_TURNS_RAD = (0.0, np.pi, np.pi / 2, -np.pi / 2)
# Half a turn brings each finger to where the other one was.
_HAND_TURNS_RAD = tuple(np.arange(-3, 5) * np.pi / 8)


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

    @property
    def layout(self) -> Layout:
        """Where its jobs are."""
        return self.jobs[0].layout

    @property
    def load(self) -> float:
        """The force that its tool has to bear, newtons."""
        return max(job.load for job in self.jobs)

    @property
    def numbers(self) -> set[int]:
        """The numbers of the goals that it does."""
        return {job.want.number for job in self.jobs}


def list_options(
    layout: Layout, task: Task, fingers: bool, given: Tool | None
) -> list[Option]:
    """List the ways of using a tool that suit a task in a layout, for all its alternatives.

    Where a tool is given that is of no use as such tools are, it may be used as any other one.

    Args:
        layout: of the task.
        task: whose goals are read.
        fingers: whether tools are on the fingers of a gripper.
        given: the tool for which plans are made; None: it is not known yet.
    """
    bare = given is not None and not given.components
    possible = _list_ways(task.robot)
    ways = [way for way in possible if way.fingers == fingers and way.bare == bare]
    options = _list_suiting(ways, layout, task)
    if not options and given is not None:
        others = [way for way in possible if not way.bolted]
        options = _list_suiting(others, layout, task)

    return options


def _list_ways(robot: Robot) -> list[Way]:
    """List the ways that are possible with a robot: with an arm that has no gripper, those without fingers."""
    return [way for way in WAYS if robot.gripper is not None or not way.fingers]


def _list_suiting(ways: Sequence[Way], layout: Layout, task: Task) -> list[Option]:
    """List which of some ways suit; see `list_options`."""
    alternatives = list_alternatives(task, layout.scene)
    options = []

    for way in ways:
        for number, jobs in enumerate(_list_jobs(alternatives, layout, way)):
            weight = min(_weigh(way, job) for job in jobs)
            if weight > 0:  # what does more goals is chosen more often
                options.append(Option(way, number, jobs, weight * len(jobs) ** 2))

    return options


def _weigh(way: Way, job: Job) -> float:
    """Say how well a way suits a job: not at all, if it does something else."""
    if job.asks != way.does:
        return 0.0
    return way.suits(job)


def _list_jobs(
    alternatives: Sequence[Sequence[Want]], layout: Layout, way: Way
) -> Iterator[tuple[Job, ...]]:
    """Yield what a tool has to do in each alternative, from each side from which a way may do it."""
    for wants in alternatives:
        turns: Sequence[float] = _SIDE_TURNS_RAD
        if not way.approaches and not all(want.away for want in wants):
            turns = _SIDE_TURNS_RAD[:1]
        if way.fingers:
            turns = _HAND_TURNS_RAD
        for turn in turns:
            yield tuple(Job(layout, want, turn, way.approaches) for want in wants)


def find_unplanned(
    task: Task, seed: int, material: Material, kinds: Sequence[str] = KINDS
) -> list[str]:
    """Name the goals of a task for which no way of using a tool suits, in the layout of a seed.

    Where one goal is enough and planned for, none is missing. Where all count, and no way does all of them, that is
    named.

    Args:
        task: whose goals are read.
        seed: of the layout.
        material: of which tools are made.
        kinds: of tools that may be made.
    """
    ways = [way for way in _list_ways(task.robot) if way.kind in kinds]
    options = _list_suiting(ways, Layout(task, seed, material), task)
    planned = [option.numbers for option in options]
    if planned and not task.every:
        return []

    goals = numbered(task.goals)
    left = goals.keys() - set().union(*planned)
    unplanned = [goals[number].in_short() for number in sorted(left)]
    if not unplanned and {*goals} not in planned:
        unplanned.append("all goals with one tool")

    return unplanned
