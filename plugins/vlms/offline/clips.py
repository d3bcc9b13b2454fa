"""Hang an open vessel from a clip on its rim: to carry it, or to pour what is in it.

Two plates come down beside the wall, one outside and one inside, and tilt until they pinch it. A vessel that hangs from
them is off their middle, so that it jams between them; the shorter the plates, the firmer. It is poured over the clip:
to the other side it would come loose on the way. The flange is tilted to one side first and to the other in the end: an
arm that points down tilts by a right angle to both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.random import Generator
from scipy.spatial.transform import Rotation

from core.design import Tool
from core.geometry import Array, Pose
from plugins.vlms.offline.boxes import LEVEL, UP, heading_axes
from plugins.vlms.offline.chance import Range
from plugins.vlms.offline.guided import QUARTERS
from plugins.vlms.offline.hanging import Way, find_way_onto_peg
from plugins.vlms.offline.heads import Head, Motion, Piece, make_piece
from plugins.vlms.offline.paths import HeadPath
from plugins.vlms.offline.pegs import find_swing
from plugins.vlms.offline.raycast import find_profile, find_tops
from plugins.vlms.offline.sheltered import (
    find_depth,
    find_passage,
    find_rise,
    is_sheltered,
)
from plugins.vlms.offline.subgoals import Subgoal

# The rim, as rays find it that come down along lines near the vessel's axis.
_STEP_M = 0.00025  # between rays
_ASIDES_RAD = np.radians(np.arange(-9.0, 10.0, 3.0))  # of headings that are tried
_EVEN_M = 0.002  # a rim's height differs by less
_MOST_WALL_M = 0.015
_LEAST_DEPTH_M = 0.02  # of the hollow behind it
_ROOM_M = 0.012  # behind the wall, for the inner plate

# The clip.
_PLATE_M = 0.005  # thick
_HALF_M = 0.008  # of a plate's width
_SPARE_M = Range(0.0008, 0.002)  # between wall and plates, both together
# How far the clip tilts beyond where both plates touch the wall.
_PINCH_RAD = Range(0.04, 0.12)
_JAMS = Range(0.4, 0.75)  # of the length at which it would begin to slip
_LEAST_LENGTH_M = 0.008
_OVER_M = 0.002  # its bridge is above the rim
_BRIDGE_M = 0.016  # high
_INTO_M = 0.003  # how far the shaft goes into it
_FLANGE_M = Range(0.12, 0.2)  # from the clip of what pours
_TILT_RAD = Range(0.7, 1.1)  # of the flange at first, of what pours

# Its way.
_LIFT_M_S = Range(0.08, 0.2)
_CARRY_M_S = Range(0.15, 0.35)
_LOWER_M_S = 0.1
_PASS_M = Range(0.01, 0.03)  # above what is on the way
_SAG_M = 0.004  # that a vessel hangs lower than the clip went up
_SHORT_M = 0.03  # a shorter way on the level is none
_IN_M = 0.004  # above the rim, where the plates go in
# Above its place, where a vessel goes in below something: it hangs askew.
_INS_M = (0.03, 0.02, 0.01)
_MOST_GAP_M = 0.03  # below a vessel at its place, to what is to bear it
_HEADROOM_M = 0.03  # above it, for the clip
_ARM_M = 0.07  # from the shaft to the middle of the flange, which is outside, too
_BAR_M = Range(0.03, 0.06)  # from what is above to the shaft
_LEAVE_M = 0.05  # up from what was set down
_TURN_STEP_RAD = 0.3  # of a vessel that is turned on its way
_SWINGS = 8  # segments, in which what hangs comes to rest
_LET_GO_M = Range(0.005, 0.011)  # lower than where a vessel hangs, so that a peg has it
_ASIDE_RAD = Range(-0.3, 0.3)  # of the side to which it pours, by the way from the arm
_POUR_RAD = Range(1.75, 2.2)  # past the level, so that what does not roll slides out
_STREAM_M = Range(0.0, 0.03)  # that bodies fly on from the mouth's edge
_CLEAR_M = Range(0.01, 0.04)  # above what it is poured into
_STEPS = 7
_SHAKE_M = 0.02


@dataclass(frozen=True, eq=False)
class Rim:
    """Where a line through a vessel's axis crosses its rim first.

    Attributes:
        heading: of the line, radians about z.
        point: the rim's outer edge, (3,).
        wall: what it takes up along the heading, where plates go beside it, metres.
        along: from there to the vessel's other side, metres.
        depth: of the hollow behind it, metres.
    """

    heading: float
    point: Array
    wall: float
    along: float
    depth: float


def find_rim(vessel: Subgoal, heading: float) -> Rim | None:
    """Find the rim of an open vessel near a heading, radians, where plates meet its wall best; None: it has none.

    Walls that are round have flat parts: a plate along one of them pinches it without turning the vessel.

    Args:
        vessel: the subgoal of moving it.
        heading: along which a line goes from the rim to the vessel's axis, nearly.
    """
    key = ("rim", *map(id, vessel.solids), heading)

    def find() -> Rim | None:
        found = [_find_rim(vessel, heading + aside) for aside in _ASIDES_RAD]
        rims = [rim for rim in found if rim is not None]
        return min(rims, key=lambda rim: rim.wall, default=None)

    return vessel.model.find_once(key, find)


def _find_rim(vessel: Subgoal, heading: float) -> Rim | None:
    """Find the rim along a heading: what the wall takes up on all of three lines side by side."""
    extent = vessel.extent(heading)
    # Its frame is on its axis, and its bounds may have a handle in them.
    axis = vessel.solids[0].position
    middle = axis - (axis @ extent.ahead) * extent.ahead
    places = np.arange(extent.rear - _STEP_M, extent.front, _STEP_M)
    crossings = []
    for aside in (-_HALF_M, 0.0, _HALF_M):
        line = middle + aside * extent.side + places[:, None] * extent.ahead
        crossing = _cross_wall(find_profile(vessel, line), vessel.lower[2])
        if crossing is None:
            return None
        crossings.append(crossing)

    first = min(crossing.first for crossing in crossings)
    last = max(crossing.last for crossing in crossings)
    top = max(crossing.top for crossing in crossings)
    wall = (last - first) * _STEP_M
    if wall > _MOST_WALL_M:
        return None

    point = middle * LEVEL + places[first] * extent.ahead + top * UP
    depth = min(crossing.depth for crossing in crossings)
    return Rim(heading, point, wall, extent.front - places[first], depth)


class _Crossing(NamedTuple):
    """Where a line crosses a wall: numbers of places, its height, and the hollow's depth behind it, metres."""

    first: int
    last: int
    top: float
    depth: float


def _cross_wall(heights: Array, foot: float) -> _Crossing | None:
    """Find the first wall along a line that has a hollow behind it, before another wall; None: there is none.

    Args:
        heights: along the line, (K,).
        foot: of the vessel, which may stand out before its wall.
    """
    first = int(np.argmax(heights > foot + _LEAST_DEPTH_M))
    top = float(heights[first])
    if top < foot + _LEAST_DEPTH_M:
        return None

    other = np.flatnonzero(np.abs(heights[first:] - top) > _EVEN_M)
    if not len(other):
        return None

    last = first + int(other[0])
    inside = heights[last:][: int(_ROOM_M / _STEP_M)]
    depth = top - float(inside.max(initial=-np.inf))
    if not np.isfinite(depth) or depth < _LEAST_DEPTH_M:
        return None

    other_wall = float(heights[last:].max())
    if other_wall < top - depth + _LEAST_DEPTH_M:  # a bow has none
        return None

    return _Crossing(first, last, top, depth)


def find_rims(vessel: Subgoal) -> list[Rim]:
    """Find the rims of an open vessel along the way from the arm and across it, and back; see `find_rim`.

    Args:
        vessel: the subgoal of moving it.
    """
    away = vessel.workspace.direction(vessel.center)
    found = [find_rim(vessel, away + turn) for turn in QUARTERS]
    return [rim for rim in found if rim is not None]


def make_clip_lifter(vessel: Subgoal, rng: Generator) -> Head:
    """Make a clip that carries a vessel, or lifts it.

    Args:
        vessel: the subgoal of moving it, which has a rim.
        rng: random numbers.
    """
    rims = find_rims(vessel)
    onto = find_way_onto_peg(vessel)
    if onto is not None:
        # Across from the handle, a vessel sinks out of the clip when the handle bears it.
        handle = (vessel.center - vessel.solids[0].position) * LEVEL
        rim = min(rims, key=lambda rim: float(rim.point @ handle))
        clip = _draw_clip(vessel, rim, rng)
        return clip.make_head(partial(_hang_on_peg, clip, onto))

    if is_sheltered(vessel):
        below = _make_clip_below(vessel, rims, rng)
        if below is not None:
            return below

    clip = _draw_clip(vessel, rims[rng.integers(len(rims))], rng)

    def carry(path: HeadPath, rng: Generator) -> str:
        """Put the clip on, lift the vessel, carry it to its goal, and set it down there unless it is to be held."""
        turn = clip.take(path, rng)
        here = path.end
        raised = vessel.shift[2] + _SAG_M
        high = raised
        if vessel.length > _SHORT_M:
            high = max(high, vessel.height_on_way - vessel.lower[2] + _SAG_M)
        high += _PASS_M.draw(rng)

        path.move(here + high * UP, turn, _LIFT_M_S.draw(rng))
        if vessel.length > _SHORT_M:
            there = path.end + vessel.shift * LEVEL
            path.move(there, turn, _CARRY_M_S.draw(rng))

        if vessel.is_held or (vessel.rises and not vessel.is_released):
            return (
                f"hangs the vessel from a clip on its rim, and lifts it by {high:.2f} m"
            )

        down = path.end + (vessel.shift[2] - high) * UP
        path.move(down, turn, _LOWER_M_S)
        upright = clip.rim.heading
        path.go(upright, down, down + (clip.length + _LEAVE_M) * UP, touch=True)
        return (
            "hangs the vessel from a clip on its rim, carries it over and sets it down"
        )

    return clip.make_head(carry)


def _hang_on_peg(clip: _Clip, onto: Way, path: HeadPath, rng: Generator) -> str:
    """Put the clip on, lift the vessel, turn it, get it onto a peg by its handle, and leave it there.

    Args:
        clip: for the vessel.
        onto: from where it hangs to where it can be lifted.
        path: that waypoints are added to.
        rng: random numbers.
    """
    vessel = clip.vessel
    turn = clip.take(path, rng)
    here = path.end
    over = vessel.shift[2] + onto.whole[2]
    over = max(over, vessel.height_on_way - vessel.lower[2])
    lift = (over + _SAG_M + _PASS_M.draw(rng)) * UP
    path.move(here + lift, turn, _LIFT_M_S.draw(rng))

    origin = vessel.solids[0].position
    turned = path.turn_about(origin, vessel.yaw * UP, _TURN_STEP_RAD)

    hung = turned.position - lift + vessel.shift + _SAG_M * UP
    beside = hung + onto.whole
    above = np.array([*beside[:2], turned.position[2]])
    path.move(above, turned, _CARRY_M_S.draw(rng))
    let_go = _LET_GO_M.draw(rng)
    for place in (beside, hung + onto.rise * UP, hung - let_go * UP):
        path.move(place, turned, _LOWER_M_S)

    swing = find_swing(vessel)
    if swing is not None:  # let go at once, it would swing for long
        turned = path.turn_about(swing.middle, swing.turn, _TURN_STEP_RAD)

    upright = Rotation.from_rotvec(clip.rim.heading * UP)
    loosened = turned.rotation * turn.rotation.inv() * upright
    leave = loosened.apply((clip.length + _LEAVE_M) * UP)
    loose = Pose.from_rotation(path.end, loosened)
    path.go(loose, path.end, path.end + leave, touch=True)
    path.go(loose, *[path.end] * _SWINGS)
    return "hangs the vessel from a clip on its rim, and on a peg by its handle"


def _make_clip_below(
    vessel: Subgoal, rims: Sequence[Rim], rng: Generator
) -> Head | None:
    """Make a clip for a vessel below something, with a bar back to a shaft that stays outside; None: there is no way.

    Args:
        vessel: the subgoal of moving it.
        rims: where a clip may be put on.
        rng: random numbers.
    """
    ways = []
    for rim in rims:
        passage = find_passage(vessel, rim.heading, _INS_M, _HEADROOM_M)
        if passage is not None:
            ways.append((rim, passage))

    if not ways:
        return None

    rim, passage = ways[rng.integers(len(ways))]
    depth = max(
        find_depth(vessel, rim.point, rim.heading, shift)
        for shift in (np.zeros(3), vessel.shift)
    )
    bar = depth + _BAR_M.draw(rng)
    clip = replace(_draw_clip(vessel, rim, rng), bar=bar)

    def carry(path: HeadPath, rng: Generator) -> str:
        """Put the clip on, bring the vessel out, carry it over, bring it in, set it down and leave."""
        turn = clip.take(path, rng, passage.off)
        here = path.end
        there = here + vessel.shift - _find_gap(vessel) * UP
        out = here + passage.off
        before = there + passage.on
        over = (before - out) * LEVEL
        rise = (passage.rise + _SAG_M) * UP
        high = _SAG_M + max(
            passage.rise,
            there[2] - here[2] + passage.rise,
            find_rise(vessel, passage.off, over, _PASS_M.draw(rng)),
        )

        path.move(here + rise, turn, _LIFT_M_S.draw(rng))
        if passage.off.any():
            path.move(out + rise, turn, _LOWER_M_S)
        path.move(out + high * UP, turn, _LIFT_M_S.draw(rng))
        path.move(out + high * UP + over, turn, _CARRY_M_S.draw(rng))
        path.move(before + rise, turn, _LOWER_M_S)
        if passage.on.any():
            path.move(there + rise, turn, _LOWER_M_S)

        path.move(there, turn, _LOWER_M_S)
        if not vessel.is_held:
            free = there + (clip.length + passage.rise) * UP
            leave = free + passage.on
            path.go(rim.heading, there, free, leave, leave + _LEAVE_M * UP, touch=True)

        return "hangs the vessel from a clip on its rim, and brings it out or in below what is above"

    return replace(clip.make_head(carry), behind=bar + _ARM_M)


def _find_gap(vessel: Subgoal) -> float:
    """Find how far above what is to bear it a vessel is at its goal, metres; 0: that is far below, or unknown.

    Args:
        vessel: the subgoal of moving it, to a place that may be higher or lower than where it stands.
    """
    foot = vessel.center + vessel.shift
    top = float(find_tops(vessel.obstacles, foot[None])[0])
    gap = float(vessel.lower[2] + vessel.shift[2] - top)
    return gap if 0.0 < gap < _MOST_GAP_M else 0.0


def make_clip_pourer(subgoal: Subgoal, rng: Generator) -> Head | None:
    """Make a clip that turns the bodies' loose container over at their goal; None: it is not open, or too thick.

    Args:
        subgoal: the bodies that are poured.
        rng: random numbers.
    """
    holder = subgoal.loose_container
    if holder is None:
        return None

    vessel = Subgoal((holder,), subgoal.shift, subgoal.model)
    away = subgoal.workspace.direction(vessel.center)
    side = rng.choice([-1.0, 1.0])
    rim = find_rim(vessel, away + side * np.pi / 2)
    if rim is None:
        return None

    clip = _draw_clip(vessel, rim, rng)
    # The flange, tilted away from the side to which it pours, and not turned about itself.
    tilted = Pose.xyz_rpy(clip.attachment, (0.0, _TILT_RAD.draw(rng), 0.0))
    turned = Pose.xyz_rpy(_FLANGE_M.draw(rng) * UP, (0.0, 0.0, -side * np.pi / 2))
    flange = tilted @ turned

    def pour(path: HeadPath, rng: Generator) -> str:
        """Put the clip on, lift the vessel, carry it to the goal, turn it over in steps, and shake it."""
        pinching = clip.take(path, rng)
        high = subgoal.clear_height - vessel.lower[2] + _PASS_M.draw(rng)
        lifted = path.end + high * UP
        path.move(lifted, pinching, _LIFT_M_S.draw(rng))

        positions = [solid.position for solid in subgoal.solids]
        place = np.mean(positions, axis=0) + subgoal.shift
        away = subgoal.workspace.direction(place) + _ASIDE_RAD.draw(rng)
        heading = away + side * np.pi / 2
        ahead, _ = heading_axes(heading)
        mouth = place + _STREAM_M.draw(rng) * ahead

        # The clip stays above the goal, and comes down to what it is poured into.
        turn = _POUR_RAD.draw(rng)
        above = _find_target_top(subgoal) + _CLEAR_M.draw(rng)
        poses = []
        for angle in np.linspace(pinching.rpy[1], -turn, _STEPS + 1):
            turned = Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, angle, heading))
            there = np.array(mouth)
            there[2] = above - turned.apply(clip.corners)[:, 2].min()
            poses.append(Pose(there, turned.quaternion))

        start = np.array([*poses[0].position[:2], lifted[2]])
        path.move(start, poses[0], _CARRY_M_S.draw(rng))
        for pose in poses:
            path.add(pose, touch=True)

        end = path.end
        shaken = end + _SHAKE_M * UP
        path.go(path.poses[-1], shaken, end, touch=True)
        return (
            f"hangs the vessel from a clip on its rim, carries it by {subgoal.length:.2f} m "
            f"and turns it over by {np.degrees(turn):.0f} degrees"
        )

    return replace(clip.make_head(pour), mount_pose=flange.inverse())


def _find_target_top(subgoal: Subgoal) -> float:
    """Find the height of what the bodies are poured into, or of everything near, in the world."""
    goal = subgoal.goal
    if goal is None or goal.container is None:
        return subgoal.clear_height

    return float(subgoal.model.solids[goal.container].points[:, 2].max())


def _draw_clip(vessel: Subgoal, rim: Rim, rng: Generator) -> _Clip:
    """Draw a clip for a rim of a vessel.

    Args:
        vessel: the subgoal of moving it.
        rim: where the clip is put on.
        rng: random numbers.
    """
    # What hangs half its length beside plates of this length slips: it is pressed against them by as much.
    friction = float(np.sqrt(vessel.solids[0].body.friction * Tool().friction))
    slips = 2 * friction * rim.along / 2
    length = float(np.clip(slips * _JAMS.draw(rng), _LEAST_LENGTH_M, rim.depth / 2))

    return _Clip(vessel, rim, length, rim.wall + _SPARE_M.draw(rng))


@dataclass(frozen=True, eq=False)
class _Clip:
    """Two plates below a bridge, on both sides of a vessel's wall; lengths in metres.

    The origin of its frame is at the wall's outer edge, below the bridge; x goes into the vessel.

    Attributes:
        vessel: the subgoal of moving it.
        rim: where the clip is put on.
        length: of the plates below the rim.
        slot: between them.
        bar: how far behind the wall its shaft is, on a bar; 0: the shaft is above the bridge.
    """

    vessel: Subgoal
    rim: Rim
    length: float
    slot: float
    bar: float = 0.0

    @property
    def attachment(self) -> Array:
        """Where the shaft meets the bridge, (3,)."""
        x = -self.bar if self.bar else self.slot / 2
        return np.array([x, 0.0, _OVER_M + _BRIDGE_M - _INTO_M])

    @property
    def corners(self) -> Array:
        """The corners of the vessel that hangs from it, and of the bridge, (4, 3)."""
        bottom = self.vessel.lower[2] - self.rim.point[2]
        return np.array(
            [
                (x, 0.0, z)
                for x in (-_PLATE_M, self.rim.along)
                for z in (bottom, _OVER_M + _BRIDGE_M)
            ]
        )

    def make_head(self, motion: Motion) -> Head:
        """Make a head of a bridge and two plates.

        Args:
            motion: of the head.
        """
        width = 2 * _HALF_M
        bridge = (self.slot + 2 * _PLATE_M, width, _BRIDGE_M)
        plate = (_PLATE_M, width, self.length + _OVER_M)
        z = _OVER_M - plate[2] / 2
        spare = (self.slot - self.rim.wall) / 2
        outside = -spare - _PLATE_M / 2
        inside = self.slot - spare + _PLATE_M / 2
        middle = self.rim.wall / 2
        over = _OVER_M + _BRIDGE_M / 2
        pieces: tuple[Piece, ...] = (
            make_piece("bridge", middle, 0.0, over, bridge),
            make_piece("outer_plate", outside, 0.0, z, plate),
            make_piece("inner_plate", inside, 0.0, z, plate),
        )
        if self.bar:
            along = (self.bar + 2 * _HALF_M, width, _BRIDGE_M)
            bar = make_piece("bar", -self.bar / 2, 0.0, over, along)
            first, *plates = pieces
            pieces = (bar, first, *(replace(piece, parent=1) for piece in plates))

        return Head(
            "clip",
            "guided",
            pieces,
            self.attachment,
            self.slot,
            width,
            motion=motion,
        )

    def take(
        self, path: HeadPath, rng: Generator, outside: Array | None = None
    ) -> Pose:
        """Come down onto the rim, and tilt until both plates pinch the wall; return how the clip is turned then.

        Args:
            path: that waypoints are added to.
            rng: random numbers.
            outside: from there to where the clip comes from, on the level, (3,) metres; None or zeros: from above.
        """
        if outside is not None and outside.any():
            above = self.rim.point + (self.length + _IN_M) * UP
            path.descend(self.vessel, self.rim.heading, above + outside)
            path.go(self.rim.heading, above, self.rim.point)
        else:
            path.descend(self.vessel, self.rim.heading, self.rim.point)

        slack = np.arctan2(self.slot - self.rim.wall, self.length)
        pitch = -slack - _PINCH_RAD.draw(rng)
        turn = Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, pitch, self.rim.heading))
        path.go(turn, self.rim.point, touch=True)
        path.hold()
        return turn
