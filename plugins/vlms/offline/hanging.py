"""Find how a body that hangs on something, such as a ring on a peg, gets off it sideways, and onto its like."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from core.geometry import Array
from plugins.vlms.offline.boxes import UP, heading_axes
from plugins.vlms.offline.pegs import find_pegs, find_swing
from plugins.vlms.offline.raycast import LiftPoint
from plugins.vlms.offline.subgoals import Subgoal

LIFT_M = 0.2
"""How far bodies are lifted over what they stand in."""

_STEP_M = 0.006  # of the check whether they can be lifted
# From where that check begins at the goal: they may stand on what is there.
_ABOVE_GOAL_M = 0.004
_BELOW_M = 0.003  # the highest thing that bodies stand on
_OFF_M = 0.15  # aside: longer than a peg
_RISES_M = (0.01, 0.016, 0.024)  # before that: over what a peg ends in
_SPARE_M = 0.014  # higher, since bodies sink between tines
_HEADINGS: list[float] = (np.arange(16) * np.pi / 8).tolist()


class Way(NamedTuple):
    """How bodies get from a place to where they can be lifted.

    Attributes:
        rise: a little up, metres; 0 where they can be lifted at once.
        aside: and then aside, (3,) metres; zeros where they can be lifted at once.
    """

    rise: float
    aside: Array

    @property
    def is_free(self) -> bool:
        """Whether they can be lifted at once."""
        return not self.aside.any()

    @property
    def whole(self) -> Array:
        """From the place to where they can be lifted, (3,) metres."""
        return self.rise * UP + self.aside


_AT_ONCE = Way(0.0, np.zeros(3))


class Ways(NamedTuple):
    """How bodies get off what they are in, and into what they are to be in.

    Attributes:
        off: from where they are to where they can be lifted.
        on: the same from the goal, the other way round.
    """

    off: Way
    on: Way

    @property
    def heading(self) -> float | None:
        """The heading along which tines go in, against the way off, radians; None: along any."""
        way = self.on if self.off.is_free else self.off
        if way.is_free:
            return None

        return float(np.arctan2(-way.aside[1], -way.aside[0]))


def hangs(subgoal: Subgoal) -> bool:
    """Report whether a body hangs on something: nothing is below it, and it gets off sideways alone.

    Args:
        subgoal: with one body.
    """
    lower, upper = subgoal.obstacles.bounds
    near = (lower < subgoal.upper)[:, :2] & (upper > subgoal.lower)[:, :2]
    below = np.abs(upper[:, 2] - subgoal.lower[2]) < _BELOW_M
    if (near.all(axis=1) & below).any():
        return False

    way = _find_way(subgoal, np.zeros(3))
    return way is not None and not way.is_free


def find_way_onto_peg(subgoal: Subgoal) -> Way | None:
    """Find the way off a peg that a body is to hang on, and to be let go on; None: it is not, or hangs now.

    Args:
        subgoal: with one body.
    """
    if not _goes_onto_peg(subgoal):
        return None

    ways = find_ways(subgoal)
    if ways is None or ways.on.is_free or not ways.off.is_free:
        return None

    return ways.on


def _goes_onto_peg(subgoal: Subgoal) -> bool:
    """Report whether a body is to hang on a peg, by a hole, and to be let go there."""
    if not (subgoal.rises and subgoal.is_released):
        return False

    return find_swing(subgoal) is not None


def find_ways(subgoal: Subgoal) -> Ways | None:
    """Find how bodies are lifted, and lowered at their goal; None: something is in the way.

    Args:
        subgoal: the bodies, with what stands on them. Only those that hang, or are to hang, may go aside.
    """
    goal = subgoal.shift + _ABOVE_GOAL_M * UP
    ways = []
    for moved, start in ((subgoal, np.zeros(3)), (subgoal.turned, goal)):
        if not _is_covered(moved, start):
            ways.append(_AT_ONCE)
            continue

        hung = hangs(subgoal) or _goes_onto_peg(subgoal)
        way = _find_way(moved, start) if hung else None
        if way is None:
            return None
        ways.append(way)

    return Ways(*ways)


def _is_covered(subgoal: Subgoal, start: Array) -> bool:
    """Report whether bodies can't be lifted straight from a place, (3,) metres from where they are."""
    return subgoal.is_blocked(LIFT_M * UP, start, step=_STEP_M)


def _find_way(subgoal: Subgoal, start: Array) -> Way | None:
    """Find how bodies get to where they can be lifted; None: they do not.

    Args:
        subgoal: the bodies.
        start: from where, beside where they are, (3,) metres.
    """
    if not _is_covered(subgoal, start):
        return _AT_ONCE

    asides = [_OFF_M * heading_axes(heading)[0] for heading in _HEADINGS]
    asides += [_OFF_M * peg.axis for peg in find_pegs(subgoal)]
    for rise in _RISES_M:
        if subgoal.is_blocked(rise * UP, start, step=_STEP_M):
            return None

        raised = start + rise * UP
        for aside in asides:
            if not subgoal.is_blocked(aside, raised, step=_STEP_M):
                return Way(rise + _SPARE_M, aside)

    return None


def find_gap_past(subgoal: Subgoal, point: LiftPoint, low: float, high: float) -> float:
    """Find how far behind bodies what is between two tines is clear of what the bodies hang on, metres.

    Args:
        subgoal: the bodies.
        point: where the tines get under them.
        low: from where it is, from the tines' upper faces, metres.
        high: up to where.
    """
    ahead, side = heading_axes(point.heading)
    lower, upper = subgoal.obstacles.bounds
    corners = np.stack([lower, upper])
    across = (corners - point.rear) @ side
    along = (corners - point.rear) @ ahead

    meets = (lower[:, 2] < point.rear[2] + high) & (upper[:, 2] > point.rear[2] + low)
    meets &= (across.min(axis=0) < point.apart) & (across.max(axis=0) > -point.apart)
    meets &= (along.max(axis=0) > -_OFF_M) & (along.min(axis=0) < 0.0)

    return float(-along.min(axis=0)[meets].min(initial=0.0))
