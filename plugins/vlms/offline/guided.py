"""Choose a way that follows from what holds a body: a joint, an enclosure, a peg; or from its turning or moving.

Each way makes a head for one errand, and the head knows its own path.
"""

from __future__ import annotations

import numpy as np

from core.geometry import Array
from plugins.vlms.offline.catching import catcher
from plugins.vlms.offline.heads import Head
from plugins.vlms.offline.openings import way_out
from plugins.vlms.offline.rods import drawer, mover
from plugins.vlms.offline.scene_analysis import Errand
from plugins.vlms.offline.tines import carrier, tipper

_TURNED = np.radians(20.0)  # a goal about an orientation that is farther off than this


def suits(errand: Errand) -> bool:
    """Report whether the errand's bodies move, hang from a joint, are to be turned, or are held by what is near."""
    if any(thing.body.launched for thing in errand.things):
        return True
    goal = errand.goal
    if goal is None or len(errand.things) > 1:
        return False
    return goal.joint is not None or _turn(errand) is not None or _threaded(errand) or _shut_in(errand)


def guided(errand: Errand, rng: np.random.Generator) -> Head | None:
    """Make a head for the way that `suits`; None: there is no way in."""
    if any(thing.body.launched for thing in errand.things):
        return catcher(errand, rng)
    if errand.goal is not None and errand.goal.joint is not None:
        return mover(errand, rng)
    if (turn := _turn(errand)) is not None:
        return tipper(errand, turn, rng)
    route = way_out(errand, np.zeros(3))
    if route is None:
        return None
    if errand.covered and abs(route[-1][2]) < 1e-6:
        return drawer(errand, route, rng)
    return carrier(errand, route, rng)


def _turn(errand: Errand) -> tuple[Array, float] | None:
    """Compute the axis (3,) about which the bodies are to be turned, level or nearly so, and the angle."""
    if errand.goal is None or errand.goal.axis is None:
        return None
    now = errand.things[0].body.pose.rotation.apply(errand.goal.axis)
    now, wanted = now / np.linalg.norm(now), np.divide(errand.goal.points, np.linalg.norm(errand.goal.points))
    angle = float(np.arccos(np.clip(now @ wanted, -1.0, 1.0)))
    axis = np.cross(now, wanted)
    if angle < max(_TURNED, np.radians(errand.goal.tolerance_deg)) or abs(axis[2]) > 0.5 * np.linalg.norm(axis) + 1e-6:
        return None
    return axis, angle


def _threaded(errand: Errand) -> bool:
    """Report whether another body stands within the bounds of the errand's, as a peg in a ring."""
    lower, upper = errand.lower + 0.003, errand.upper - 0.003
    return bool(((errand.others.lower < upper) & (errand.others.upper > lower)).all(axis=1).any())


def _shut_in(errand: Errand) -> bool:
    return errand.covered and errand.length > 0.03 and errand.blocked(errand.shift * [1.0, 1.0, 0.0])
