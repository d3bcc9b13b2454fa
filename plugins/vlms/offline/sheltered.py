"""Find how a body gets out from under what is above it, such as a shelf, and in below what is above its goal.

It is lifted and lowered before the shelf, and goes in and out on the level, along one heading.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from core.geometry import Array
from plugins.vlms.offline.boxes import LEVEL, UP, heading_axes
from plugins.vlms.offline.subgoals import Subgoal

_FREE_M = 0.2  # that must be free above where a body is lifted or lowered
_STEP_M = 0.02  # of the way in,
_LONGEST_M = 0.4  # and its length, at most
_FINE_M = 0.01  # of checks along it
_BESIDE_M = 0.03  # of what is carried in, where something above counts
_ROOF_M = 0.5  # above a body, up to where something keeps a shaft from coming down


@dataclass(frozen=True, eq=False)
class Passage:
    """How a body gets from where it is to its goal, where something is above one of them, or above both.

    Attributes:
        heading: along which it goes in, radians about z.
        off: from where it is to where it is lifted, on the level, (3,) metres; zeros: at once.
        on: likewise from the goal back to where it is lowered.
        rise: how far above its places it goes out and in, metres.
    """

    heading: float
    off: Array
    on: Array
    rise: float


def is_sheltered(subgoal: Subgoal) -> bool:
    """Report whether something is above bodies that are to be carried to a place, or above the place."""
    goal = subgoal.goal
    if goal is None or goal.place is None or goal.joint is not None:
        return False

    loaded = subgoal.loaded
    return _is_below(loaded, np.zeros(3)) or _is_below(loaded, loaded.shift)


def _is_below(subgoal: Subgoal, place: Array) -> bool:
    """Report whether bodies can't be lifted from a place, (3,) metres from where they are."""
    return subgoal.is_blocked(_FREE_M * UP, place, step=_FINE_M)


def find_passage(
    subgoal: Subgoal, heading: float, rises: Sequence[float], headroom: float
) -> Passage | None:
    """Find how bodies get out and in along a heading; None: it is barred.

    Args:
        subgoal: the bodies.
        heading: along which they go in, radians about z.
        rises: how far above their places they may go out and in, the best first, metres.
        headroom: that must be free above that, for what carries them, metres.
    """
    ahead, _ = heading_axes(heading)
    loaded = subgoal.loaded
    for rise in rises:
        above = (rise + headroom) * UP
        off = _find_way_out(loaded, above, ahead)
        on = _find_way_out(loaded, loaded.shift + above, ahead)
        if off is not None and on is not None:
            return Passage(heading, -off * ahead, -on * ahead, rise)

    return None


def _find_way_out(subgoal: Subgoal, place: Array, ahead: Array) -> float | None:
    """Find how far back from a place bodies can be lifted, metres; None: nowhere, or it is barred.

    Args:
        subgoal: the bodies.
        place: from where they are, (3,) metres.
        ahead: unit vector (3,), of the way in.
    """
    for length in np.arange(0.0, _LONGEST_M, _STEP_M).tolist():
        outside = place - length * ahead
        if _is_below(subgoal, outside):
            continue
        if subgoal.is_blocked(length * ahead, outside, step=_FINE_M):
            return None

        return float(length)

    return None


def find_depth(subgoal: Subgoal, point: Array, heading: float, shift: Array) -> float:
    """Find how far behind a point of bodies a shaft has to come down, metres: outside of what is above.

    Args:
        subgoal: the bodies.
        point: of the bodies, where they are now, (3,).
        heading: along which they go in, radians about z.
        shift: to where they are meant to be, (3,) metres.
    """
    ahead, side = heading_axes(heading)
    there = point + shift * LEVEL
    right, left = subgoal.obstacles.ranges_along(side, there)
    begin, end = subgoal.obstacles.ranges_along(ahead, there)
    low = subgoal.obstacles.bounds[0][:, 2] - subgoal.upper[2] - shift[2]

    above = (right < _BESIDE_M) & (left > -_BESIDE_M)
    above &= (low > 0.0) & (low < _ROOF_M) & (end > -_LONGEST_M)
    return float(-begin[above].min(initial=0.0))


def find_rise(subgoal: Subgoal, start: Array, shift: Array, margin: float) -> float:
    """Find how far bodies are lifted so that they pass over what is on the way, metres.

    Args:
        subgoal: the bodies.
        start: where the way begins, from where they are, (3,) metres.
        shift: on the level, (3,) metres.
        margin: to what they pass.
    """
    loaded = subgoal.loaded
    for rise in np.arange(margin, _ROOF_M, _STEP_M).tolist():
        above = start + rise * UP
        if not loaded.is_blocked(shift, above, margin, step=_FINE_M):
            return float(rise)

    return _ROOF_M
