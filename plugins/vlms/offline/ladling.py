"""Scoop loose bodies out of a fixed vessel with walls all around, by a scoop that digs in as a shovel does.

The scoop comes in near one wall with its edge down, sweeps toward the opposite wall as it gets level, leans back, and
is lifted out. Then it tips where the bodies are to go, or holds them up. It may do so several times, along lines side
by side.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator

from core.geometry import Array, Pose
from plugins.vlms.offline.boxes import LEVEL, UP, heading_axes
from plugins.vlms.offline.chance import Range
from plugins.vlms.offline.guided import QUARTERS
from plugins.vlms.offline.heads import Head, make_scoop
from plugins.vlms.offline.paths import HeadPath
from plugins.vlms.offline.raycast import find_tops
from plugins.vlms.offline.scene_model import Solid
from plugins.vlms.offline.subgoals import Subgoal

_FEWEST = 4  # bodies: fewer are taken one by one
_LEAST_WALL_M = 0.01  # high
_LEVEL_M = 0.004  # the floor is so even
_GRID_M = 0.004
_MOST_HALF_M = 0.4  # of a vessel's inside
_CLEAR_M = 0.004  # between the scoop and a wall
_WIDTH = Range(0.35, 0.55)  # of the inside
_WIDEST = 0.75  # of what the bodies are tipped into
_DEPTH = Range(0.35, 0.5)  # of the inside, along the sweep
_LEAST_M = 0.02  # wide and deep
_RAIL = Range(0.3, 0.5)  # high, of its depth
_THICK_M = 0.002
_OVER_RIM_M = Range(0.01, 0.03)  # that its wall is higher than the rim
_FLOOR_M = Range(0.0005, 0.002)  # above the vessel's
# Of its edge down, where the flange points down: between digging and level.
_MOUNT_RAD = Range(0.5, 0.8)
_DIG_RAD = Range(0.8, 1.3)  # as it comes in along a wall, so that it lands on no body
_SWEEP_STEPS = 5
_LEVEL_AT = 0.7  # of the sweep: from here on it is level
_LEAN_RAD = Range(0.2, 0.45)
_LEAN_UP_M = 0.03
_ABOVE_M = Range(0.03, 0.06)  # everything, as it is carried
_DIG_M_S = Range(0.05, 0.15)
# Of a body's size, before the opposite wall, so that none is crushed.
_SPARES = Range(0.8, 1.8)
_CARRY_M_S = Range(0.15, 0.35)
_TIP_RAD = Range(1.0, 1.4)
_TIP_STEPS = 3
_OVER_HOLLOW_M = 0.012  # its edge is above the rim, as it tips
# Of the hollow's half width, ahead of its middle, where the edge is.
_EDGE = Range(-0.5, 0.2)
_ROUNDS = (1, 2, 3)
_HOLD_COUNT = 2  # waypoints while the bodies slide off


@dataclass(frozen=True, eq=False)
class _Line:
    """A line along which a scoop sweeps through a vessel.

    Attributes:
        start: on the floor, where the inside begins, (3,).
        length: of the inside along it, metres.
    """

    start: Array
    length: float


def find_vessel(subgoal: Subgoal) -> Solid | None:
    """Find the fixed vessel that holds the bodies, with walls all around; None: they are not in one, or stay there.

    Args:
        subgoal: of any bodies.
    """
    goal = subgoal.goal
    if goal is None or len(goal.bodies) < _FEWEST or subgoal.is_covered:
        return None
    if not (subgoal.falls_in or subgoal.rises):
        return None

    enclosing = subgoal.model.find_enclosing(subgoal.solids)
    names = [solid.body.name for solid in enclosing]
    is_fixed = all(solid.body.fixed for solid in enclosing)
    if not (enclosing and is_fixed) or goal.container in names:
        return None

    vessel = min(enclosing, key=lambda solid: np.ptp(solid.points, axis=0).prod())
    return vessel if _has_walls(vessel) else None


def _has_walls(vessel: Solid) -> bool:
    """Report whether something stands above a vessel's floor on all four sides of its middle."""
    middle = (vessel.points.min(axis=0) + vessel.points.max(axis=0)) / 2
    steps = np.arange(0.0, _MOST_HALF_M, _GRID_M)
    for turn in QUARTERS:
        ahead, _ = heading_axes(turn)
        places = middle * LEVEL + steps[:, None] * ahead
        tops = find_tops(vessel.boxes, places + vessel.points[:, 2].max() * UP)
        has_floor = np.isfinite(tops[0])
        if not has_floor or tops.max() < tops[0] + _LEAST_WALL_M:
            return False

    return True


def make_ladle(subgoal: Subgoal, vessel: Solid, rng: Generator) -> Head | None:
    """Make a scoop for bodies in a vessel; None: it has too little room there.

    Args:
        subgoal: the bodies.
        vessel: see `find_vessel`.
        rng: random numbers.
    """
    heading = QUARTERS[rng.integers(len(QUARTERS))]
    middle = (vessel.points.min(axis=0) + vessel.points.max(axis=0)) / 2
    floor = float(find_tops(vessel.boxes, middle[None])[0])
    middle = middle * LEVEL + floor * UP
    rim = float(vessel.points[:, 2].max())

    across = _find_line(vessel, middle, heading + np.pi / 2, 0.0)
    width = max(_LEAST_M, across.length * _WIDTH.draw(rng))
    hollow = _find_hollow(subgoal)
    if hollow is not None:
        width = min(width, _WIDEST * float(np.ptp(hollow.points[:, :2], axis=0).min()))

    rounds = int(rng.choice(_ROUNDS))
    lines = _draw_lines(vessel, middle, heading, width, across.length, rounds)
    least = min(line.length for line in lines)
    depth = least * _DEPTH.draw(rng)
    if min(depth, width) < _LEAST_M:
        return None

    scoop = make_scoop(
        width=width,
        depth=depth,
        height=rim - floor + _OVER_RIM_M.draw(rng),
        rail=depth * _RAIL.draw(rng),
        thick=_THICK_M,
    )

    def ladle(path: HeadPath, rng: Generator) -> str:
        """Dig, lift, carry and tip, as often as there are lines."""
        mounted = _MOUNT_RAD.draw(rng)
        for line in lines:
            _dig(path, subgoal, line, heading, depth, mounted, rng)
            if subgoal.is_held or hollow is None:
                path.move(path.end + subgoal.shift[2] * UP, heading, _CARRY_M_S.low)
                break
            _tip_out(path, subgoal, hollow, heading, depth, rng)

        return f"digs through the vessel {len(lines)} times, lifts what it has, and brings it to the goal"

    return replace(scoop, kind="ladle", primitive="guided", motion=ladle)


def _find_hollow(subgoal: Subgoal) -> Solid | None:
    """Find the body into which bodies are to fall; None: there is none."""
    if not subgoal.falls_in or subgoal.goal is None or subgoal.goal.container is None:
        return None

    return subgoal.model.solids[subgoal.goal.container]


def _find_line(vessel: Solid, middle: Array, heading: float, width: float) -> _Line:
    """Find how far the inside of a vessel goes along a heading, for what is so wide.

    Args:
        vessel: with a level floor.
        middle: of the inside, on the floor, (3,).
        heading: radians about z.
        width: metres; 0: of a line.
    """
    ahead, side = heading_axes(heading)
    steps = np.arange(-_MOST_HALF_M, _MOST_HALF_M, _GRID_M)
    rear = -np.inf
    front = np.inf
    for offset in (-width / 2, 0.0, width / 2):
        places = middle + steps[:, None] * ahead + offset * side
        starts = places * LEVEL + vessel.points[:, 2].max() * UP
        is_wall = np.abs(find_tops(vessel.boxes, starts) - middle[2]) > _LEVEL_M
        rear = max(rear, steps[is_wall & (steps < 0)].max(initial=-_MOST_HALF_M))
        front = min(front, steps[is_wall & (steps >= 0)].min(initial=_MOST_HALF_M))

    begin = middle + (rear + _GRID_M) * ahead
    return _Line(begin, max(0.0, float(front - rear - 2 * _GRID_M)))


def _draw_lines(
    vessel: Solid,
    middle: Array,
    heading: float,
    width: float,
    room: float,
    rounds: int,
) -> Sequence[_Line]:
    """Find lines side by side, the middle one first.

    Args:
        vessel: see `_find_line`.
        middle: of its inside, on the floor, (3,).
        heading: of the lines.
        width: of the scoop.
        room: of the inside across the lines, metres.
        rounds: how many lines.
    """
    _, side = heading_axes(heading)
    beside = min(width / 2, (room - width) / 3)
    offsets = (0.0, beside, -beside)[:rounds]
    return [
        _find_line(vessel, middle + offset * side, heading, width + 2 * _CLEAR_M)
        for offset in offsets
    ]


def _dig(
    path: HeadPath,
    subgoal: Subgoal,
    line: _Line,
    heading: float,
    depth: float,
    mounted: float,
    rng: Generator,
) -> None:
    """Come in with the edge down, sweep to the other wall, lean back, and rise over everything.

    Args:
        path: that waypoints are added to.
        subgoal: the bodies.
        line: of the sweep.
        heading: of the sweep.
        depth: of the scoop.
        mounted: its pitch where the flange points down, radians.
        rng: random numbers.
    """
    ahead, _ = heading_axes(heading)
    floor = line.start + _FLOOR_M.draw(rng) * UP
    pitch = _DIG_RAD.draw(rng)
    speed = _DIG_M_S.draw(rng)
    first = depth * np.cos(pitch) + _CLEAR_M
    size = float(np.ptp(subgoal.solids[0].points, axis=0).min())
    last = max(first, line.length - _CLEAR_M - _SPARES.draw(rng) * size)

    high = subgoal.clear_height + _ABOVE_M.draw(rng)
    entry = _place_edge(floor + first * ahead, heading, pitch, depth)
    above = entry.position * LEVEL + (high + depth) * UP
    mount = _place_edge(above, heading, mounted, 0.0)
    path.go(mount, above, above)
    path.add(Pose(above, entry.quaternion))
    path.add(entry, touch=True)

    for share in np.linspace(0.0, 1.0, _SWEEP_STEPS + 1)[1:]:
        edge = floor + (first + share * (last - first)) * ahead
        left = max(0.0, 1.0 - share / _LEVEL_AT)
        pose = _place_edge(edge, heading, left * pitch, depth)
        path.move(pose.position, pose, speed)

    lean = -_LEAN_RAD.draw(rng)
    edge = floor + (last - _CLEAR_M) * ahead + (_LEAN_UP_M + depth * np.sin(-lean)) * UP
    path.add(_place_edge(edge, heading, lean, depth), touch=True)
    path.hold()

    leant = path.poses[-1]
    risen = leant.position * LEVEL + high * UP
    path.move(risen, leant, _CARRY_M_S.draw(rng))


def _tip_out(
    path: HeadPath,
    subgoal: Subgoal,
    hollow: Solid,
    heading: float,
    depth: float,
    rng: Generator,
) -> None:
    """Carry what lies in the scoop over a hollow, turn it about its edge there, and turn it back.

    Args:
        path: that waypoints are added to; at its end the scoop is high up and leans back.
        subgoal: the bodies.
        hollow: that they are to fall into.
        heading: of the scoop.
        depth: of the scoop.
        rng: random numbers.
    """
    ahead, _ = heading_axes(heading)
    lower = hollow.points.min(axis=0)
    upper = hollow.points.max(axis=0)
    half = float((upper - lower)[:2].min()) / 2
    edge = (lower + upper) / 2 * LEVEL + _EDGE.draw(rng) * half * ahead
    edge = edge + (upper[2] + _OVER_HOLLOW_M) * UP

    leant = path.poses[-1]
    lean = float(leant.rpy[1])
    over = _place_edge(edge + _LEAN_UP_M * UP, heading, lean, depth)
    there = over.position * LEVEL + max(path.end[2], over.position[2]) * UP
    path.move(there, leant, _CARRY_M_S.draw(rng))

    for pitch in np.linspace(0.0, _TIP_RAD.draw(rng), _TIP_STEPS + 1):
        path.add(_place_edge(edge, heading, float(pitch), depth), touch=True)
    for _ in range(_HOLD_COUNT):
        path.add(path.poses[-1], touch=True)

    path.go(heading, there, touch=True)


def _place_edge(edge: Array, heading: float, pitch: float, depth: float) -> Pose:
    """Return the pose of a scoop whose edge is at a place.

    Args:
        edge: the place, (3,).
        heading: of the scoop, radians about z.
        pitch: of its edge down, radians.
        depth: of the scoop.
    """
    turn = Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, pitch, heading))
    return Pose(edge - turn.apply([depth, 0.0, 0.0]), turn.quaternion)
