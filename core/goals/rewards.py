"""Make a reward of a task's goals, and margins."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from typing import Protocol

import numpy as np

from core.geometry import Array
from core.goals.evidence import Evidence
from core.goals.goal import Goal
from core.goals.limit import limits
from core.goals.reaching import numbered, reaches
from core.values.margins import Margin, find_least
from core.values.states import State
from core.values.traces import Trace


class Aim(Protocol):
    """A task, or what has its goals.

    ``every``: whether all goals to reach count; else one is enough.
    """

    @property
    def goals(self) -> Sequence[Goal]: ...

    @property
    def every(self) -> bool: ...


def goals_reward(
    task: Aim, start: State, end: State, trace: Trace | None = None
) -> Array:
    """Compute the reward, 0..1, that a task's goals stand for, of one world or of many, (...).

    The progress of a goal rises from 0 at the start to 1 where it is fulfilled, linearly with the distance that is left
    over. With ``every`` the mean of what is to be reached counts, by weight, else the best of it. It is multiplied by
    the share of each limit: 0 where the robot touched what it must not, and less where a body to keep moved.

    Raises:
        ValueError: the goals need a trace, and there is none; or a goal comes after one that is not there.
    """
    evidence = Evidence(start, end, trace, task.goals)
    wanted = reaches(task.goals)
    shares = [goal.share(evidence) for goal in wanted]

    reward = np.zeros(end.positions.shape[:-2])

    if shares and task.every:
        reward = np.average(shares, axis=0, weights=[goal.weight for goal in wanted])
    elif shares:
        reward = np.max(shares, axis=0)

    for limit in limits(task.goals):
        reward = reward * limit.share(evidence)
    return np.clip(reward, 0.0, 1.0)


def goals_shares(
    task: Aim, start: State, end: State, trace: Trace | None
) -> tuple[tuple[str, float], ...]:
    """Say how far one world fulfilled each of several goals that all count, 0..1.

    None where one goal is enough, or where they don't fit the scene: goals are a hint.
    """
    if not task.every or len(reaches(task.goals)) < 2:
        return ()

    evidence = Evidence(start, end, trace, task.goals)

    try:
        return tuple(
            (goal.label(number), float(goal.share(evidence)))
            for number, goal in numbered(task.goals).items()
        )
    except (AttributeError, KeyError, ValueError):
        return ()


def are_goals_met(
    task: Aim, start: State, end: State, trace: Trace | None = None
) -> bool:
    """Report whether one world meets what a task's goals ask, and keeps their limits: no margin is beyond its limit."""
    if not reaches(task.goals):
        return False

    margins = goals_margins(task, start, end, trace)
    return all(margin.is_kept for margin in margins)


def goals_margins(
    task: Aim, start: State, end: State, trace: Trace | None = None
) -> list[Margin]:
    """Say how far one world stayed from the limits of a task's goals.

    Of goals one of which is enough, these are the margins of the best: of that whose least margin is the largest.
    """
    evidence = Evidence(start, end, trace, task.goals)
    groups = [goal.judge(evidence) for goal in reaches(task.goals)]

    if not task.every:
        best = max(groups, key=find_least, default=[])
        groups = [best]

    return [*limits_margins(task, start, end, trace), *chain(*groups)]


def limits_margins(
    task: Aim, start: State, end: State, trace: Trace | None = None
) -> list[Margin]:
    """Say how far one world stayed from the limits alone.

    This is for tasks that measure themselves what is reached (`core.task.Task.margins`).
    """
    evidence = Evidence(start, end, trace, task.goals)
    return list(chain(*(limit.judge(evidence) for limit in limits(task.goals))))
