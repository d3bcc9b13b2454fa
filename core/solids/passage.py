"""Follow two solids from instant to instant, to find out whether one passed through the other.

An instant is left out if the two can't have got too deep by then (conservative advancement: B. Mirtich, "Impulse-based
dynamic simulation of rigid body systems", PhD thesis, Berkeley 1996, section 2.3).

The search remembers from which side a solid got into another, and how deep it is along that direction. The shortest
way out of a body does not show that a thin sheet cuts through it: of a sheet in its lowest layer, the shortest way out
is downward, and no longer than the sheet is thick. The steps stand in docs/physics_explained.md.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Collection, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from core.geometry import Array, running_sums
from core.robot.solids import WORLD, corners
from core.solids.near_pairs import Flags
from core.solids.rollout_solids import ROBOT, Solids
from core.solids.tracks import Indices, Look, Pair, Track, Tracks, angles, lengths

DEEP_M = 0.01  # penetration allowed under pressure; at most half of what it takes to reach the other side
THIN_M = 0.003  # but for thin solids, pressed into a thick one too, as much as they are thick, and at least this much
GUIDED_M = 0.003  # of a body on a joint in what is fixed: the joint says how it moves, and where it is pressed
# Share of the way to the middle from which on leaving on another side is a passage.
THROUGH = 2 / 3
# A cut is deeper along the side than the shortest way out by twice the thickness, within these limits.
CUT_LEAST_M = 0.001
CUT_MOST_M = 0.003
# Two solids only touch while they are no deeper than this share of the thinner one's thickness, and this depth: one of
# them the robot's, or two bodies, which may fall onto a thin wall at 4 m/s, 10 mm in an engine's step.
SKIN = 0.3
SKIN_M = 0.005
BODY_SKIN = 0.5
BODY_SKIN_M = 0.01
SAME = 0.9  # cosine of two directions that are about the same
# How often the way between two looks is halved, to see whether the way out turns gradually.
_HALVINGS = 5
DEEP_S = 0.06  # a hard blow may penetrate deeper, for this long, up to the far side or this depth
BLOW_M = 0.025  # a fall of more than a metre, 5 m/s in an engine's step of 5 ms
# Of two bodies, the engine pushes one out of the other within a few of its steps.
PUSHED_OUT_S = 0.01

_FROM_AFAR_M = 0.02  # from this distance on, the first look finds the two apart: the side they came from is known


_ELSEWHERE_M = 10.0  # the way in an interval in which two are far from each other: the next look is behind it


class Passage(NamedTuple):
    """How a solid got into another: when, seconds, and a description with room for the other's name."""

    time_s: float
    text: str


Sight = tuple[float, Look]
"""An instant, by the numbers of the samples and in between, and what is seen then."""


def _read(values: Sequence[float], instant: float) -> float:
    """Read a value (T,) at an instant, linear between the samples."""
    sample = int(instant)
    share = instant - sample
    value = values[sample]

    if share:
        value += share * (values[sample + 1] - value)

    return value


class Depths(NamedTuple):
    """How deep in each other, metres, two solids are when something begins: numbers, or arrays (P,) for many pairs.

    Attributes:
        thick: as deep as the thinner one is thick.
        deep: from here on, it is too deep.
        through: from here on, they may have passed through each other.
        limit: from here on, the first is inside the second: the less of these two.
        skin: up to here they only touch: the side that each is on is clear.
        least: the least of what counts.
        cut: from here on beyond the shortest way out, it is a cut.
        far: from here on, the first is beyond the far side of a wall or of the thinner one: no blow goes so deep.
        patience: seconds for which it may be beyond the far side, or inside before it comes out beside where it got in.
    """

    thick: Any
    deep: Any
    through: Any
    limit: Any
    skin: Any
    least: Any
    cut: Any
    far: Any
    patience: Any


def choose_depths(
    solids: Solids, pairs: Indices, guided: Collection[str] = ()
) -> Depths:
    """Choose what counts for pairs of solids.

    Args:
        solids: gives their widths.
        pairs: (P, 2) the solids' numbers; the first one moves, and may be the robot's.
        guided: the names of bodies on joints.

    Returns:
        Depths (P,).
    """
    first, second = solids.widths[pairs.T]
    across = first + second
    thick = 2 * np.minimum(first, second)
    most = np.minimum(across / 2, thick)
    pressed = np.maximum(most, np.minimum(THIN_M, 0.9 * across))
    deep = np.minimum(DEEP_M, pressed)
    rests = solids.frames[pairs[:, 1]] == WORLD
    robots = solids.owners[pairs[:, 0]] == ROBOT
    guides = np.isin(solids.owners[pairs[:, 0]], [*guided]) & rests
    deep = np.where(guides, np.minimum(GUIDED_M, deep), deep)
    through = THROUGH * across
    limit = np.minimum(deep, through)

    robots_skin = np.minimum(SKIN_M, SKIN * thick)
    bodies_skin = np.minimum(BODY_SKIN_M, BODY_SKIN * thick)
    skin = np.where(robots, robots_skin, bodies_skin)

    walls = robots & rests
    behind_wall = np.maximum(2 * second, THIN_M)
    far = np.where(walls, behind_wall, np.maximum(thick, BLOW_M))

    return Depths(
        thick=thick,
        deep=deep,
        through=through,
        limit=limit,
        skin=skin,
        least=np.minimum(limit, skin),
        cut=np.clip(2 * thick, CUT_LEAST_M, CUT_MOST_M),
        far=far,
        patience=np.where(robots, 0.0, PUSHED_OUT_S),
    )


def find_passage(
    pair: Pair,
    near: Indices,
    ways: Array,
    depths: Depths,
    times: Array,
) -> Passage | None:
    """Find out when the first of two solids got into the second and how; None if it never did.

    Args:
        pair: the two.
        near: the intervals in which they may get as deep as counts.
        ways: (T - 1,) how far the first moves in the frame of the second in each interval, metres, at most.
        depths: of the two.
        times: (T,) of the samples, seconds.
    """
    encounter = Encounter(pair, depths)
    course = Course(near, ways, depths)
    instants = times.tolist()
    instant: float | None = course.near[0]
    before: Sight | None = None

    while instant is not None:
        now = (instant, pair.look(instant))

        for between, look in _look_between(pair, before, now, depths.skin):
            passage = encounter.judge(look, between, _read(instants, between))
            if passage is not None:
                return passage

        before = now
        instant = course.find_next(*now)

    return encounter.cut


def _look_between(
    pair: Pair,
    before: Sight | None,
    now: Sight,
    skin: float,
    halvings: int = _HALVINGS,
) -> Iterator[Sight]:
    """Look between two looks, where the way out has turned far: a ball rounds an edge gradually, a sheet cuts at once.

    Args:
        pair: the two solids.
        before: the earlier look; None: there is none.
        now: the later one.
        skin: deeper than this the side counts, metres.
        halvings: how often the way between them may be halved.

    Yields:
        The looks between, in order, and then the later one.
    """
    instant, look = now
    if before is not None and halvings > 0 and look.depth >= skin:
        earlier, seen = before
        if not _is_same(look, turned_with(seen, look)):
            middle = (earlier + instant) / 2
            between = (middle, pair.look(middle))
            yield from _look_between(pair, before, between, skin, halvings - 1)
            yield from _look_between(pair, between, now, skin, halvings - 1)
            return

    yield now


def _is_same(look: Look, directions: Sequence[Array]) -> bool:
    """Report whether the way out is about one of the directions (3,)."""
    return max(float(look.out @ way) for way in directions) > SAME


class Encounter:
    """What is known of two solids that meet: a state machine that is fed with looks, in order.

    Apart, they have no entry. At the first look at which they only touch it is known where the first goes in. From then
    on it may get inside, leave on the same side, leave on another one (a passage), be stuck inside, or cut in.

    Attributes:
        pair: the two.
        depths: those that count.
        entry: the look at which they last only touched; before that nothing counts.
        side: the same, which since then may have turned gradually.
        reached: the largest depth since then, metres.
        cut: when and how the first cut into the second, from where it may come out on the other side.
        since: when it got in, seconds.
        until: when it was last found to be inside, seconds.
        stuck: since when it is too deep, seconds.
        beyond: since when it is beyond the far side, seconds.
    """

    def __init__(self, pair: Pair, depths: Depths) -> None:
        self.pair = pair
        self.depths = depths
        self.entry: Look | None = None
        self.side: Look | None = None
        self.reached = 0.0
        self.cut: Passage | None = None
        self.since = 0.0
        self.until = 0.0
        self.stuck: float | None = None
        self.beyond: float | None = None

    def judge(self, look: Look, instant: float, now: float) -> Passage | None:
        """Take a look at an instant, by the samples' numbers, which is ``now``, s; return a passage if there is one."""
        self._follow_side(look, now)
        touching = look.depth < (
            self.depths.limit if self.entry is None else self.depths.least
        )

        if touching:
            if self._has_left(look):
                return Passage(self.since, f"passed through {{}} at {self.since:.2f} s")
            self.entry = look
            self.reached = 0.0

        if self.entry is not None and look.depth >= self.depths.limit:
            if self.reached < self.depths.limit:
                self.since = now
            self.reached = max(self.reached, look.depth)
            self.until = now

        return self._find_stuck(look, instant, now)

    def _follow_side(self, look: Look, now: float) -> None:
        """Keep the side while the two only touch, or the way out turns gradually; else see whether it is a cut."""
        if look.depth < self.depths.skin:
            self.side = look
        elif self.side is not None:
            directions = turned_with(self.side, look)
            if _is_same(look, directions):
                self.side = look
            elif self.cut is None:
                overlaps = [overlap(self.pair, look, way) for way in directions]
                if min(overlaps) > look.depth + self.depths.cut:
                    self.cut = Passage(now, f"cut into {{}} at {now:.2f} s")

    def _has_left(self, look: Look) -> bool:
        """Report whether the first, which only touches now, came out on another side than where it went in.

        Of two bodies, an edge that meets an edge in an engine's step may be pushed out beside it, as it slips off.
        """
        if self.entry is None or self.reached < self.depths.through:
            return False

        _, entry = turned_with(self.entry, look)
        agreement = float(look.out @ entry)
        if agreement < -0.5:
            return True

        return agreement < 0.5 and self.until - self.since >= self.depths.patience

    def _find_stuck(self, look: Look, instant: float, now: float) -> Passage | None:
        """Find out at a sample whether the first has been too deep, or beyond the far side, for too long."""
        depths = self.depths

        if look.depth <= depths.far:
            self.beyond = None
        if look.depth < depths.deep:
            self.stuck = None
            return None
        if instant % 1 > 0 or self.entry is None:
            return None

        if self.stuck is None:
            self.stuck = now
        if look.depth > depths.far and self.beyond is None:
            self.beyond = now

        too_long = now - self.stuck >= DEEP_S
        if self.beyond is not None and now - self.beyond >= depths.patience:
            too_long = True
        if not too_long:
            return None

        text = f"was {1000 * self.reached:.0f} mm deep inside {{}}"
        return Passage(self.stuck, f"{text} at {self.stuck:.2f} s")


def turned_with(before: Look, now: Look) -> tuple[Array, Array]:
    """Turn the way out of an earlier look with the two solids.

    Args:
        before: the earlier look.
        now: the present one.

    Returns:
        Directions (3,) in the world: as if it were fixed to the first solid, and to the second.
    """
    out = before.out
    with_first = now.here.getRotation() @ (out @ before.here.getRotation())
    with_second = now.there.getRotation() @ (out @ before.there.getRotation())

    return with_first, with_second


def overlap(pair: Pair, look: Look, direction: Array) -> float:
    """How far the first would have to go back until the two are apart, at most, metres.

    Args:
        pair: the two.
        look: where they are.
        direction: (3,) in the world, along which it goes back.
    """
    far = _extent(pair.first, -(direction @ look.here.getRotation()))
    far += _extent(pair.second, direction @ look.there.getRotation())
    apart = look.here.getTranslation() - look.there.getTranslation()

    return far - float(apart @ direction)


def _extent(track: Track, direction: Array) -> float:
    """How far a solid extends from its frame's origin, metres.

    Args:
        track: of the solid.
        direction: (3,) along which it is measured, in the solid's frame.
    """
    if track.shape is not None and track.shape.is_round:
        return track.shape.extent(direction)

    return float((corners(track.geometry) @ direction).max())


class Course:
    """Which instants to look at: as few as possible, and none at which the two may be too deep is left out.

    Attributes:
        near: the intervals in which the two may get as deep as ``least``, metres.
        travel: how far the first has moved in the frame of the second at each sample, metres, at most.
        step: the way from one look to the next while they are as deep, metres.
    """

    def __init__(self, near: Indices, ways: Array, depths: Depths) -> None:
        self.near = near.tolist()
        self.travel = running_sums(ways).tolist()  # a list is faster
        self.least = depths.least
        limit = depths.limit
        self.step = max(min(limit / 4, depths.cut), min(limit, depths.thick) / 2)
        self._intervals = set(self.near)

    def find_next(self, instant: float, look: Look) -> float | None:
        """Find the instant to look at next.

        Args:
            instant: of the last look.
            look: the last one.

        Returns:
            The instant; None: there is none.
        """
        k = int(instant)
        travel = self.travel
        now = _read(travel, instant)

        if look.depth < self.least:
            return self._skip(k, now, look.depth)

        if k + 1 == len(travel):
            return None

        ahead = now + self.step
        if k not in self._intervals or ahead >= travel[k + 1]:
            return k + 1

        return self._between(k, ahead)

    def _skip(self, k: int, now: float, depth: float) -> float | None:
        """Leave out instants until the two may be as deep as counts, by how far they have moved ``now``, metres."""
        travel = self.travel
        room = self.least - depth
        way = max(room, self.step) if -depth < _FROM_AFAR_M else -depth
        ahead = now + way

        if k in self._intervals and now + room < travel[k + 1] <= ahead:
            return k + 1  # they may be as deep there, and stay so at rest

        number = bisect_left(self.near, bisect_right(travel, ahead) - 1)
        if ahead > travel[-1] or number == len(self.near):
            return None

        following = self.near[number]
        return following if following > k else self._between(k, ahead)

    def _between(self, k: int, ahead: float) -> float:
        before = self.travel[k]
        return k + (ahead - before) / (self.travel[k + 1] - before)


def relative_ways(tracks: Tracks, pairs: Indices, near: Flags) -> Array:
    """Bound how far any point of a pair's first solid moves in the frame of the second in each interval: (P, T - 1).

    Only in intervals ``near`` (P, T - 1) it is measured; else it is `_ELSEWHERE_M`.
    """
    rows = tracks.rows
    pair, interval = np.nonzero(near)
    first, second = pairs[pair].T

    # How each solid turns in an interval, once for all its pairs.
    needed = np.zeros((len(rows.rotations), near.shape[1]), dtype=bool)
    needed[first, interval] = True
    needed[second, interval] = True
    solid, begin = np.nonzero(needed)
    turns = np.empty((*needed.shape, 3, 3))
    turns[needed] = rows.rotations[solid, begin + 1] @ rows.rotations[
        solid, begin
    ].swapaxes(1, 2)

    carried = turns[second, interval]
    turned = angles(turns[first, interval], carried)
    ends = interval + np.array([[0], [1]])
    before, after = rows.positions[first, ends] - rows.positions[second, ends]
    moved = after - np.einsum("nij,nj->ni", carried, before)

    ways = np.full(near.shape, _ELSEWHERE_M)
    ways[near] = lengths(moved) + tracks.solids.reaches[first] * turned
    return ways
