"""Follow two solids from instant to instant, to find out whether one passed through the other.

Conservative advancement: an instant is skipped if they can't have got deeper than what counts by then.

The search remembers from which side a solid got into another, and how far in along that direction. The least way out
of a body does not show that a thin sheet cuts through it: of a sheet in its lowest layer, the least way out is
downward, and no longer than the sheet is thick.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from core.geometry import Array, Capsule, Cylinder, Sphere
from core.robot.solids import corners
from core.solids.bodies import ROBOT, Solids
from core.solids.tracks import Indices, Pair, Track, Tracks, angles, lengths

DEEP_M = 0.01  # penetration allowed under pressure; at most half of what it takes to reach the other side
THIN_M = 0.003  # but for thin solids, pressed into a thick one too, as much as they are thick, and at least this much
THROUGH = (
    2 / 3
)  # share of the way to the middle that counts as a passage if the solid leaves on the other side
CUT_M = (
    0.001,
    0.003,
)  # so much farther in than the least way out: twice the thickness, within these limits
# Two solids only touch while they are no deeper than this share of the thinner one's thickness, and this depth: one of
# them the robot's, or two bodies, which may fall onto a thin wall at 4 m/s, 10 mm in an engine's step.
SKIN, SKIN_M = 0.3, 0.005
BODY_SKIN, BODY_SKIN_M = 0.5, 0.01
SAME = 0.9  # cosine of two directions that are about the same
DEEP_S = 0.06  # a hard blow may penetrate deeper, for this long

_FROM_AFAR_M = 0.02  # from this distance on, the first query finds the two apart: the side they came from is known

Passage = tuple[
    float, str
]  # the time when one got into the other, seconds, and a description
Instant = tuple[int, float]  # a sample, and the share of the way to the next


class Depths(NamedTuple):
    """How deep in each other, metres, two solids are when something begins; arrays (P,) for many pairs."""

    thick: Array  # as deep as the thinner one is thick
    deep: Array  # from here on, it is too deep
    through: Array  # from here on, they may have passed through each other
    skin: Array  # up to here they only touch: the side that each is on is clear
    cut: Array  # so much farther in than the least way out is a cut

    @classmethod
    def of(cls, solids: Solids, pairs: Indices) -> Depths:
        """Compute them for pairs (P, 2) of solids, of which the first one may be the robot's."""
        one, other = solids.widths[pairs.T]
        across, thick = one + other, 2 * np.minimum(one, other)
        robots = np.array([owner == ROBOT for owner in solids.owners])[pairs[:, 0]]
        pressed = np.minimum(across / 2, thick)
        return cls(
            thick,
            np.minimum(DEEP_M, np.maximum(pressed, np.minimum(THIN_M, 0.9 * across))),
            THROUGH * across,
            np.where(
                robots,
                np.minimum(SKIN_M, SKIN * thick),
                np.minimum(BODY_SKIN_M, BODY_SKIN * thick),
            ),
            np.minimum(np.maximum(2 * thick, CUT_M[0]), CUT_M[1]),
        )

    @property
    def least(self) -> Array:
        """The least of what counts."""
        return np.minimum(np.minimum(self.deep, self.through), self.skin)


class Side:
    """The direction out of one solid for another when they last only touched, in the frame of either."""

    def __init__(
        self, direction: Array, rotation: Array, others_rotation: Array
    ) -> None:
        self._own, self._others = direction @ rotation, direction @ others_rotation

    def same(self, direction: Array, rotation: Array, others_rotation: Array) -> bool:
        """Report whether a direction out is still about the same, for either solid: they roll on each other."""
        own, others = (
            float(direction @ rotation @ self._own),
            float(direction @ others_rotation @ self._others),
        )
        return max(own, others) > SAME

    def overlap(self, pair: Pair, k: int, share: float) -> float:
        """How far the first would have to go back along that direction until the two are apart, at most, metres.

        It is the smaller one of two: the direction may have turned with either solid. ``k`` and ``share`` are an
        instant as in `Track.at`.
        """
        one, other = pair.one, pair.other
        (here, rotation), (there, others_rotation) = (
            one.at(k, share),
            other.at(k, share),
        )
        apart = here.getTranslation() - there.getTranslation()
        depths = []
        for direction in (rotation @ self._own, others_rotation @ self._others):
            far = _extent(one, -(direction @ rotation)) + _extent(
                other, direction @ others_rotation
            )
            depths.append(far - float(apart @ direction))
        return min(depths)


def _extent(track: Track, direction: Array) -> float:
    """How far a solid extends from its frame's origin along a direction (3,) of the frame, metres."""
    x, y, z = map(float, direction)
    match track.shape:
        case Sphere(radius):
            return radius
        case Capsule(radius, length):
            return radius + length / 2 * abs(z)
        case Cylinder(radius, length):
            return radius * math.hypot(x, y) + length / 2 * abs(z)
    return float((corners(track.geometry) @ direction).max())


def find_passage(
    tracks: Tracks,
    number: int,
    others_number: int,
    near: Indices,
    depths: Sequence[float],
    times: Array,
) -> Passage | None:
    """Find out when a solid got into another in the intervals ``near`` and how; None if it never did.

    ``depths`` are the two's `Depths`.
    """
    thick, deep, through, skin, cut = depths
    limit, pair = min(deep, through), Pair(tracks[number], tracks[others_number])
    travel = _travel(
        tracks, number, others_number, near
    ).tolist()  # lists are faster one by one
    course = _Course(
        near.tolist(),
        travel,
        min(limit, skin),
        max(min(limit / 4, cut), min(limit, thick) / 2),
    )
    encounter, instants = _Encounter(pair, depths), times.tolist()
    instant: Instant | None = (course.near[0], 0.0)
    while instant is not None:
        k, share = instant
        now = instants[k] + (share * (instants[k + 1] - instants[k]) if share else 0.0)
        depth, passage = encounter.look(k, share, now)
        if passage is not None:
            return passage
        instant = course.after(k, share, depth)
    return encounter.cut


class _Encounter:
    """What is known of two solids that meet.

    Attributes:
        entry: the direction out of the second when they last only touched, in its frame; before that nothing counts.
        side: the same, which since then may have turned gradually.
        reached: the largest depth since then, metres.
        cut: when and how the first cut into the second, from where it may come out on the other side.
        since: when it got in, seconds.
        stuck: since when it is too deep, seconds.
    """

    def __init__(self, pair: Pair, depths: Sequence[float]) -> None:
        self.pair = pair
        _, self.deep, self.through, self.skin, self.far_in = depths
        self.limit = min(self.deep, self.through)
        self.least = min(self.limit, self.skin)
        self.entry: Array | None = None
        self.side: Side | None = None
        self.reached, self.since = 0.0, 0.0
        self.cut: Passage | None = None
        self.stuck: float | None = None

    def look(self, k: int, share: float, now: float) -> tuple[float, Passage | None]:
        """Look at an instant, which is ``now``, seconds; return the depth, and a passage if there is one."""
        depth, out, rotation, others_rotation = self.pair.query(k, share)
        if depth < self.skin or (
            self.side is not None and self.side.same(out, rotation, others_rotation)
        ):
            self.side = Side(out, rotation, others_rotation)
        elif (
            self.cut is None
            and self.side is not None
            and self.side.overlap(self.pair, k, share) > depth + self.far_in
        ):
            self.cut = now, f"cut into {{}} at {now:.2f} s"
        if depth < (self.limit if self.entry is None else self.least):
            if self._left(out @ others_rotation):
                return depth, (self.since, f"passed through {{}} at {self.since:.2f} s")
            self.entry, self.reached = out @ others_rotation, 0.0
        if self.entry is not None and depth >= self.limit:
            self.since = now if self.reached < self.limit else self.since
            self.reached = max(self.reached, depth)
        return depth, self._rests(depth, now, share)

    def _left(self, out: Array) -> bool:
        """Report whether the first, which only touches now, came out on another side than where it went in."""
        return (
            self.entry is not None
            and self.reached >= self.through
            and bool(out @ self.entry < 0.5)
        )

    def _rests(self, depth: float, now: float, share: float) -> Passage | None:
        """Find out at a sample whether the first has been too deep for too long."""
        if depth < self.deep:
            self.stuck = None
        elif share == 0 and self.entry is not None:
            self.stuck = now if self.stuck is None else self.stuck
            if now - self.stuck >= DEEP_S:
                return (
                    self.stuck,
                    f"was {1000 * self.reached:.0f} mm deep inside {{}} at {self.stuck:.2f} s",
                )
        return None


class _Course:
    """Which instants to look at.

    Attributes:
        near: the intervals in which the two may get as deep as ``least``, metres.
        travel: how far the one has moved in the frame of the other at each sample, metres.
        step: the way from one look to the next while they are as deep, metres.
    """

    def __init__(
        self, near: list[int], travel: list[float], least: float, step: float
    ) -> None:
        self.near, self.travel, self.least, self.step = near, travel, least, step
        self._intervals = set(near)

    def after(self, k: int, share: float, depth: float) -> Instant | None:
        """Find the instant to look at after one at which the two were at a depth; None: there is none."""
        travel, ahead = self.travel, self.travel[k]
        if share:
            ahead += share * (travel[k + 1] - travel[k])
        if depth >= self.least:
            if k + 1 == len(travel):
                return None
            ahead += self.step
            if k not in self._intervals or ahead >= travel[k + 1]:
                return k + 1, 0.0
        else:
            sure = ahead + self.least - depth
            ahead += (
                max(self.least - depth, self.step) if -depth < _FROM_AFAR_M else -depth
            )
            if k in self._intervals and sure < travel[k + 1] <= ahead:
                return (
                    k + 1,
                    0.0,
                )  # by then they may be as deep, and stay so though neither moves
            number = bisect_left(self.near, bisect_right(travel, ahead) - 1)
            if ahead > travel[-1] or number == len(self.near):
                return None
            if self.near[number] > k:
                return self.near[number], 0.0
        return k, (ahead - travel[k]) / (travel[k + 1] - travel[k])


def relative_ways(
    tracks: Tracks, one: Indices | int, other: Indices | int, near: Indices
) -> Array:
    """Bound how far any point of a solid moves in the frame of another from samples ``near`` to the next, metres."""
    rows, reach = tracks.rows, tracks.solids.reaches[one]
    here, there = tracks.row(one, near), tracks.row(other, near)
    if not np.any(tracks.moves[other]):
        return rows.moved[here] + reach * rows.turned[here]
    here_after, there_after = here + tracks.moves[one], there + tracks.moves[other]
    apart = rows.positions[here] - rows.positions[there]
    apart_after = rows.positions[here_after] - rows.positions[there_after]
    back, back_after = (rows.rotations[j].swapaxes(1, 2) for j in (there, there_after))
    shift = np.einsum("nij,nj->ni", back_after, apart_after) - np.einsum(
        "nij,nj->ni", back, apart
    )
    return lengths(shift) + reach * angles(
        back @ rows.rotations[here], back_after @ rows.rotations[here_after]
    )


def _travel(tracks: Tracks, number: int, others_number: int, near: Indices) -> Array:
    """How far the first has moved in the frame of the second (see `Track.travel`): (T,).

    Where they can't be ``near`` each other it is an upper bound.
    """
    one, other = tracks[number], tracks[others_number]
    if len(other.positions) == 1:
        return one.travel
    steps = one.moved + one.reach * one.turned + other.moved
    steps += (
        lengths(one.positions - other.positions) + one.moved + other.moved + one.reach
    ) * other.turned
    steps[near] = relative_ways(tracks, number, others_number, near)
    return np.concatenate([[0.0], np.cumsum(steps[:-1])])
