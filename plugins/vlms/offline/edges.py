"""Find over which edge bodies are pushed that have to get lower than what they stand on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.random import Generator

from core.geometry import Array
from plugins.vlms.offline.subgoals import Subgoal
from plugins.vlms.offline.targets import Target

_BEARS_M = 0.003  # what bodies stand on ends so near their foot
_PAST_M = 0.01  # the edge, that bodies are pushed
_BARRED = 0.02  # times as often where something is in the way, which may yield,
_OUT_OF_REACH = 0.1  # and where no tool gets


def lead_over_edge(subgoal: Subgoal, goal: Target, rng: Generator) -> Target:
    """Give a goal that only wants its bodies lower a place beyond an edge of what bears them; others stay as they are.

    Near edges are drawn more often, and those to which the way is free.

    Args:
        subgoal: all of the goal's bodies, without a shift.
        goal: in the world.
        rng: random numbers.
    """
    if goal.place is None or goal.joint is not None or goal.container is not None:
        return goal

    x, y, height = goal.place
    if x is not None or y is not None or height is None:
        return goal

    bounds = _find_bearing(subgoal, height)
    if bounds is None:
        return goal

    shifts = np.zeros((4, 3))
    shifts[0, 0] = bounds[1, 0] - subgoal.lower[0] + _PAST_M
    shifts[1, 0] = bounds[0, 0] - subgoal.upper[0] - _PAST_M
    shifts[2, 1] = bounds[1, 1] - subgoal.lower[1] + _PAST_M
    shifts[3, 1] = bounds[0, 1] - subgoal.upper[1] - _PAST_M

    weights = 1.0 / np.abs(shifts).max(axis=1)
    outward = subgoal.workspace.from_axis(subgoal.center + shifts)
    away = np.hypot(outward[:, 0], outward[:, 1])
    weights[away > subgoal.workspace.farthest] *= _OUT_OF_REACH
    weights[away < subgoal.workspace.inner] *= _OUT_OF_REACH
    weights[[subgoal.is_blocked(shift) for shift in shifts]] *= _BARRED

    number = int(rng.choice(4, p=weights / weights.sum()))
    middle = np.mean([solid.position for solid in subgoal.solids], axis=0)
    there = (middle + shifts[number]).tolist()
    if number < 2:
        return replace(goal, place=(there[0], None, height), over_edge=True)

    return replace(goal, place=(None, there[1], height), over_edge=True)


def _find_bearing(subgoal: Subgoal, height: float) -> Array | None:
    """Find the corners (2, 3) of what bears bodies, where it ends; None: nothing does that is above their place.

    Args:
        subgoal: the bodies.
        height: of their place, metres.
    """
    corners = []
    for solid in subgoal.model.solids.values():
        if solid in subgoal.solids:
            continue

        lower, upper = solid.boxes.bounds
        bears = np.abs(upper[:, 2] - subgoal.lower[2]) < _BEARS_M
        bears &= upper[:, 2] > height
        below = bears & (lower < subgoal.upper)[:, :2].all(axis=1)
        below &= (upper > subgoal.lower)[:, :2].all(axis=1)
        if below.any():
            corners += [lower[bears], upper[bears]]

    if not corners:
        return None

    ends = np.concatenate(corners)
    return np.stack([ends.min(axis=0), ends.max(axis=0)])
