"""Catch a body that moves by itself from the start, such as a rolling ball: a cage waits for it on its way.

The cage stands open toward what comes, where the body passes its goal, or farther on where it would come too late.
Then it brings the body to its goal.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator

from core.geometry import Array, Cylinder
from core.scene import Body
from plugins.vlms.offline.boxes import LEVEL, UP
from plugins.vlms.offline.chance import Range
from plugins.vlms.offline.heads import Head, make_cage
from plugins.vlms.offline.paths import HeadPath
from plugins.vlms.offline.subgoals import Subgoal, goal_position

_MOVES_M_S = 0.02  # what is slower is as good as at rest
_SLIPPERY = 0.02  # what has less friction slides on and on
_LEVEL = 0.2  # the height of a unit vector along the axis of what rolls, at most
_READY_S = Range(1.2, 2.0)  # until the cage is in place
_ON_WAY = 0.3  # of a coordinate that the body's way leads to, the least share in its direction
_SPARE_M = Range(0.003, 0.015)  # beside the body, in the cage
_DEPTH = Range(0.9, 1.6)  # of the cage, in lengths of the body
_HEIGHT = Range(0.6, 1.1)  # likewise, in its heights
_LEAST_HEIGHT_M = 0.02
_WALL_M = Range(0.005, 0.01)  # thick
_ABOVE_M = Range(0.002, 0.006)  # the ground
_RISE_M = 0.06  # above its place, from where the cage comes down
_LATE_S = 1.0  # it waits longer than the body needs
_WAIT_S = 0.5  # at a waypoint, at least
_NEAR_M = 0.01  # to its goal: it is there
_BRING_M_S = Range(0.04, 0.1)
_LAST_M = 0.05
_LAST_M_S = 0.015
_REST_COUNT = 3  # waypoints at the goal, until it rests


@dataclass(frozen=True, eq=False)
class _Catch:
    """Where a body is to be caught.

    Attributes:
        way: of the body, a level unit vector (3,).
        place: of its middle, as it is caught, (3,).
        seconds: until it is there.
    """

    way: Array
    place: Array
    seconds: float


def needs_catcher(subgoal: Subgoal) -> bool:
    """Report whether the subgoal's only body rolls or slides on and on from the start, and nothing else does.

    Args:
        subgoal: of any bodies.
    """
    if subgoal.goal is None or len(subgoal.solids) > 1:
        return False

    body = subgoal.solids[0].body
    others = (
        solid.body for solid in subgoal.model.solids.values() if solid.body != body
    )
    is_alone = not any(np.any(other.velocity) for other in others)
    return is_alone and _goes_on(body)


def _goes_on(body: Body) -> bool:
    """Report whether a body moves on the level from the start, and is not stopped by friction soon."""
    x, y, z = body.velocity
    speed = np.hypot(x, y)
    if body.fixed or speed < _MOVES_M_S or abs(z) > speed:
        return False

    rolls = all(part.shape.is_ball for part in body.collisions)
    for part in body.collisions:
        axis = (body.pose @ part.pose).rotation.apply(UP)
        lies = abs(axis[2]) < _LEVEL and abs(axis @ body.velocity) < _LEVEL * speed
        rolls = rolls or (isinstance(part.shape, Cylinder) and lies)

    return rolls or body.friction < _SLIPPERY


def make_catcher(subgoal: Subgoal, rng: Generator) -> Head:
    """Make a cage that waits for a body, and brings it to its goal.

    Args:
        subgoal: which `needs_catcher`.
        rng: random numbers.
    """
    catch = _find_catch(subgoal, rng)
    heading = float(np.arctan2(-catch.way[1], -catch.way[0]))
    extent = subgoal.extent(heading)
    cage = make_cage(
        width=extent.across + 2 * _SPARE_M.draw(rng),
        depth=extent.along * _DEPTH.draw(rng),
        height=max(_LEAST_HEIGHT_M, subgoal.height * _HEIGHT.draw(rng)),
        thick=_WALL_M.draw(rng),
    )

    def wait_for(path: HeadPath, rng: Generator) -> str:
        """Come down on the body's way, wait until it is in the cage, and bring it to its goal."""
        behind = extent.along / 2 * catch.way
        low = subgoal.lower[2] + _ABOVE_M.draw(rng)
        place = (catch.place + behind) * LEVEL + low * UP
        path.go(heading, place + _RISE_M * UP, place)
        count = int(np.ceil((catch.seconds + _LATE_S) / _WAIT_S))
        path.go(heading, *([place] * count), touch=True)

        goal = subgoal.goal
        assert goal is not None
        left = (goal_position(catch.place, goal) - catch.place) * LEVEL
        length = float(np.linalg.norm(left))
        if length > _NEAR_M:
            # The last of it is slow, as what rolls goes on when the cage stops.
            last = min(1.0, _LAST_M / length) * left
            path.move(place + left - last, heading, _BRING_M_S.draw(rng))
            path.move(place + left, heading, _LAST_M_S)
            path.go(heading, *([path.end] * _REST_COUNT), touch=True)
        if subgoal.is_released:
            path.go(heading, path.end + (subgoal.height + _RISE_M) * UP, touch=True)

        return f"waits in the way of the body, which comes after {catch.seconds:.1f} s"

    return replace(cage, primitive="guided", motion=wait_for)


def _find_catch(subgoal: Subgoal, rng: Generator) -> _Catch:
    """Find where a body passes its goal, or where it is when the cage is ready.

    Args:
        subgoal: with the body.
        rng: random numbers.
    """
    velocity = np.array(subgoal.solids[0].body.velocity) * LEVEL
    speed = float(np.linalg.norm(velocity))
    way = velocity / speed

    # Along the way to what of the goal's place lies along it.
    assert subgoal.goal is not None
    there = goal_position(subgoal.center, subgoal.goal) - subgoal.center
    wanted = np.array([coordinate is not None for coordinate in _place(subgoal)])
    counts = wanted & (np.abs(way) > _ON_WAY)
    along = 0.0
    if counts.any():
        along = float(there[counts] @ way[counts] / (way[counts] @ way[counts]))

    along = max(along, speed * _READY_S.draw(rng))
    return _Catch(way, subgoal.center + along * way, along / speed)


def _place(subgoal: Subgoal) -> tuple[float | None, float | None, float | None]:
    """Return the place that the goal wants; None for each coordinate that it leaves free."""
    assert subgoal.goal is not None
    return subgoal.goal.place or (None, None, None)
