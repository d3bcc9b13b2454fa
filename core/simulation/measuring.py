"""Measure rollouts: the figures that every trial has, those of core and those that plugins offer."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import cast

from core.interfaces import Fitness, Motion, Outcome, Task
from core.plugins import installed
from core.trial import WHAT_DECIDES, Figure, Trial, mean_figure

BEGINS_S = "begins_s"
"""Of a trial that went on from an earlier one (`core.design.Fork`): from when on it was played, s."""

BUILT_IN = {
    "distance_m": Figure(
        lambda task, motion, outcome: motion.distance_m,
        column="distance (m)",
        words="the way of the end-effector's origin",
    ),
    "motion_s": Figure(lambda task, motion, outcome: motion.trajectory.duration),
    "ik_error_m": Figure(lambda task, motion, outcome: motion.misses[:, 0].max()),
    "ik_error_rad": Figure(lambda task, motion, outcome: motion.misses[:, 1].max()),
    "tracking_error_rad": Figure(
        lambda task, motion, outcome: outcome.tracking_error_rad
    ),
}
"""The way from home through all waypoints, the motion's time, the largest misses of the inverse kinematics along the
plan, and the largest lag of a joint behind its target, rad."""


@lru_cache(maxsize=1)
def figures() -> dict[str, Figure]:
    """Return what is measured of every rollout that comes to its end, by name; plugins' figures are the last."""
    offered = cast(dict[str, Figure], installed().factories("figure"))
    return BUILT_IN | offered


def describe_order(tie_by: str) -> tuple[str, ...]:
    """Say what decides between designs that earn alike, the first thing first.

    Args:
        tie_by: see `core.interfaces.Fitness.tie_by`.
    """
    if tie_by == Fitness.tie_by:
        return tuple(criterion.words for criterion in WHAT_DECIDES if criterion.words)
    if tie_by == "distance_m":
        return (WHAT_DECIDES[-1].words,)

    figure = figures()[tie_by]
    most = "lowest" if figure.less_is_better else "highest"
    said = figure.words or figure.column
    return (f"the {most} `{tie_by}`" + (f", {said}" if said else ""),)


def measure(task: Task, motion: Motion, outcome: Outcome) -> dict[str, float]:
    """Measure a rollout that came to its end: its figures by name, and from when on it was played, if not from 0 s."""
    measured = {
        name: float(figure.measure(task, motion, outcome))
        for name, figure in figures().items()
    }
    if outcome.begins_s:
        measured[BEGINS_S] = outcome.begins_s
    return measured


def cost_of(trials: Iterable[Trial], name: str) -> float:
    """Return what a figure of a candidate's trials makes it cost: less is better."""
    mean = mean_figure(trials, name)
    return mean if figures()[name].less_is_better else -mean
