"""Heads with motions of their own, which follow from what holds a body, or from how it is to be turned.

A carrier gets two tines under a body, lifts it out of what it stands in, and lowers it at the goal. A tipper gets a lip
under one side of a body, and turns it over its opposite edge; without room for it, a blade pushes the body over by its
upper part. A pen turns a body about the vertical. Rays through the scene find where there is room for them. For a body
on a joint, or one to be broken, see `reaching_in`, for bodies in a loose container `pouring`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator
from scipy.spatial.transform import Rotation

from core.geometry import Array
from core.scene import Soft
from plugins.vlms.offline.boxes import LEVEL, UP, heading_axes
from plugins.vlms.offline.chance import Range
from plugins.vlms.offline.cups import make_flipper
from plugins.vlms.offline.hanging import LIFT_M, Ways, find_gap_past, find_ways, hangs
from plugins.vlms.offline.heads import Head, Motion, make_blade, make_pen, make_piece
from plugins.vlms.offline.paths import HeadPath
from plugins.vlms.offline.raycast import (
    LEVEL_M,
    LiftPoint,
    find_lift_point,
    find_tops,
)
from plugins.vlms.offline.reaching_in import make_joint_mover, make_presser
from plugins.vlms.offline.subgoals import Subgoal, is_upright, turn_to_goal

QUARTERS: list[float] = (np.arange(4) * np.pi / 2).tolist()
"""Headings along the world's axes."""

_TURNED = np.radians(20.0)  # a goal about an orientation that is farther off than this
_STEP_RAD = 0.15  # between waypoints
_NEARLY_OVER = 0.2  # the sine of turns that are half ones, and have no direction
_UNDERSIDE_M = 0.002  # above bodies' lowest point, their own underside at most
_HOLDS_M = 0.003  # bodies that are in each other's height by more hold each other
_BEHIND_M = 0.02  # the tips of tines come down behind bodies
_NEARLY_M = 0.03  # places for tines that are so little worse than the best are as good
_WALL_M = 0.008  # thick, at which tines begin
_WALL_HEIGHT_M = 0.03  # for a shaft
_TINE_THICK_M = 0.008  # at most: stiff for their length
_BELOW_M = 0.001  # tines go in below what they lift

# What carries bodies.
_CARRIER_TINE_M = 0.009
_CARRIER_GAP_M = Range(0.01, 0.02)  # between the wall and the bodies: they sway
_HIGHER_M = Range(0.0, 0.03)
_DROOP_FROM_M = 0.002  # below what is soft, from where the ground is looked for
_DROOP_MORE_M = 0.01  # lower than its ends hang
_ABOVE_GROUND_M = 0.015  # for tines below what hangs down
_LOWER_M = Range(0.004, 0.012)  # than at the goal, so that tines come free
_SLOW_M_S = 0.15  # with bodies on the tines
_SHORT_M = 0.02  # a shorter way is one step
_ONE_STEP_M_S = 1.0

# What hangs:
_THIN_M = 0.006  # it may be as thin as this above a tine
_HUNG_ROUND_M = 0.004  # that the underside of a ring rises over a tine
_TIPS_M = 0.02  # of tines, past it

# What topples bodies.
_LEAST_TOPPLED = 1.0  # times its length along the push: what is lower slides
_TOPPLER_WIDTH = Range(0.5, 1.0)  # of the bodies'
_TOPPLER_HEIGHT = 0.3  # of the bodies': it meets their upper part alone
_LEAST_TOPPLER_M = 0.02
_TOPPLER_THICK_M = Range(0.006, 0.012)
_TOPPLER_GAP_M = Range(0.01, 0.03)  # behind bodies
# Of the bodies' height: high, and not above them as they tilt.
_TOPPLES_AT = Range(0.6, 0.9)
_STROKE = Range(0.6, 1.2)  # of the bodies' length, in which they fall
_TOPPLE_M_S = Range(0.1, 0.3)
_LEAVE_M = 0.05  # up

# What turns bodies about the vertical.
_PEN_SPARE_M = Range(0.002, 0.006)  # on each side
_PEN_HEIGHT = Range(0.5, 0.9)  # of the bodies'
_PEN_HEIGHTS_M = (0.02, 0.12)
_PEN_ABOVE_M = Range(0.003, 0.008)  # the ground
_PLAY_RAD = Range(0.0, 0.12)

# What tips bodies.
_TIPPER_TINE_M = 0.016
_ROUND_TINE_M = 0.006
_ROUND_M = 0.015  # that the underside of what is round rises over a tine
_GRIP = Range(0.5, 0.9)  # of the room under bodies that a lip goes in
_MOST_GRIP_M = 0.04
_TIPPER_GAP_M = Range(0.006, 0.015)  # between the wall and the bodies
_HALF_TURN_RAD = 2.0  # what is to be turned by more falls the rest by itself,
_FALLS_RAD = Range(1.7, 2.3)  # from here on
# What is to be turned by less is turned by a little more.
_FARTHER_RAD = Range(0.0, 0.15)
_LIP = 0.6  # of the room under bodies that it fills
_BACK_M = 0.06  # it leaves by, and up
_UP_M = 0.02


def needs_guided_head(subgoal: Subgoal) -> bool:
    """Report whether the subgoal's only body is on a joint, to be turned or broken, in another, or on a smaller one.

    Args:
        subgoal: of any bodies.
    Returns:
        A body without a goal needs none, nor do several.
    """
    # Several bodies are never held one by one.
    goal = subgoal.goal
    if goal is None or len(subgoal.solids) > 1:
        return False
    if goal.joint is not None or goal.breaks or find_level_turn(subgoal) is not None:
        return True
    if _find_yaw(subgoal) is not None:
        return True
    if subgoal.rises and _stands_off(subgoal):
        return True
    if goal.place is not None and hangs(subgoal):
        return True

    lower, upper = subgoal.obstacles.bounds
    above = lower < subgoal.upper - _HOLDS_M
    below = upper > subgoal.lower + _HOLDS_M

    return bool((above & below).all(axis=1).any())


def make_guided_head(subgoal: Subgoal, rng: Generator) -> Head | None:
    """Make a head for a subgoal that `needs_guided_head`; None: there is no way in.

    Args:
        subgoal: with one body.
        rng: random numbers.
    Returns:
        A rod, a hook, a lip or tines, by what the goal asks.
    """
    goal = subgoal.goal
    if goal is not None and goal.joint is not None:
        return make_joint_mover(subgoal, goal.joint, rng)
    if goal is not None and goal.breaks:
        return make_presser(subgoal, rng)

    turn = find_level_turn(subgoal)
    if turn is not None:
        return (
            _make_tipper(subgoal, turn, rng)
            or _make_toppler(subgoal, turn, rng)
            or (make_flipper(subgoal, rng) if turn[1] > _HALF_TURN_RAD else None)
        )

    yaw = _find_yaw(subgoal)
    if yaw is not None:
        return _make_turner(subgoal, yaw, rng)

    return _make_carrier(subgoal, rng)


def find_level_turn(subgoal: Subgoal) -> tuple[Array, float] | None:
    """Find how the bodies are to be turned; None: not at all, or about an axis that is not level.

    Args:
        subgoal: of which the first body counts.

    Returns:
        The axis (3,), level or nearly so, as long as the angle's sine; and the angle, radians.
    """
    turn = _find_any_turn(subgoal)
    return None if turn is None or is_upright(turn[0]) else turn


def _find_yaw(subgoal: Subgoal) -> float | None:
    """Find the angle by which the bodies are to be turned about the vertical, radians; None: not so.

    Args:
        subgoal: of which the first body counts.
    """
    turn = _find_any_turn(subgoal)
    if turn is None or not is_upright(turn[0]):
        return None

    axis, angle = turn
    return float(np.sign(axis[2]) * angle)


def _find_any_turn(subgoal: Subgoal) -> tuple[Array, float] | None:
    """Find how the bodies are to be turned, about whatever axis; see `find_level_turn`.

    Args:
        subgoal: of which the first body counts.
    """
    if subgoal.goal is None or subgoal.goal.axis is None:
        return None

    axis, angle = turn_to_goal(subgoal.goal, subgoal.solids[0].body)
    if angle < max(_TURNED, np.radians(subgoal.goal.tolerance_deg)):
        return None

    return axis, angle


def _stands_off(subgoal: Subgoal) -> bool:
    """Report whether the bodies' own underside is free beside what they stand on, so that tines get below it."""
    lower, upper = subgoal.obstacles.bounds
    borne = np.abs(upper[:, 2] - subgoal.lower[2]) < _HOLDS_M
    wide = (lower < subgoal.lower)[:, :2] & (upper > subgoal.upper)[:, :2]
    if (borne & wide.all(axis=1)).any():  # rays would take long
        return False

    points = [find_lift_point(subgoal, turn, _CARRIER_TINE_M) for turn in QUARTERS]
    lowest = subgoal.lower[2] + _UNDERSIDE_M
    return any(point is not None and point.rear[2] < lowest for point in points)


def _draw_lift_point(
    subgoal: Subgoal,
    headings: Sequence[float],
    tine: float,
    rng: Generator,
    uneven: float = LEVEL_M,
) -> LiftPoint | None:
    """Draw one of the best places for tines ``tine`` metres wide; None: there is none.

    Args:
        subgoal: the bodies.
        headings: along which tines may go, radians about z.
        tine: width of each, metres.
        rng: random numbers.
        uneven: how much higher their underside may be over a tine, metres.
    Returns:
        At random from those that are nearly as good as the best.
    """
    found = [find_lift_point(subgoal, heading, tine, uneven) for heading in headings]
    points = [point for point in found if point is not None]
    if not points:
        return None

    most = max(point.worth for point in points)
    best = [point for point in points if point.worth > most - _NEARLY_M]

    return best[rng.integers(len(best))]


@dataclass(frozen=True, eq=False)
class _Tines:
    """Two tines ahead of a wall, or one, that get under bodies; their upper faces are at z = 0.

    Attributes:
        subgoal: with the bodies.
        point: where the tines get under them.
        width: of each, metres.
        thick: of each, metres.
        depth: how far they go ahead of the wall, metres.
    """

    subgoal: Subgoal
    point: LiftPoint
    width: float
    thick: float
    depth: float

    def make_head(self, kind: str, motion: Motion) -> Head:
        """Make a head of these tines.

        Args:
            kind: of the head.
            motion: of the head.
        """
        across = 2 * self.point.apart + self.width
        wall_size = (_WALL_M, across, _WALL_HEIGHT_M)
        middle = _WALL_HEIGHT_M / 2 - self.thick
        wall = make_piece("wall", -_WALL_M / 2, 0.0, middle, wall_size)
        pieces = [wall]

        sides = (1.0, -1.0) if self.point.apart > self.width / 2 else (0.0,)
        size = (self.depth + _WALL_M, self.width, self.thick)
        x = (self.depth - _WALL_M) / 2

        for number, side in enumerate(sides, start=1):
            y = side * self.point.apart
            pieces.append(make_piece(f"tine_{number}", x, y, -self.thick / 2, size))

        attachment = np.array([0.0, 0.0, _WALL_HEIGHT_M - self.thick])

        return Head(
            kind,
            "guided",
            tuple(pieces),
            attachment,
            self.depth,
            across,
            motion=motion,
        )

    def enter(
        self,
        path: HeadPath,
        wall: Array,
        ahead: Array,
    ) -> None:
        """Come down behind the bodies, and go ahead until the wall is at a place.

        Args:
            path: that waypoints are added to.
            wall: the place, (3,).
            ahead: unit vector (3,) along the heading.
        """
        behind = wall - (self.depth + _BEHIND_M) * ahead
        path.descend(self.subgoal, self.point.heading, behind)

        path.go(self.point.heading, wall)
        path.hold()


def _make_carrier(subgoal: Subgoal, rng: Generator) -> Head | None:
    """Make tines that lift a body out of what it stands in or hangs on, carry it over, and lower it at the goal.

    None: something is in the way of lifting or lowering it, or there is no place for tines.

    Args:
        subgoal: the body.
        rng: random numbers.
    Returns:
        A head with one tine or two.
    """
    ways = find_ways(subgoal.loaded)
    if ways is None:
        return None

    heading = ways.heading
    if heading is None:
        point = _draw_lift_point(subgoal, QUARTERS, _CARRIER_TINE_M, rng)
    else:
        point = find_lift_point(
            subgoal, heading, _CARRIER_TINE_M, _HUNG_ROUND_M, _THIN_M
        )
    if point is None:
        return None

    ahead, _ = heading_axes(point.heading)
    length = np.ptp(subgoal.points @ ahead)
    gap = _CARRIER_GAP_M.draw(rng)
    depth = gap + min(point.depth, length)
    thick = min(_TINE_THICK_M, point.gap / 2)

    if heading is not None:
        gap += find_gap_past(subgoal, point, -thick, _WALL_HEIGHT_M)
        depth = gap + length + _TIPS_M

    tines = _Tines(subgoal, point, _CARRIER_TINE_M, thick, depth)
    return tines.make_head("tines", _Carrying(tines, ways, gap).carry)


@dataclass(frozen=True, eq=False)
class _Carrying:
    """How tines carry bodies to their goal.

    Attributes:
        tines: with the bodies.
        ways: how the bodies get off what they are in, and into what they are to be in.
        gap: between the wall of the tines and the bodies, metres.
    """

    tines: _Tines
    ways: Ways
    gap: float

    def carry(self, path: HeadPath, rng: Generator) -> str:
        """Get under the bodies, lift them, carry them over what holds them, and lower them; leave what is not held."""
        subgoal = self.tines.subgoal
        point = self.tines.point
        heading = point.heading
        ahead, _ = heading_axes(heading)
        is_raised = subgoal.length < _SHORT_M and not subgoal.is_released
        stays = subgoal.is_held or (is_raised and subgoal.rises)

        inside = point.rear - self.gap * ahead - _BELOW_M * UP
        droop = _find_droop(subgoal, point)
        self.tines.enter(path, inside - droop * UP, ahead)

        lifted = inside + _BELOW_M * UP
        if stays and is_raised:
            path.move(inside + subgoal.shift + droop * UP, heading, _SLOW_M_S)
            return "gets tines under the body, lifts it and holds it"

        for place in self._find_places(lifted, stays, rng):
            length = np.linalg.norm(place - path.end)
            speed = _SLOW_M_S if length > _SHORT_M else _ONE_STEP_M_S
            path.move(place, heading, speed)

        if stays:
            return "gets tines under the body, lifts it off, and carries it over"

        leave = path.end - (self.tines.depth + _BEHIND_M) * ahead
        path.go(heading, leave, touch=True)

        return (
            "gets tines under the body, lifts it off, carries it over, lowers it and "
            "leaves"
        )

    def _find_places(self, lifted: Array, stays: bool, rng: Generator) -> list[Array]:
        """Find the places of the head, (3,) each, from where the bodies are on it to where it lets go of them.

        Args:
            lifted: the first one.
            stays: whether the bodies stay in hand.
            rng: random numbers.
        """
        off, on = self.ways
        goal = lifted + self.tines.subgoal.shift
        height = max(lifted[2], goal[2]) + LIFT_M
        beside_start = lifted + off.whole
        beside_goal = goal + on.whole
        over_start = np.array([*beside_start[:2], height + _HIGHER_M.draw(rng)])
        over_goal = np.array([*beside_goal[:2], height + _HIGHER_M.draw(rng)])
        lowered = goal - _LOWER_M.draw(rng) * UP

        places = [lifted]
        if not off.is_free:
            places += [lifted + off.rise * UP, beside_start]
        places += [over_start, over_goal]
        if not on.is_free:
            places += [beside_goal, goal + on.rise * UP]
        places.append(goal)
        if not stays:
            places.append(lowered)

        return places


def _find_droop(subgoal: Subgoal, point: LiftPoint) -> float:
    """Find how far what is soft hangs down beside what it lies on, at most, metres; 0 of what is stiff.

    Args:
        subgoal: the body.
        point: where tines get below it, as it lies at the start.
    """
    if not isinstance(subgoal.solids[0].body, Soft):
        return 0.0

    lower, upper = subgoal.obstacles.bounds
    bears = np.abs(upper[:, 2] - subgoal.lower[2]) < _HOLDS_M
    bears &= (lower < subgoal.upper)[:, :2].all(axis=1)
    bears &= (upper > subgoal.lower)[:, :2].all(axis=1)
    if not bears.any():
        return 0.0

    beyond = np.maximum(
        subgoal.upper - upper[bears].max(axis=0),
        lower[bears].min(axis=0) - subgoal.lower,
    )
    ground = find_tops(subgoal.obstacles, (point.rear - _DROOP_FROM_M * UP)[None])[0]
    room = point.rear[2] - ground - _ABOVE_GROUND_M
    return float(np.clip(beyond[:2].max() + _DROOP_MORE_M, 0.0, max(room, 0.0)))


def _find_headings(turn: tuple[Array, float]) -> list[float]:
    """Find the headings along which the top of bodies goes in a turn, radians: all quarters for half a turn.

    Args:
        turn: see `find_level_turn`.
    """
    axis, _ = turn
    if np.linalg.norm(axis) <= _NEARLY_OVER:
        return QUARTERS

    x, y, _ = np.cross(axis, UP)
    return [float(np.arctan2(y, x))]


def _make_toppler(
    subgoal: Subgoal,
    turn: tuple[Array, float],
    rng: Generator,
) -> Head | None:
    """Make a blade that pushes a body over by its upper part; None: it is to be turned by less than it falls.

    Args:
        subgoal: the body.
        turn: see `find_level_turn`.
        rng: random numbers.
    """
    headings = _find_headings(turn)
    extent = subgoal.extent(headings[rng.integers(len(headings))])
    falls_from = np.arctan2(extent.along, subgoal.height)
    if turn[1] < falls_from or subgoal.height < _LEAST_TOPPLED * extent.along:
        return None

    blade = make_blade(
        width=extent.across * _TOPPLER_WIDTH.draw(rng),
        height=max(_LEAST_TOPPLER_M, _TOPPLER_HEIGHT * subgoal.height),
        thick=_TOPPLER_THICK_M.draw(rng),
    )

    def topple(path: HeadPath, rng: Generator) -> str:
        """Come down behind the bodies' upper part, push until they fall over, and leave."""
        gap = _TOPPLER_GAP_M.draw(rng)
        start = (extent.rear - gap) * extent.ahead + extent.middle
        height = subgoal.lower[2] + _TOPPLES_AT.draw(rng) * subgoal.height
        start = start + height * UP
        stroke = gap + extent.along * _STROKE.draw(rng)

        path.descend(subgoal, extent.heading, start)
        path.move(start + stroke * extent.ahead, extent.heading, _TOPPLE_M_S.draw(rng))
        path.go(extent.heading, start, start + _LEAVE_M * UP, touch=True)

        return f"pushes the body over by its upper part, by {stroke:.2f} m"

    return replace(blade, primitive="guided", motion=topple)


def _make_turner(subgoal: Subgoal, yaw: float, rng: Generator) -> Head:
    """Make a pen that comes down around bodies, and turns them about the vertical; it may then push them on.

    Args:
        subgoal: the body.
        yaw: the angle, radians.
        rng: random numbers.
    """
    extent = subgoal.extent(subgoal.grip_heading)
    spare = _PEN_SPARE_M.draw(rng)
    pen = make_pen(
        width=extent.across + 2 * spare,
        depth=extent.along + 2 * spare,
        height=np.clip(subgoal.height * _PEN_HEIGHT.draw(rng), *_PEN_HEIGHTS_M),
        thick=_TOPPLER_THICK_M.draw(rng),
    )

    def turn(path: HeadPath, rng: Generator) -> str:
        """Come down around the bodies, turn about their middle, push them to their place, and leave."""
        middle = (extent.front + extent.rear) / 2 * extent.ahead + extent.middle
        start = middle - (extent.along / 2 + spare) * extent.ahead
        start = start + (subgoal.lower[2] + _PEN_ABOVE_M.draw(rng)) * UP
        path.descend(subgoal, extent.heading, start)

        # A little farther, as they have room in it.
        whole = yaw + np.sign(yaw) * _PLAY_RAD.draw(rng)
        end = path.turn_about(middle, whole * UP, _STEP_RAD)
        if subgoal.goal is not None and subgoal.goal.place is not None:
            path.move(end.position + subgoal.shift * LEVEL, end, _TOPPLE_M_S.draw(rng))

        path.go(end, path.end + (subgoal.height + _LEAVE_M) * UP, touch=True)

        return f"comes down around the body, and turns it by {np.degrees(whole):.0f} degrees"

    return replace(pen, primitive="guided", motion=turn)


def _make_tipper(
    subgoal: Subgoal,
    turn: tuple[Array, float],
    rng: Generator,
) -> Head | None:
    """Make a lip that raises a body by one side, and turns it about its opposite edge.

    Args:
        subgoal: the body.
        turn: see `find_level_turn`.
        rng: random numbers.

    Returns:
        None if there is no place for the lip.
    """
    _, most = turn
    headings = _find_headings(turn)
    width = _TIPPER_TINE_M
    point = _draw_lift_point(subgoal, headings, width, rng)
    if point is None:  # what is round lies between two tines
        width = _ROUND_TINE_M
        point = _draw_lift_point(subgoal, headings, width, rng, _ROUND_M)
    if point is None:
        return None

    heading = point.heading
    ahead, _ = heading_axes(heading)
    grip = min(point.depth * _GRIP.draw(rng), _MOST_GRIP_M)  # under the bodies

    gap = _TIPPER_GAP_M.draw(rng)
    depth = grip + gap  # from the face to the tip

    # A point of the opposite edge, about which the bodies turn.
    front = subgoal.extent(heading).front
    pivot = point.rear + (front - point.rear @ ahead) * ahead
    pivot[2] = subgoal.lower[2]

    if most < _HALF_TURN_RAD:
        most += _FARTHER_RAD.draw(rng)
    else:
        most = _FALLS_RAD.draw(rng)

    thick = min(_TINE_THICK_M, _LIP * point.gap)
    tines = _Tines(subgoal, point, width, thick, depth)

    def tip(path: HeadPath, rng: Generator) -> str:
        """Get under the bodies, turn them in steps about their opposite edge, and leave."""
        end = point.rear + grip * ahead - _BELOW_M * UP
        tines.enter(path, end - depth * ahead, ahead)

        radius = ((pivot - point.rear) @ ahead) - grip
        rise = end[2] - pivot[2]
        arm = -radius * ahead + rise * UP
        steps = int(np.ceil(most / _STEP_RAD))

        for angle in np.linspace(0.0, most, steps + 1)[1:]:
            turned = Rotation.from_rotvec(np.cross(UP, ahead) * angle).apply(arm)
            path.go(heading, pivot + turned - depth * ahead, touch=True)

        path.go(heading, path.end - _BACK_M * ahead + _UP_M * UP, touch=True)

        return (
            "raises one side by a lip, and turns the body about its other edge by "
            f"{np.degrees(most):.0f} degrees"
        )

    return tines.make_head("lip", tip)
